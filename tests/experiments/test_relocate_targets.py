"""
What `relocate` is meant to reach, measured on seeds that it was not tuned on.

Run it with ``pytest -m slow -s`` on this file; it prints every number.
Its constants were chosen on seeds below 100. Plain forgetting runs on the same records.
"""

import gc
import os
import time
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pytest

from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring import limits as allowed
from flexaxis.experiments.scoring.case import Track, relative_error
from flexaxis.experiments.scoring.pools import spread
from flexaxis.experiments.scoring.table import rows as score
from flexaxis.experiments.scoring.theta import physical, true_theta
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.simulate import simulate

pytestmark = pytest.mark.slow

FIRST, SEEDS = 3000, 40
PLAIN = "rpem-forgetting[forgetting=0.995]"
RELOCATE = "relocate[forgetting=0.995]"  # not as tuned: both are to forget alike
LEAD = {  # lag, t10 [s] and the parameter's column
    "fm_step-v1": (0.11, 0.08, 2),
    "ja_step-v1": (0.16, 0.15, 1),
    "kt_step-v1": (0.13, 0.08, 0),
}
FAULTS = ["ja_big_step-v1", "two_faults-v1", "repair-v1", "kg_step-v1", "ka_step-v1", "jm_step-v1"]
FAULTS += ["dg_double-v1"]
MISMATCH = [("coulomb_fm_step-v1", "friction.coulomb", size) for size in (0.05, 0.1, 0.2)]
MISMATCH += [("backlash_fm_step-v1", "backlash.gear", size) for size in (1e-5, 5e-5)]


@dataclass(frozen=True)
class Measured:
    """One method on all records of a scenario; θ̃ in % of nominal, (seeds, samples, p)."""

    error: np.ndarray
    rows: list
    findings: list
    relative: list
    lost: int

    def std(self):
        columns = zip(*self.rows, strict=True)
        return np.array([spread([r["std"] for r in c], [r["bias"] for r in c]) for c in columns])


@lru_cache
def measured(name, changes=(), seeds=SEEDS):
    scenario = find_scenario(name).override(dict(changes) | {"name": "targets"})
    records = simulate(scenario, range(FIRST, FIRST + seeds))
    return scenario, records, *(on(scenario, records, text) for text in (RELOCATE, PLAIN))


def on(scenario, records, text):
    estimator = build(parse(text), scenario)
    nominal = true_theta(estimator.names, scenario.nominal.as_array())
    errors, rows, findings, relative, lost = [], [], [], [], 0
    for record in records:
        estimator.reset()
        theta, truth = estimator.run(record.torque, record.speed), record.true_parameters
        errors.append(100 * (theta - true_theta(estimator.names, truth)) / nominal)
        track = Track(scenario, tuple(estimator.names), theta, truth)
        rows.append(score(track))
        findings.append(getattr(estimator, "findings", ()))
        relative.append(relative_error(track))
        lost += track.lost is not None
    return Measured(np.array(errors), rows, findings, relative, lost)


def after_faults(scenario, error):
    """Return rms θ̃ of each parameter over all windows after a fault."""
    spans = windows(scenario, scenario.identify)
    parts = [error[:, w.start : w.stop] for w in spans]
    return np.sqrt(np.mean(np.concatenate(parts, axis=1) ** 2, axis=(0, 1)))


def explained(scenario, findings):
    """Whether every fault was named with its size within 5 %, or said to be unmodelled."""
    for event in scenario.events():
        mine = [f for f in findings if 0 <= f.alarm - event.index < 400]
        sizes = [
            f.ratio[0] ** physical(f.parameters[0])[1] * event.before / event.after
            for f in mine
            if [physical(name)[0] for name in f.parameters] == [event.parameter]
        ]
        unmodelled = any(f.parameters == () for f in mine)
        if not unmodelled and not any(abs(size - 1) < 0.05 for size in sizes):
            return False
    return True


def report(title, **numbers):
    shown = (f"{k} {np.round(v, 3).tolist()}" for k, v in numbers.items())
    print(f"\n{title}: {'; '.join(shown)}", end="")


@pytest.mark.parametrize("name", LEAD)
def test_quick_and_no_noisier(name):
    lag, t10, i = LEAD[name]
    scenario, records, mine, plain = measured(name)
    lags = np.mean([run[i]["lag"] for run in mine.rows])
    settled = np.median([np.inf if run[i]["t10"] is None else run[i]["t10"] for run in mine.rows])
    noisier = mine.std() / plain.std()
    bounds = [
        allowed.limits(scenario, scenario.identify, record.torque)[i].bound for record in records
    ]
    parameter = scenario.identify[i]
    efficiency = [
        np.sqrt(np.mean([r[parameter][n] ** 2 for r in mine.relative]))
        / np.sqrt(np.mean([b[str(n)] ** 2 for b in bounds]))
        for n in (100, 200, 400)
    ]
    report(name, lag=lags, t10=settled, std_over_plain=noisier, efficiency=efficiency,
           named=np.mean([explained(scenario, f) for f in mine.findings]))  # fmt: skip
    assert lags <= lag and settled <= t10
    assert noisier.max() <= 1.05
    assert max(efficiency) <= 1.4


def test_no_false_alarm_in_2000_s():
    _, _, mine, _ = measured("fm_step-v1", (("fault", ()), ("duration", 40.0)), 50)
    report("no fault, 2000 s", alarms=sum(map(len, mine.findings)))
    assert not any(mine.findings)


@pytest.mark.parametrize("name", FAULTS)
def test_is_never_worse_than_forgetting_and_says_what_happened(name):
    scenario, _, mine, plain = measured(name)
    rms, reference = (after_faults(scenario, m.error) for m in (mine, plain))
    most = max(map(len, mine.findings)) / len(scenario.events())
    named = np.mean([explained(scenario, f) for f in mine.findings])
    report(name, rms=rms, plain=reference, alarms_a_fault=most, explained=named, lost=mine.lost)
    assert mine.lost == 0
    assert most <= 2
    assert np.all(rms <= reference)
    assert rms.max() < reference.max() / 2
    assert named >= 0.9


@pytest.mark.parametrize(("name", "key", "size"), MISMATCH)
@pytest.mark.parametrize("fault", [True, False])
def test_no_storm_where_the_model_is_wrong(name, key, size, fault):
    changes = ((key, size),) if fault else ((key, size), ("fault", ()))
    scenario, _, mine, plain = measured(name, changes)
    onset = scenario.events()[0].index if fault else scenario.samples
    found = [any(0 <= f.alarm - onset < 1000 for f in run) for run in mine.findings]
    beyond = sum(map(len, mine.findings)) - sum(found)
    seconds = scenario.duration * SEEDS
    noisier = mine.std() / plain.std()
    report(f"{key} {size}, {'fault' if fault else 'no fault'}", found=sum(found),
           alarms_beyond=beyond, seconds_an_alarm=seconds / max(beyond, 1),
           std_over_plain=noisier, lost=mine.lost)  # fmt: skip
    assert mine.lost == 0
    assert beyond <= seconds / 120
    assert noisier.max() <= 1.05
    assert np.exp(np.mean(np.log(noisier))) <= 1.0


def test_a_step_takes_less_than_a_sample():
    """On a loaded machine the time of the processor is judged, as others take the rest."""
    wall, own = [], []
    names = [*LEAD, "two_faults-v1", "jm_step-v1", "dg_double-v1"]
    for name in names:
        scenario, records, _, _ = measured(name)
        estimator = build(parse(RELOCATE), scenario)
        for record in records[:5]:
            estimator.reset()
            for u, y in zip(record.torque, record.speed, strict=True):
                before = time.perf_counter(), time.thread_time()
                estimator.step(u, y)
                wall.append(time.perf_counter() - before[0])
                own.append(time.thread_time() - before[1])
    at = (50, 99, 99.9, 100)
    report(f"a step [ms], load {os.getloadavg()[0]:.1f}, gc {gc.isenabled()}", percentiles=at,
           wall=1e3 * np.percentile(wall, at), cpu=1e3 * np.percentile(own, at))  # fmt: skip
    assert max(own) < 0.005
