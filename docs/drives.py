"""Write the tables of docs/drives.md and docs/control.md, and the figure of the first.

`python docs/drives.py axes`, or another name of a table, or `figure`, makes that only.
`found` is of results/drives, `worth` and `order` are of results/control, which are run if they are
not there: SEEDS seeds from 1000 on, half an hour each.
"""

import json
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import spearmanr

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.estimator_text import build, parse
from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.cli import main as main_of_command
from flexaxis.experiments.scoring.parameter_names import nominal_theta
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate
from flexaxis.sim.tables.friction import GearFrictionConfig, StaticFrictionConfig
from flexaxis.sim.tables.stability import _continuous, _sampled

Array = NDArray[np.float64]

HOME = Path(__file__).parent
PAGES = (HOME / "drives.md", HOME / "control.md")
PICTURE = HOME / "images" / "drives.png"
MARK = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)
SEEDS = 8
DRIVES = {
    "wg": "wg_fc_step-v1", "erob80_50": "erob80_50_fm_step-v1",
    "erob80_100": "erob80_100_fm_step-v1", "mx64": "mx64_fc_step-v1",
    "mx106": "mx106_fm_step-v1", "xl320": "xl320_fm_step-v1", "xl330": "xl330_fm_step-v1",
    "sts3215": "sts3215_fm_step-v1", "bench": "bench_fm_step-v1",
}  # fmt: skip
GEARED = "glr[gear=true]"
WHO = {
    "drives": ("glr", GEARED, "ekf", "rpem-forgetting", "frozen"),
    "control": ("glr", "ekf", "rpem-forgetting", "rpem-drift", "cusum-reset"),
}


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
    for table in scenario.nonlinear.values():
        if isinstance(table, GearFrictionConfig | StaticFrictionConfig):
            row = [0.0, 0.0, *map(float, table.model_dump().values())]
            found = found + [table.torque(row, x, 0.0, -load, load) for x in v]
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
    return table(
        ["drive", "J_m; load [kg m²]", "k_g [N m/rad]", "modes (damping)", "margin",
         "speed: rms; peak [rad/s]", "torque: rms; peak [N m]",
         "friction at rms speed and torque [N m]; viscous part"], rows
    )  # fmt: skip


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


@cache
def results(suite: str) -> Any:
    """Return the pooled rows of a suite, by scenario, estimator and parameter."""
    folder = HOME.parent / "results" / suite
    if not (folder / "summary.json").exists():
        who = [word for name in WHO[suite] for word in ("--estimator", name)]
        seeds = f"1000:{1000 + SEEDS}"
        main_of_command(["run", suite, *who, "--seeds", seeds, "-o", str(folder)])
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    return {(r["scenario"], r["estimator"], r["parameter"]): r for r in rows}


def changed(suite: str, scenario: str, estimator: str) -> Mapping[str, Any] | None:
    """Return the row of the parameter that fails, or of the first where that is not estimated."""
    rows = [r for (s, e, _), r in results(suite).items() if (s, e) == (scenario, estimator)]
    return next((r for r in rows if r["changed"]), rows[0] if rows else None)


def found() -> str:
    """Return what each estimator makes of each drive."""
    rows = []
    for name in find_suite("drives").scenarios:
        cells = [_made_of_it(changed("drives", name, who)) for who in WHO["drives"][:-1]]
        rows.append([f"`{name}`", *cells])
    heads = [f"`{who}`" for who in WHO["drives"][:-1]]
    return table(["scenario", *heads], rows) + said("drives")


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
    return (
        table(["scenario", *heads], rows) + f"\n`{GEARED}`, {runs}, `python docs/drives.py why`.\n"
    )


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


def worth() -> str:
    """Return what each estimator recovers, beside what a fault costs and the told one recovers."""
    rows = []
    for name in find_suite("control").scenarios:
        first = changed("control", name, "glr")
        assert first is not None
        errors = first["tracking"]
        cost = f"{1000 * errors['without_fault']:.3g} → {1000 * errors['frozen']:.3g}"
        cells = [_recovered(changed("control", name, who)) for who in WHO["control"]]
        rows.append([f"`{name}`", cost, _percent(first, "recovered_told"), *cells])
    heads = ["scenario", "error without → with the fault [mrad]", "told the truth"]
    return table([*heads, *(f"`{who}`" for who in WHO["control"])], rows) + said("control")


def _percent(row: Mapping[str, Any], key: str) -> str:
    if row[key] is None:
        return "–"
    within = row.get(f"{key}_interval")
    return f"{row[key]:.0f}" + (f" ± {(within[1] - within[0]) / 2:.2g}" if within else "")


def _recovered(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "–"
    acts = row["tracking"]["limited"]
    lag = "" if row["lag"] is None else f"; {row['lag']:.2g} s"
    return _percent(row, "recovered") + lag + (f"; limits {acts:.0f}" if acts else "")


def order() -> str:
    """Return whether the ranking by lag is that by what is recovered."""
    rows, found = [], []
    for name in find_suite("control").scenarios:
        each = {who: changed("control", name, who) for who in WHO["control"]}
        known = {w: (r["lag"], r["recovered"]) for w, r in each.items()
                 if r and r["lag"] is not None and r["recovered"] is not None}  # fmt: skip
        if len(known) < 3:
            continue
        lags, worths = np.array(list(known.values())).T
        by_lag = sorted(known, key=lambda w: known[w][0])
        by_worth = sorted(known, key=lambda w: -known[w][1])
        agree = spearmanr(lags, -worths).statistic
        rows.append([f"`{name}`", ", ".join(by_lag), ", ".join(by_worth), f"{agree:+.2f}"])
        found.append(agree)
    rows.append(["mean", "", "", f"{np.mean(found):+.2f}"])
    heads = ["scenario", "the least lag first", "the most recovered first", "rank correlation"]
    return table(heads, rows) + said("control")


def said(suite: str) -> str:
    """Return what a table is of."""
    seeds = next(iter(results(suite).values()))["seeds"]
    return f"\n`flexaxis run {suite}`, seeds 1000 to {999 + seeds}, `python docs/drives.py`.\n"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


TABLES: Mapping[str, Callable[[], str]] = {f.__name__: f for f in (axes, found, why, worth, order)}


def main(wanted: Sequence[str]) -> None:
    """Write the tables that are wanted, all and the figure if none is named."""
    if not wanted or "figure" in wanted:
        figure().savefig(PICTURE, dpi=110)

    def written(match: re.Match[str]) -> str:
        name = match[1]
        body = TABLES[name]() if not wanted or name in wanted else match[2]
        return f"<!-- table: {name} -->\n{body}<!-- end -->"

    for page in PAGES:
        page.write_text(MARK.sub(written, page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
