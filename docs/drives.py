"""Write the tables of docs/drives.md and its figure.

`python docs/drives.py axes`, or another name of a table, or `figure`, makes that only.
`found` and `goal` are of results/drives, which is run if it is not there, ten minutes.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from making import VERSION, table, write
from matplotlib.figure import Figure
from numpy.typing import NDArray
from suite_rows import GEARED, HOME, WHO, changed, said

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.bounds import jump_bound
from flexaxis.experiments.scoring.parameter_names import nominal_theta
from flexaxis.experiments.scoring.true_model import with_structure
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate
from flexaxis.sim.stability import _continuous, _sampled
from flexaxis.sim.tables.friction import GearFrictionConfig, StaticFrictionConfig

Array = NDArray[np.float64]

PAGE = HOME / "drives.md"
PICTURE = HOME / "images" / "drives.png"
DRIVES = {
    "wg": "wg_fc_step-v1", "erob80_50": "erob80_50_fm_step-v1",
    "erob80_100": "erob80_100_fm_step-v1", "mx64": "mx64_fc_step-v1",
    "mx106": "mx106_fm_step-v1", "xl320": "xl320_fm_step-v1", "xl330": "xl330_fm_step-v1",
    "sts3215": "sts3215_fm_step-v1", "bench": "bench_fm_step-v1",
}  # fmt: skip


def modes(scenario: Scenario) -> str:
    """Return frequencies and damping ratios of the two modes."""
    poles = np.linalg.eigvals(_continuous(scenario.nominal)[:6, :6])
    poles = sorted(poles[poles.imag > 1], key=abs)
    return "; ".join(f"{abs(p) / 2 / np.pi:.3g} Hz ({-p.real / abs(p):.2g})" for p in poles)


def sensitivity(scenario: Scenario) -> float:
    """Return the largest modulus of 1/(1 + L) up to half the sampling rate, of the linear axis."""
    c, T = scenario.controller, scenario.period
    F, g = _sampled(scenario.nominal, T)
    z = np.exp(1j * np.geomspace(0.5 * T, 0.999 * np.pi, 4000))
    plant = np.array([np.linalg.solve(each * np.eye(6) - F, g)[0] for each in z])
    pole = np.exp(-T / c.tau)
    speed = (1 - pole) / T * (z - 1) / (z - pole)
    loop = c.Kv * (c.Kp + speed) * (1 + T * c.Ki * z / (z - 1)) * plant
    return float(np.abs(1 / (1 + loop)).max())


def friction(scenario: Scenario, v: Array, load: float = 0.0) -> Array:
    """Return the friction (n,) [N m] at speeds, where the motor carries a steady load [N m]."""
    found = scenario.nominal.f_m * v
    for law in scenario.nonlinear.values():
        if isinstance(law, GearFrictionConfig | StaticFrictionConfig):
            row = [0.0, 0.0, *map(float, law.model_dump().values())]
            found = found + [law.torque(row, x, 0.0, -load, load) for x in v]
    return np.asarray(found)


def axes() -> str:
    """Return what is known of the drives, and what the reference asks of them."""
    rows = []
    for name, of in DRIVES.items():
        scenario = find_scenario(of)
        (record,) = simulate(scenario, [1000])
        k = slice(len(record.time) // 4, len(record.time) // 2)
        u, v = record.torque[k], record.true_speed[k]
        rms = float(v.std())
        dry, viscous = friction(scenario, np.array([rms]), float(u.std()))[0], scenario.nominal.f_m
        p = scenario.nominal
        rows.append([
            f"`{name}`", f"{p.J_m:.3g}; {p.J_g + p.J_a:.3g}", f"{p.k_g:.3g}", modes(scenario),
            f"{sensitivity(scenario):.2f}", f"{rms:.2g}; {np.abs(v).max():.2g}",
            f"{u.std():.2g}; {np.abs(u).max():.2g}",
            f"{dry:.2g}; {100 * viscous * rms / dry:.0f} %",
        ])  # fmt: skip
    heads = ["drive", "J_m; load [kg m²]", "k_g [N m/rad]", "modes (damping)", "margin",
             "speed: rms; peak [rad/s]", "torque: rms; peak [N m]",
             "friction at rms speed and torque [N m]; viscous part"]  # fmt: skip
    return table(heads, rows) + f"\n`python docs/drives.py axes`, {VERSION}.\n"


def figure() -> Figure:
    """Return friction over speed, without load and under the rms torque of the scenario."""
    found = Figure(figsize=(9, 7), layout="constrained")
    for axis, (name, of) in zip(found.subplots(3, 3).ravel(), DRIVES.items(), strict=True):
        scenario = find_scenario(of)
        (record,) = simulate(scenario.override({"duration": 5.0, "fault": []}), [1000])
        v = np.linspace(0, 1.2 * float(np.abs(record.true_speed).max()), 300)
        axis.plot(v, friction(scenario, v), "C0", label="no load")
        axis.plot(v, friction(scenario, v, record.torque.std()), "C1", label="at rms torque")
        axis.plot(v, scenario.nominal.f_m * v, "k--", lw=1, label="f_m v")
        axis.set(title=name, xlabel="v [rad/s]", ylabel="friction [N m]", ylim=(0, None))
    found.axes[0].legend(fontsize="small")
    return found


def found() -> str:
    """Return what each estimator makes of each drive."""
    rows = []
    for name in find_suite("drives").scenarios:
        cells = [_made_of_it(changed("drives", name, who)) for who in WHO["drives"][:-1]]
        rows.append([f"`{name}`", *cells])
    heads = [f"`{who}`" for who in WHO["drives"][:-1]]
    return table(["scenario", *heads], rows) + said("drives", "drives")


def _made_of_it(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "–"
    parts = [f"{row['bias']:+.2g} ± {row['std']:.2g} %"]
    if row["changed"]:
        bound = row.get("lag_bound")
        times = f" = {row['lag'] / bound:.2g} × bound" if bound else ""
        parts.append(f"{row['lag']:.2g} s{times}")
    heard = row.get("detection")
    if heard:
        named = heard.get("isolated")
        parts.append("" if not row["changed"] else f"found {100 * (1 - heard['missed']):.0f} %, "
                     f"named {100 * (named or 0):.0f} %")  # fmt: skip
        parts.append(f"{2 * (heard['false_alarms_per_1000_s'] or 0):.2g} false")
    lost = f"; **{row['diverged']} of {row['runs']} lost**" if row["diverged"] else ""
    return "; ".join(part for part in parts if part) + lost


SURE = 2.0  # %, sd by the bound in 10 s with which a parameter counts, and the bias that is allowed
SLOW, SEEN, FALSE = 1.5, 0.95, 1.0  # × bound; share found, and named; false alarms in 2000 s


def goal() -> str:
    """Return which faults the data can show at all, and what is missed of the goal in them."""
    rows = []
    for name in find_suite("drives").scenarios:
        scenario = find_scenario(name)
        if not scenario.events() or scenario.nuisance:
            continue
        sd, after, before = _known_in_ten_seconds(scenario)
        counts = min(sd, sd * after) <= SURE
        whole = f"{sd * after:.2g}" if after != 1 else ""
        cells = [_missed(changed("drives", name, who), before) for who in WHO["drives"][:2]]
        rows.append([f"`{name}`", scenario.events()[0].parameter, f"{sd:.2g}", whole,
                     "yes" if counts else "no", *cells])  # fmt: skip
    heads = ["scenario", "fault in", "sd [%]", "of all friction [%]", "counts"]
    heads += [f"`{who}` misses" for who in WHO["drives"][:2]]
    return table(heads, rows) + said("drives", "drives")


def _known_in_ten_seconds(scenario: Scenario) -> tuple[float, float, float]:
    """Return the sd [%] of what fails by the bound, and its shares in what it is a part of.

    Structure is unknown, too. Of f_m and f_c these are their shares in all friction at rms speed
    and torque before the fault, after it and before; of any other parameter 1.
    """
    (record,) = simulate(scenario, [1000])
    event = scenario.events()[0]
    inverse = f"1/{event.parameter}"
    name = inverse if inverse in scenario.identify else event.parameter
    names = with_structure(scenario, (*(n for n in scenario.identify if n != name), name))
    stop = min(event.index + round(10 / scenario.period), scenario.samples)
    bound = jump_bound(scenario, names, event.index, stop, record.torque)
    deviation = bound.unknown[-1, names.index(name)]
    size = abs(1 / event.after if name == inverse else event.after)
    k = slice(len(record.time) // 4, len(record.time) // 2)
    rms, load = float(record.true_speed[k].std()), float(record.torque[k].std())
    arm = {"f_m": rms, "f_c": 1.0}.get(name)
    whole = friction(scenario, np.array([rms]), load)[0]
    shares = (1.0, 1.0) if arm is None else (event.after * arm / whole, event.before * arm / whole)
    return 100 * deviation / size, *shares


def _missed(row: Mapping[str, Any] | None, share: float) -> str:
    """Return in words what a row misses of the goal; a bias counts by its share."""
    assert row is not None
    heard = row["detection"]
    misses = {
        "bias": abs(row["bias"]) * share > SURE,
        "lag": row["lag"] > SLOW * (row["lag_bound"] or np.inf),
        "found": 1 - heard["missed"] < SEEN,
        "named": (heard["isolated"] or 0) < SEEN,
        "false": 2 * heard["false_alarms_per_1000_s"] > FALSE,
        "lost": row["diverged"] > 0,
    }
    return ", ".join(word for word, missed in misses.items() if missed) or "nothing"


NO_SHARES = dict.fromkeys(
    [f"gear_friction.{key}" for key in ("motor", "external", "motor_slow", "external_slow")], 0.0
)
WHY = ("erob80_50_fm_step-v1", "erob80_50_ja_step-v1", "mx106_fm_step-v1", "xl330_fm_step-v1")


def why() -> str:
    """Return what is left of the errors of the recommended estimator without shares of load."""
    rows = []
    for name in WHY:
        published = find_scenario(name)
        without = published.override({**NO_SHARES, "name": "without"}, inherit=True)
        only = without.override({"gear_friction.f_s": 0.0, "name": "coulomb"}, inherit=True)
        rows.append([f"`{name}`", *(_biases(s) for s in (published, without, only))])
    heads = ["as published", "without shares of load", "and without excess at low speed"]
    runs = f"seeds {FEW.start} to {FEW.stop - 1}"
    below = f"\n`{GEARED}`, {runs}, `python docs/drives.py why`, {VERSION}.\n"
    return table(["scenario", *heads], rows) + below


FEW = range(1000, 1002)


def _biases(scenario: Scenario) -> str:
    """Return the mean error of each parameter from burn-in to the fault [% of nominal]."""
    spec, k = parse(GEARED), slice(round(5 / scenario.period), round(10 / scenario.period))
    means = []
    for record in simulate(scenario, FEW):
        estimator = build(spec, scenario)
        theta = run_estimator(estimator, record.torque, record.increment)[k]
        truth = nominal_theta(scenario, scenario.identify)
        mine = [list(estimator.names).index(name) for name in scenario.identify]
        means.append(100 * (theta[:, mine].mean(axis=0) / truth - 1))
    parts = zip(scenario.identify, np.mean(means, axis=0), strict=True)
    return "; ".join(f"{name} {value:+.2g}" for name, value in parts)


TABLES: Mapping[str, Callable[[], str]] = {f.__name__: f for f in (axes, found, goal, why)}


def main(names: Sequence[str]) -> None:
    """Make the tables and the figure of these names, all if there are none."""
    if not names or "figure" in names:
        figure().savefig(PICTURE, dpi=110)
    if names != ["figure"]:
        write(PAGE, TABLES, [name for name in names if name != "figure"])


if __name__ == "__main__":
    main(sys.argv[1:])
