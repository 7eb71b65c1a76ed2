"""Missing rows: what acted in them is not known, and neither biases an answer nor passes unseen."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators.offline.descent import Problem
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.as_log import LogStyle, logged, write_log
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identification.candidates import held_out
from flexaxis.experiments.logs.identification.gap_torque import filled
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.identification.log import UNKNOWN, gaps, log_of
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.track import track
from flexaxis.experiments.running.estimators import parse
from flexaxis.sim.simulate import simulate

NAMES = ("J_m", "J_l", "k", "d", "f_m")


@pytest.fixture(scope="module")
def scenario():
    found = find_scenario("two_mass_fm_step-v1").override({"fault[0].at": 5.0, "duration": 6.0})
    return found.override({"fault": []})


@pytest.fixture(scope="module")
def gapped(scenario, tmp_path_factory):
    """A log of an axis without a fault, in which up to 20 rows are missing, 4 times."""
    return of_gaps(scenario, 4, tmp_path_factory.mktemp("log") / "log.csv")


@pytest.fixture(scope="module")
def whole(scenario, tmp_path_factory):
    """The same log without gaps."""
    return of_gaps(scenario, 0, tmp_path_factory.mktemp("log") / "log.csv")


@pytest.fixture(scope="module")
def truth(scenario):
    return scenario.nominal.as_dict()


def of_gaps(scenario, number, path, seed=0):
    style = LogStyle(gaps=number)
    record = simulate(scenario, [seed])[0]
    write_log(path, logged(record, style, np.random.default_rng(seed)), style)
    return import_log(path, {"torque_is": "held"}, burn_in=0.0).record


def identified(record, truth):
    begun = {n: 0.8 * truth[n] for n in NAMES}
    axis = find_axis("two_mass").having({"k_T": 1.0, "f_l": 0.001} | begun)
    return identify(record, axis, fix=("k_T", "f_l"), delay=0.0, friction="none", gravity="none")


def test_parameters_are_those_of_a_log_without(truth, gapped):
    """The speed is off by 3 rad/s behind a gap where the torque in it is a line."""
    assert 10 < (~gapped.valid).sum() < 100
    found = identified(gapped, truth)
    assert set(found.names) == set(NAMES)
    np.testing.assert_allclose(found.theta, [truth[n] for n in found.names], rtol=1e-4)
    assert found.warnings == []


def test_no_state_is_tried_that_is_far_beyond_the_motion(truth, gapped, monkeypatch):
    """A start of a search may be an axis whose load is seen by nothing: of it any would do."""
    tried, simulate = [], Problem.at

    def watched(problem, z, *others, **options):
        tried.extend(float(abs(z[place]).max()) for place in problem.course.states[1:])
        return simulate(problem, z, *others, **options)

    monkeypatch.setattr(Problem, "at", watched)
    identified(gapped, truth)
    log = log_of(gapped, find_axis("two_mass"))
    greatest = max(abs(log.y[log.ok]).max(), np.ptp(log.angle))
    assert 0 < max(tried) < 101 * greatest


def test_an_estimator_sees_no_change_there(truth, gapped):
    values = {n: truth[n] for n in ("k_T", "f_l", *NAMES)}
    axis = replace(find_axis("two_mass").having(values), known=True)
    found = track(gapped, axis, parse("ekf"), identify=("f_m",))
    assert found.changes == [] and found.doubts == []
    assert found.fit > 99.9
    assert found.last == pytest.approx(values["f_m"], rel=1e-3)


def test_noise_drives_no_state_away(scenario, truth, tmp_path):
    """Of seed 2001 a search meets axes whose load is seen by nothing."""
    noisy = scenario.override({"duration": 10.0, "noise.angle": 1e-3})
    found = identified(of_gaps(noisy, 4, tmp_path / "log.csv", seed=2001), truth)
    assert found.warnings == []
    off = found.theta - [truth[name] for name in found.names]
    assert np.all(abs(off) < 4 * found.deviations)
    assert np.all(found.deviations < 0.03 * found.theta)


@pytest.mark.parametrize("number", [30, 100])
def test_of_many_gaps_the_longest_begin_a_stretch(scenario, number, tmp_path):
    log = log_of(of_gaps(scenario, number, tmp_path / "log.csv"), find_axis("two_mass"))
    begins, there = log.begins(3, 4), {end + 4: end - begin for begin, end in gaps(log.ok)}
    assert 1 < len(begins) <= 1 + UNKNOWN // 3
    assert max(there.values()) in {there.get(begin) for begin in begins}


def missing(record, rows):
    """A record of which rows are missing, the torque a line through them."""
    valid, k = np.ones(len(record.time), bool), np.arange(len(record.time))
    valid[rows] = False
    line = {n: np.interp(k, k[valid], getattr(record, n)[valid]) for n in ("torque", "increment")}
    valid[1:] &= valid[:-1]  # an increment needs both of its ends
    return replace(record, valid=valid, **line)


@pytest.mark.parametrize(
    ("rows", "late", "burn_in"),
    [
        (np.r_[10:15], 0, 0.0),
        (np.r_[0:20], 0, 0.0),
        (np.r_[203:215, 600:610], 0, 1.0),
        (np.r_[300:320, 700:703], 3, 0.0),
        (np.r_[300:310, 314:320, 330:335], 0, 0.0),
    ],
    ids=["near the start", "at the start", "behind the burn-in", "with a delay", "close by"],
)
def test_wherever_a_gap_is(whole, truth, rows, late, burn_in):
    moved = np.r_[np.zeros(late), whole.increment][: len(whole.time)]
    record = replace(missing(replace(whole, increment=moved), rows), burn_in=burn_in)
    axis = find_axis("two_mass").having({n: truth[n] for n in ("k_T", "f_l", *NAMES)})
    setup = Setup(log_of(record, axis), axis.model, NAMES, delay=late * record.period)
    values = np.array([truth[n] for n in NAMES])
    np.testing.assert_allclose(setup.solve(0.9 * values).z[:5], values, rtol=1e-3)


def test_a_known_torque_stays(scenario):
    """Where a simulation has no output it has a torque."""
    record = simulate(scenario, [0])[0]
    known = replace(record, valid=np.arange(len(record.time)) % 300 > 20)
    axis = find_axis("two_mass")
    log = log_of(known, axis)
    assert len(log.begins(3, 4)) == 1
    assert filled(log, axis, known.valid) is log


def test_what_comes_at_once_behind_a_gap_is_fitted(scenario, tmp_path):
    axis = find_axis("two_mass")
    log = log_of(of_gaps(scenario, 12, tmp_path / "log.csv"), axis)
    setup = Setup(log, axis.model, NAMES, delay=0.0)
    held = held_out(setup)
    assert len(setup.begins) > 4
    assert all(not held[begin : begin + 3].any() for begin in setup.begins)
    assert 0.05 * len(held) < held.sum() < 0.3 * len(held)


def test_rows_missing_everywhere_cost_few_others(whole):
    record = missing(whole, np.flatnonzero(np.random.default_rng(0).random(len(whole.time)) < 0.1))
    axis = find_axis("two_mass")
    setup = Setup(log_of(record, axis), axis.model, NAMES)
    assert setup.counted.sum() > 0.75 * record.valid.sum()
