"""
Speed against variance over an estimator's own knob, with the bound drawn in.

One setting of a knob ranks nothing: whoever forgets faster is faster and noisier. So each estimator
is swept over its knob, and compared where its standard deviation is that of a reference.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments import figures, harness
from flexaxis.experiments.cache import RecordCache
from flexaxis.experiments.scoring.pooling import pool
from flexaxis.experiments.specs import parse
from flexaxis.sim.scenario import Scenario

REFERENCE = "rpem-forgetting"
FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the default setting, in what the knob gives of speed


def with_knob(name: str, factor: float) -> str:
    """Return an estimator with its knob turned: "rpem-forgetting[forgetting=0.99]".

    A forgetting factor λ is turned in 1−λ, any other knob as it is. An estimator of your own says
    which option is its knob in the attribute `knob` of its class; one without, or with options
    already, stays as it is.

    Examples
    --------
    >>> with_knob("rpem-forgetting", 2.0)
    'rpem-forgetting[forgetting=0.99]'
    """
    knob, value = _knob(name)
    if knob is None:
        return name
    return with_value(name, 1 - (1 - value) * factor if knob == "forgetting" else value * factor)


def with_value(name: str, value: float) -> str:
    """Return an estimator with its knob at a value."""
    knob, _ = _knob(name)
    return f"{name}[{knob}={value:.12g}]"


def _knob(name: str) -> tuple[str | None, float]:
    """Return the name of the option that is the knob, and its default."""
    spec = parse(name)
    if spec.options:
        return None, 0.0
    if name in REGISTRY:
        entry = REGISTRY[name]
        return entry.knob, float(entry.options[entry.knob]) if entry.knob else 0.0
    knob = getattr(spec.make, "knob", None)
    if knob is None:
        return None, 0.0
    option = inspect.signature(spec.make).parameters.get(knob)
    if option is None or not isinstance(option.default, int | float):
        raise EstimatorError(f"{name}: its `knob` {knob!r} is no option with a number as default")
    return knob, float(option.default)


def settings(estimators: Sequence[str], *, factors: Sequence[float] = FACTORS) -> dict[str, str]:
    """Return the settings that a sweep runs, each with its estimator; the reference is one."""
    texts = {with_knob(name, factor): name for name in estimators for factor in factors}
    return texts | {with_knob(REFERENCE, 1.0): REFERENCE}


def sweep(
    scenarios: Sequence[Scenario],
    estimators: Sequence[str],
    seeds: Sequence[int],
    *,
    factors: Sequence[float] = FACTORS,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[harness.Done], None] | None = None,
) -> list[dict[str, Any]]:
    """
    Run every estimator at every setting of its knob.

    Returns
    -------
    list of dict
        One for each scenario, estimator and setting that has a fault in an estimated parameter:
        ``scenario, estimator, setting, parameter``, pooled ``lag, lag_interval, t10, std,
        std_interval, diverged, seeds``, ``ratio`` (geometric mean over the
        parameters of std over that of the reference at its default), ``own_ratio`` (that of the
        faulted parameter) and ``bound`` (lag).
    """
    texts = settings(estimators, factors=factors)
    cases: list[harness.Case] = []
    for done in harness.run(scenarios, list(texts), seeds, jobs=jobs, store=store):
        cases += done.cases
        if advance:
            advance(done)
    rows, _ = pool(cases, scenarios)
    limits = _limits(cases)
    points = []
    for scenario in scenarios:
        mine = [row for row in rows if row["scenario"] == scenario.name]
        reference = _stds(mine, with_knob(REFERENCE, 1.0))
        for row in mine:
            if row["changed"] and texts[row["estimator"]] in estimators:
                ratios = _ratios(_stds(mine, row["estimator"]), reference)
                points.append(
                    {key: row[key] for key in _KEPT}
                    | {
                        "estimator": texts[row["estimator"]],
                        "setting": row["estimator"],
                        "ratio": float(np.exp(np.mean(np.log(list(ratios.values())))))
                        if ratios
                        else None,
                        "own_ratio": ratios.get(row["parameter"]),
                        "bound": limits.get((scenario.name, row["parameter"])),
                    }
                )
    return points


_KEPT = (
    "scenario",
    "parameter",
    "lag",
    "lag_interval",
    "t10",
    "std",
    "std_interval",
    "diverged",
    "seeds",
)


def _stds(rows: Sequence[Mapping[str, Any]], setting: str) -> dict[str, float]:
    return {r["parameter"]: r["std"] for r in rows if r["estimator"] == setting and r["std"]}


def _ratios(own: Mapping[str, float], reference: Mapping[str, float]) -> dict[str, float]:
    return {name: own[name] / reference[name] for name in own if name in reference}


def _limits(cases: Sequence[harness.Case]) -> dict[tuple[str, str], float]:
    """Return the mean lag on the bound by scenario and parameter."""
    found: dict[tuple[str, str], list[float]] = {}
    for case in cases:
        for row in case.rows:
            if row["lag_bound"] is not None:
                found.setdefault((case.scenario, row["parameter"]), []).append(row["lag_bound"])
    return {key: float(np.mean(values)) for key, values in found.items()}


def matched(points: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """
    Return the lag of each estimator where its standard deviation is that of the reference.

    Between the two settings on either side, straight in the logarithms; None where the sweep does
    not reach that deviation.
    """
    groups = dict.fromkeys((p["scenario"], p["parameter"], p["estimator"]) for p in points)
    return [_match(points, *group) for group in groups]


def _match(
    points: Sequence[Mapping[str, Any]], scenario: str, parameter: str, estimator: str
) -> dict[str, Any]:
    mine = [
        p
        for p in points
        if (p["scenario"], p["parameter"], p["estimator"]) == (scenario, parameter, estimator)
        and p["ratio"] and p["lag"]
    ]  # fmt: skip
    mine.sort(key=lambda p: p["ratio"])
    ratios = np.log([p["ratio"] for p in mine])

    def at_one(key: str, end: int | None = None) -> float | None:
        values = [p[key] if end is None or not p[key] else p[key][end] for p in mine]
        if not mine or not ratios[0] <= 1e-9 or not ratios[-1] >= -1e-9 or not all(values):
            return None
        return float(np.exp(np.interp(0.0, ratios, np.log(values))))

    bound = next((p["bound"] for p in mine if p["bound"]), None)
    lag = at_one("lag")
    within = at_one("lag_interval", 0), at_one("lag_interval", 1)
    return {
        "scenario": scenario,
        "parameter": parameter,
        "estimator": estimator,
        "lag": lag,
        "lag_interval": None if None in within else list(within),
        "own_ratio": at_one("own_ratio"),
        "bound": bound,
        "over_bound": lag / bound if lag and bound else None,
    }


def figure(points: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw lag over std for each scenario, a line an estimator, the bound as a dashed line."""
    scenarios = list(dict.fromkeys((p["scenario"], p["parameter"]) for p in points))
    many = len({p["estimator"] for p in points}) > 8  # they need more room to be told apart
    columns = min(2 if many else 3, max(1, len(scenarios)))
    rows = -(-len(scenarios) // columns)
    wide, high = (5.4, 4.4) if many else (3.6, 3.2)
    fig = Figure(figsize=(0.6 + wide * columns, 0.8 + high * rows), layout="constrained")
    axes = fig.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(scenarios) :]:
        ax.set_axis_off()
    for ax, (scenario, parameter) in zip(axes, scenarios, strict=False):
        mine = [p for p in points if (p["scenario"], p["parameter"]) == (scenario, parameter)]
        _panel(ax, mine)
        ax.set_title(f"{scenario}: {figures.symbol(parameter)}", fontsize=10)
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    return fig


def _panel(ax: Any, points: Sequence[Mapping[str, Any]]) -> None:
    for estimator in dict.fromkeys(p["estimator"] for p in points):
        line = sorted(
            (p for p in points if p["estimator"] == estimator and p["std"] and p["lag"]),
            key=lambda p: p["std"],
        )
        x, y = [p["std"] for p in line], [p["lag"] for p in line]
        low = [p["lag"] - (p["lag_interval"] or [p["lag"]] * 2)[0] for p in line]
        high = [(p["lag_interval"] or [p["lag"]] * 2)[1] - p["lag"] for p in line]
        ax.errorbar(
            x, y, yerr=np.maximum(0, [low, high]) if line else None,
            marker=figures.marker(estimator), ms=5, lw=1.2, capsize=2,
            color=figures.colour(estimator), label=estimator,
        )  # fmt: skip
    bound = next((p["bound"] for p in points if p["bound"]), None)
    if bound:
        ax.axhline(bound, color="k", ls="--", lw=1, label="oracle Cramér–Rao bound")
    ax.set(xscale="log", yscale="log", xlabel="std before the fault [% of nominal]")
    ax.set_ylabel("lag after the fault [s]")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    ax.grid(alpha=0.25)
