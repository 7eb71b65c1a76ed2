"""Write the tables and the figure of docs/friction.md anew: `python docs/friction.py`.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`, and what made it is said below it.
With names of tables, or `figure`, only these are made: `motions` and `figure` take a minute,
`estimators` takes a quarter of an hour.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from making import VERSION, table, write
from matplotlib.figure import Figure
from numpy.typing import NDArray
from suite_rows import summary

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.bounds import noise_variance
from flexaxis.experiments.scoring.true_model import (
    jump_gradient,
    model_theta,
    true_model,
    with_structure,
)
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

Array = NDArray[np.float64]

ROOT = Path(__file__).parents[1]
PAGE, PICTURE = ROOT / "docs" / "friction.md", ROOT / "docs" / "images" / "friction.png"
RUNS = range(1000, 1003)
SECONDS = 10.0
TRACKED = ("k_T", "1/J_a", "f_m", "f_c")

DEFAULT, MOVES = "multisine, .0511 rad (the default)", "moves of .4 s, rests of .2 s"
SLOW = {"excitation.high": 3.0}
MOTIONS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "multisine, .01 rad": ("coulomb-v1", {"excitation.rms": 0.01}),
    DEFAULT: ("coulomb-v1", {}),
    "multisine, .2 rad": ("coulomb-v1", {"excitation.rms": 0.2}),
    "the same below 3 Hz, .1 rad": ("coulomb-v1", SLOW | {"excitation.rms": 0.1}),
    "the same below 3 Hz, .5 rad": ("coulomb-v1", SLOW | {"excitation.rms": 0.5}),
    MOVES: ("coulomb_moves_fm_step-v1", {}),
    "moves of .8 s, rests of .2 s": ("coulomb_moves_fm_step-v1", {"excitation.move": 0.8}),
    "`wg`, multisine, .05 rad": ("wg_fm_step-v1", {}),
    "`wg`, multisine, .2 rad": ("wg_fm_step-v1", {"excitation.rms": 0.2}),
}
"""Motions by name: a scenario of the catalogue, and what of it is changed."""

FRICTION = ("fm_step", "coulomb_fm_step", "lugre_fm_step", "lugre_stribeck_fm_step",
            "real_coulomb_fm_step", "real_lugre_fm_step", "coulomb_fc_step",
            "encoder_coulomb_fm_step", "wg_fm_step", "wg_fc_step", "coulomb_moves_fm_step",
            "load_friction_fm_step")  # fmt: skip
SCENARIOS = tuple(f"{name}-v1" for name in FRICTION)
ESTIMATORS = ("rpem-forgetting",)


def accuracy() -> str:
    """Return how far models with laws are from an adaptive integrator, by steps in a sample."""
    sys.path.insert(0, str(ROOT / "tests" / "estimators"))
    import test_laws as tested

    u, steps, rows = tested.torque(), (4, 8, 16, 32), []
    for name in ("bristle", "static", "all"):
        model = tested.axis(name)
        exact = tested.adaptive(model, u)
        found = [tested.travelled(model, u, steps=s)[:, 0, -1] for s in steps]
        rows.append([f"`{name}`", *(f"{100 * tested.distance(y, exact):.2g}" for y in found)])
    heads = ["laws", *(f"{s} steps of {5 / s:.3g} ms" for s in steps)]
    return table(heads, rows) + (
        "\nDistance of the motor speed from that of LSODA [% of its rms], on the axes of "
        "`tests/estimators/test_laws.py`. `python docs/friction.py accuracy`, "
        f"{VERSION}.\n"
    )


class Motion:
    """Records of an axis in a motion, and what they tell of its parameters.

    Attributes
    ----------
    names : tuple of str
        All that may be unknown.
    speed : (R, N) array
        True motor speed of each record [rad/s].
    linear : float
        f_m over the true one, as an estimator without a law of friction sees it.
    psi : (R, N, p) array
        Gradient of the predicted output, relative to θ and to the deviation of the noise.
    """

    def __init__(self, name: str) -> None:
        scenario = _scenario(name)
        records = simulate(scenario, RUNS)
        truth = scenario.true_parameters()[0]
        self.names = with_structure(scenario, TRACKED)
        self.truth = dict(zip(scenario.parameter_names, truth.tolist(), strict=True))
        model = true_model(scenario, truth).parametrize(self.names)
        theta = model_theta(scenario, self.names, truth)
        rest = np.zeros(model.states)
        gradients = [
            jump_gradient(model, theta, r.torque, rest, period=scenario.period) for r in records
        ]
        self.speed = np.array([record.true_speed for record in records])
        self.linear = np.mean([_linear(scenario, record) for record in records])
        self.psi = np.array(gradients) * theta / np.sqrt(noise_variance(scenario))

    def covariance(self, unknown: Sequence[str], samples: int | None = None) -> Array:
        """Return the Cramér–Rao bound (p, p), relative to θ, after so many samples.

        It is the mean over the records of the bound of each, at the start of which the axis is
        known to be at rest.
        """
        chosen = self.psi[:, :samples, [self.names.index(name) for name in unknown]]
        return np.mean([_inverse(psi.T @ psi) for psi in chosen], axis=0)

    def deviation(self, name: str, unknown: Sequence[str], samples: int | None = None) -> float:
        """Return the least standard deviation of a parameter [%]."""
        i = list(unknown).index(name)
        return 100 * float(np.sqrt(self.covariance(unknown, samples)[i, i]))


def _scenario(name: str) -> Scenario:
    base, changes = MOTIONS[name]
    return find_scenario(base).override({"fault": [], "duration": SECONDS} | dict(changes))


def _linear(scenario: Scenario, record: Record) -> float:
    estimator = build(parse("rpem-forgetting"), scenario)
    theta = run_estimator(estimator, record.torque, record.speed, None)
    truth = record.true_parameters[0, scenario.parameter_names.index("f_m")]
    return float(theta[len(theta) // 2 :, estimator.names.index("f_m")].mean() / truth)


def _inverse(information: Array) -> Array:
    """Return the inverse, by way of unit diagonals: parameters differ much in what is known."""
    D = np.sqrt(np.diag(information))
    return np.asarray(np.linalg.inv(information / np.outer(D, D)) / np.outer(D, D))


motion = cache(Motion)


def motions() -> str:
    """Return what each motion tells of viscous and dry friction."""
    heads = ["motion", "rms v [rad/s]", "E abs(v) / rms v", "f_m of a linear estimator; by (F6)",
             "f_m, f_c", "correlation", "and k_T, 1/J_a", "and structure", "the same, k_T told",
             ]  # fmt: skip
    rows = []
    for name in MOTIONS:
        seen = motion(name)
        pair, told = TRACKED[2:], tuple(n for n in seen.names if n != "k_T")
        C, v = seen.covariance(pair), seen.speed
        alias = seen.truth["f_c"] * np.mean(abs(v)) / np.mean(v**2) / seen.truth["f_m"]
        rows.append([
            name,
            f"{np.sqrt(np.mean(v**2)):.2g}",
            f"{np.mean(abs(v)) / np.sqrt(np.mean(v**2)):.2f}",
            f"{100 * (seen.linear - 1):+.0f} %; {100 * alias:+.0f} %",
            _both(seen, pair),
            f"{C[0, 1] / np.sqrt(C[0, 0] * C[1, 1]):.2f}",
            *(_both(seen, unknown) for unknown in (TRACKED, seen.names, told)),
        ])  # fmt: skip
    return table(heads, rows) + (
        f"\nLeast standard deviation of f_m; f_c [%] after {SECONDS:g} s, by what is unknown. "
        f"`python docs/friction.py motions`, {VERSION}, "
        f"seeds {RUNS.start} to {RUNS.stop - 1}.\n"
    )


def _both(seen: Motion, unknown: Sequence[str]) -> str:
    return "; ".join(f"{seen.deviation(name, unknown):.2g}" for name in TRACKED[2:])


def estimators() -> str:
    """Return what estimators make of friction: bias, deviation, lag, and what they find."""
    summary = _results()
    rows = {(r["scenario"], r["estimator"], r["parameter"]): r for r in summary["rows"]}
    lines = []
    for name in SCENARIOS:
        mine = [key for key, row in rows.items() if key[0] == name and row["changed"]]
        changed = mine[-1][2] if mine else "f_m"
        label = f"`{name.removesuffix('-v1')}`" + ("" if changed == "f_m" else f" ({changed})")
        lines.append([label, *(_cell(rows.get((name, e, changed))) for e in ESTIMATORS)])
    return table(["scenario", *(f"`{e}`" for e in ESTIMATORS)], lines) + (
        "\nBias ± std before the fault [%]; lag [s], × bound; found, named rightly at last [%]; "
        "false alarms a run; **lost** runs. `python docs/friction.py estimators`, "
        f"{VERSION}, seeds 1000 to 1009.\n"
    )


def _cell(row: Mapping[str, Any] | None) -> str:
    if row is None or row["bias"] is None:
        return "–"
    parts = [f"{number(row['bias'], 2)} ± {number(row['std'], 2)}"]
    if row["lag"] is not None:
        over = f", {number(row['lag'] / row['lag_bound'], 2)}" if row["lag_bound"] else ""
        parts.append(f"{number(row['lag'], 2)}{over}")
    if found := row["detection"]:
        named = 0.0 if found["isolated"] is None else 100 * found["isolated"]
        parts.append(f"{100 * (1 - found['missed']):.0f}, {named:.0f}; {found['false_alarms']:.1f}")
    if row["diverged"]:
        parts.append(f"**lost {row['diverged']}**")
    return "; ".join(parts)


def _results() -> Any:
    words = [word for name in ESTIMATORS for word in ("--estimator", name)]
    return summary(*SCENARIOS, *words, "--seeds", "10")


def figure() -> Figure:
    """Return what is known of friction, over the speed of the motion and over time."""
    picture = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = picture.subplots(1, 2)
    _over_speed(left)
    _over_time(right)
    return picture


def _over_speed(axes: Any) -> None:
    names = [name for name in MOTIONS if name.startswith("multisine")]
    speed = [np.sqrt(np.mean(motion(name).speed ** 2)) for name in names]
    pair, alone = TRACKED[2:], [n for n in TRACKED if n != "f_c"]
    for label, parameter, unknown, style in (
        ("f_m, where f_c is known", "f_m", alone, "C0--"),
        ("f_m", "f_m", TRACKED, "C0-o"),
        ("f_c", "f_c", TRACKED, "C1-s"),
    ):
        axes.loglog(
            speed, [motion(n).deviation(parameter, unknown) for n in names], style, label=label
        )
    axes.set_title(f"multisine, {SECONDS:g} s, {' and '.join(pair)} with k_T, 1/J_a", fontsize=9)
    axes.set_xlabel("rms motor speed [rad/s]")
    axes.set_ylabel("least standard deviation [%]")
    axes.legend()


def _over_time(axes: Any) -> None:
    samples = np.unique(np.geomspace(200, SECONDS / 0.005, 12).astype(int))
    for k, name in enumerate(
        ("multisine, .0511 rad (the default)", "moves of .4 s, rests of .2 s")
    ):
        seen, label = motion(name), name.split(",")[0]
        told = [n for n in seen.names if n != "k_T"]
        for unknown, style, what in ((seen.names, "-", ""), (told, "--", ", k_T told")):
            known = [seen.deviation("f_m", unknown, int(n)) for n in samples]
            axes.loglog(0.005 * samples, known, f"C{k + 2}{style}", label=f"{label}{what}")
    axes.set_title("f_m, with f_c and the whole structure unknown", fontsize=9)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("least standard deviation [%]")
    axes.legend()


TABLES: Mapping[str, Callable[[], str]] = {
    "accuracy": accuracy,
    "motions": motions,
    "estimators": estimators,
}


def main(names: Sequence[str]) -> None:
    """Make the tables and the figure of these names, all if there are none."""
    if not names or "figure" in names:
        figure().savefig(PICTURE, dpi=110)
    if names != ["figure"]:
        write(PAGE, TABLES, [name for name in names if name != "figure"])


if __name__ == "__main__":
    main(sys.argv[1:])
