"""The HTML report of a run: one file, figures inside, readable without a network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from flexaxis.experiments import figures, tradeoff
from flexaxis.experiments.card import happens, in_a_line
from flexaxis.experiments.results import Results
from flexaxis.experiments.scoring import ranking
from flexaxis.experiments.scoring.pooling import Curve
from flexaxis.sim.scenario import Scenario, scenario_from

TEMPLATE = "report.html"
SHARP = 12  # scenarios up to which trajectories are drawn as lines and not as dots, for size
DRAWN = 6  # estimators in a figure of trajectories: more cannot be told apart


def render(results: Results) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Results
        As from `flexaxis.experiments.results.load`.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters |= {"number": number, "pair": pair, "settled": settled, "shade": shade}
    folder = files("flexaxis.experiments") / "templates"
    template = environment.from_string((folder / TEMPLATE).read_text(encoding="utf-8"))
    summary = results.summary
    scenarios = {
        name: scenario_from(entry["definition"], source=name)
        for name, entry in summary["scenarios"].items()
    }
    return template.render(
        summary=summary,
        sections=[_section(name, scenarios[name], results) for name in scenarios],
        figure=_tradeoff_figure(summary),
        swept=summary.get("tradeoff"),
        answers=_answers(summary, scenarios),
        findings=findings(summary["rows"]),
        standings=ranking.standings(summary["rows"]),
        scores=ranking.matrix(summary["rows"], _scored(summary["rows"])),
        mismatch=_mismatch(summary["rows"], scenarios),
        controls=ranking.CONTROLS,
        colour=figures.colour,
    )


def _tradeoff_figure(summary: Mapping[str, Any]) -> str | None:
    """Return the curves over the knobs where they were swept, else a point an estimator."""
    if summary.get("tradeoff"):
        return figures.svg(tradeoff.figure(summary["tradeoff"]["points"]))
    if any(row["changed"] for row in summary["rows"]):
        return figures.svg(figures.speed_variance(summary["rows"]))
    return None


def _answers(summary: Mapping[str, Any], scenarios: Mapping[str, Scenario]) -> list[str]:
    swept = summary.get("tradeoff")
    if not swept:
        return []
    words = {name: happens(scenario) for name, scenario in scenarios.items()}
    return ranking.answers(swept["matched"], swept["faults"] | words)


def _scored(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    return list(dict.fromkeys(row["scenario"] for row in rows if row.get("score") is not None))


def _mismatch(
    rows: Sequence[Mapping[str, Any]], scenarios: Mapping[str, Scenario]
) -> dict[str, Any] | None:
    names = ranking.mismatched(scenarios)
    if not names:
        return None
    return {"matrix": ranking.matrix(rows, names), "words": ranking.mismatch_in_words(rows, names)}


def _section(name: str, scenario: Scenario, results: Results) -> dict[str, Any]:
    curves = [curve for curve in results.curves if curve.scenario == name]
    drawn = figures.svg if len(results.summary["scenarios"]) <= SHARP else figures.img
    return {
        "name": name,
        "card": scenario.card,
        "faults": in_a_line(scenario),
        "hash": results.summary["scenarios"][name]["hash"],
        "toml": scenario.to_toml(),
        "figure": drawn(figures.trajectories(_drawn(curves, results), scenario)),
        "rows": [row for row in results.summary["rows"] if row["scenario"] == name],
    }


def _drawn(curves: Sequence[Curve], results: Results) -> list[Curve]:
    """Return the trajectories to draw: where there are many, the reference and the fastest."""
    if len(curves) <= DRAWN:
        return list(curves)
    lags = {
        row["estimator"]: row["lag"]
        for row in results.summary["rows"]
        if row["scenario"] == curves[0].scenario and row["lag"] is not None
    }
    order = sorted(
        curves,
        key=lambda c: (c.estimator != tradeoff.REFERENCE, lags.get(c.estimator, math.inf)),
    )
    return order[:DRAWN]


def findings(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return in words, for each scenario with a fault, who was fastest and at what price."""
    found = []
    changed = [r for r in rows if r["changed"] and r["lag"] is not None and r["std"]]
    for scenario in dict.fromkeys(row["scenario"] for row in changed):
        order = sorted((r for r in changed if r["scenario"] == scenario), key=lambda r: r["lag"])
        fast, slow = order[0], order[-1]
        text = (
            f"{scenario}: {fast['estimator']} follows {fast['parameter']} with the shortest lag, "
            f"{fast['lag']:.3g} s, at a standard deviation of {fast['std']:.3g} % before the fault"
        )
        if slow is not fast:
            text += f"; {slow['estimator']} takes {slow['lag']:.3g} s at {slow['std']:.3g} %"
            cheaper = slow["std"] < fast["std"]
            text += (
                ". Speed is bought with variance here: compare at equal variance before "
                "calling one the better"
                if cheaper
                else ". It is faster and quieter, so better for this fault at these settings"
            )
        lost = [r for r in order if r["diverged"] or r["never_settled"]]
        for row in lost:
            text += (
                f". Of {row['seeds']} runs of {row['estimator']}, {row['diverged']} diverged and "
                f"{row['never_settled']} did not settle within the window"
            )
        found.append(text + ".")
    return found


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; what is not defined is a dash."""
    return "–" if value is None else f"{value:.{digits}g}"


def pair(interval: Sequence[float] | None) -> str:
    """Return an interval for a table."""
    return "" if interval is None else f"{interval[0]:.3g} … {interval[1]:.3g}"


def shade(score: float | None) -> str:
    """Return the background of a score: white for doing nothing, green on the bound, else red."""
    if score is None:
        return "transparent"
    strength = min(abs(score), 100.0) / 100
    return f"rgb({'0 158 115' if score >= 0 else '213 94 0'} / {0.45 * strength:.2f})"


def settled(value: float | None, changed: bool) -> str:
    """Return a settling time for a table; never is said in words."""
    return number(value) if value is not None or not changed else "never"
