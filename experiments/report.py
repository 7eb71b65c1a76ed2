"""The HTML report of a run: one file, figures inside, readable without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from flexaxis.experiments import figures
from flexaxis.experiments.results import Results
from flexaxis.sim.scenario import Scenario, scenario_from

TEMPLATE = "report.html"


def render(results: Results) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Results
        As from `flexaxis.experiments.results.load`.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined)
    environment.filters |= {"number": number, "pair": pair, "settled": settled}
    folder = files("flexaxis.experiments") / "templates"
    template = environment.from_string((folder / TEMPLATE).read_text(encoding="utf-8"))
    summary = results.summary
    return template.render(
        summary=summary,
        sections=[_section(name, results) for name in summary["scenarios"]],
        tradeoff=figures.svg(figures.speed_variance(summary["rows"]))
        if any(row["changed"] for row in summary["rows"])
        else None,
        findings=findings(summary["rows"]),
        colour=figures.colour,
    )


def _section(name: str, results: Results) -> dict[str, Any]:
    scenario = scenario_from(results.summary["scenarios"][name]["definition"], source=name)
    curves = [curve for curve in results.curves if curve.scenario == name]
    return {
        "name": name,
        "card": scenario.card,
        "faults": faults_in_words(scenario),
        "hash": results.summary["scenarios"][name]["hash"],
        "toml": scenario.to_toml(),
        "figure": figures.svg(figures.trajectories(curves, scenario)),
        "rows": [row for row in results.summary["rows"] if row["scenario"] == name],
    }


def faults_in_words(scenario: Scenario) -> str:
    """Return what happens to the true parameters, in a line."""
    return "; ".join(
        f"{e.parameter} {100 * (e.after / e.before - 1):+.3g} % at {e.index * scenario.period:g} s"
        if e.before
        else f"{e.parameter} becomes {e.after:g} at {e.index * scenario.period:g} s"
        for e in scenario.events()
    )


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


def settled(value: float | None, changed: bool) -> str:
    """Return a settling time for a table; never is said in words."""
    return number(value) if value is not None or not changed else "never"
