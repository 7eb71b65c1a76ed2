"""The HTML report of a run: one file, figures inside, readable without a network."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from flexaxis.experiments.catalogue.card import happens, in_a_line
from flexaxis.experiments.reporting import failures, figures, page, tradeoff_figure
from flexaxis.experiments.reporting.cells import number, pair, settled
from flexaxis.experiments.running.pooled import Pooled
from flexaxis.experiments.scoring import mismatch, pools, ranking
from flexaxis.experiments.scoring.pooling import Curve
from flexaxis.experiments.scoring.table import SCORES, label
from flexaxis.sim.scenario import Scenario, stored_scenario

SHARP = 12  # scenarios up to which trajectories are drawn as lines and not as dots, for size
DRAWN = 6  # estimators in a figure of trajectories: more cannot be told apart


def render(results: Pooled) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Pooled
        As from `flexaxis.experiments.running.pooled.load`.
    """
    summary = results.summary
    scenarios = {
        name: stored_scenario(entry["definition"], source=name)
        for name, entry in summary["scenarios"].items()
    }
    content = {
        "summary": summary,
        "failed": len(summary.get("failures", [])),
        "failures": failures.in_words(summary.get("failures", [])),
        "sections": [_section(name, scenarios[name], results) for name in scenarios],
        "figure": _tradeoff_figure(summary),
        "swept": summary.get("tradeoff"),
        "answers": _answers(summary, scenarios),
        "findings": ranking.in_words(summary["as_set"]),
        "equal": _at_equal_noise(summary),
        "mismatch": _mismatch(summary, scenarios),
        "controls": ranking.CONTROLS,
        "at_most": ranking.AT_MOST,
        "at_least": ranking.AT_LEAST,
        "colour": figures.colour,
        "heads": column_heads(),
        "cells": cells,
        "glossary": {label(s.name): s.words for s in SCORES.values() if s.heading},
    }
    return page.render("reporting/templates/run.html", content)


def _tradeoff_figure(summary: Mapping[str, Any]) -> str | None:
    """Return the curves over the knobs where they were swept, else a point an estimator."""
    if summary.get("tradeoff"):
        return figures.svg(tradeoff_figure.figure(summary["tradeoff"]["points"]))
    if any(row["changed"] for row in summary["rows"]):
        return figures.svg(figures.speed_variance(summary["rows"]))
    return None


def _answers(summary: Mapping[str, Any], scenarios: Mapping[str, Scenario]) -> list[str]:
    swept = summary.get("tradeoff")
    if not swept:
        return []
    words = {name: happens(scenario) for name, scenario in scenarios.items()}
    return ranking.answers(swept["matched"], swept["faults"] | words)


def _at_equal_noise(summary: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the table that the report leads with: estimator × fault at equal noise."""
    swept = summary.get("tradeoff")
    if not swept:
        return None
    rows = {(r["scenario"], r["parameter"], r["estimator"]): r for r in swept["matched"]}
    names = list(dict.fromkeys([p["estimator"] for p in swept["points"]] + [k[2] for k in rows]))
    overall = {row["estimator"]: row for row in swept["overall"]}
    return {
        "faults": list(dict.fromkeys(key[:2] for key in rows)),
        "estimators": sorted(names, key=lambda n: [*overall, n].index(n)),
        "rows": rows,
        "overall": overall,
        "words": swept["faults"],
        "reference": ranking.REFERENCE,
    }


def _mismatch(
    summary: Mapping[str, Any], scenarios: Mapping[str, Scenario]
) -> dict[str, Any] | None:
    names, rows = mismatch.mismatched(scenarios), summary["rows"]
    if not names:
        return None
    return {
        "scenarios": names,
        "estimators": list(dict.fromkeys(row["estimator"] for row in rows)),
        "cells": mismatch.matrix(rows, names),
        "words": mismatch.mismatch_in_words(rows, summary["as_set"], names),
    }


def _section(name: str, scenario: Scenario, results: Pooled) -> dict[str, Any]:
    curves = [curve for curve in results.curves if curve.scenario == name]
    drawn = figures.svg if len(results.summary["scenarios"]) <= SHARP else figures.img
    return {
        "name": name,
        "card": scenario.card,
        "faults": in_a_line(scenario),
        "hash": results.summary["scenarios"][name]["hash"],
        "toml": scenario.to_toml(),
        "figure": drawn(figures.trajectories(_drawn(curves, results), scenario)) if curves else "",
        "rows": [row for row in results.summary["rows"] if row["scenario"] == name],
    }


def _drawn(curves: Sequence[Curve], results: Pooled) -> list[Curve]:
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
        key=lambda c: (c.estimator != ranking.REFERENCE, lags.get(c.estimator, math.inf)),
    )
    return order[:DRAWN]


def column_heads() -> list[str]:
    """Return the headings of the columns of a scenario's table."""
    heads = [label(score.name) for score in SCORES.values() if score.heading]
    return [*heads, "efficiency", "alarms", "false alarms in 1000 s", "µs/sample"]


def cells(row: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the cells of a pooled row in that order, each with its interval."""
    found = []
    for score in SCORES.values():
        if score.heading:
            value = row.get(score.name)
            if score.kind == "truth":
                text = f"{value} of {row['seeds']}"
            elif score.pool is pools.median:
                text = settled(value, row["changed"])
            else:
                text = number(value)
            found.append((text, pair(row.get(f"{score.name}_interval"))))
    alarms = row.get("detection") or {}
    efficiency, cost = row.get("efficiency", {}).get("200"), row["cost"]["us_per_sample"]
    more = (efficiency, alarms.get("alarms"), alarms.get("false_alarms_per_1000_s"), cost)
    return found + [(number(value, 2), "") for value in more]
