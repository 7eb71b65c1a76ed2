"""The HTML report of a run: one file, figures inside, readable without a network."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from flexaxis.experiments.catalogue.card import happens, in_a_line
from flexaxis.experiments.reporting import failures, figures, page, tradeoff_figure
from flexaxis.experiments.reporting.cells import number, pair, settled
from flexaxis.experiments.reporting.page import Shown
from flexaxis.experiments.results.pooled import Pooled
from flexaxis.experiments.scoring import mismatch, pools, ranking
from flexaxis.experiments.scoring.curves import Curve
from flexaxis.experiments.scoring.described import known_structure
from flexaxis.experiments.scoring.table import SCORES, label
from flexaxis.sim.scenario import Scenario, stored_scenario

SHARP = 12  # scenarios up to which trajectories are drawn as lines and not as dots, for size
DRAWN = 6  # estimators in a figure of trajectories: more cannot be told apart

SPEED = "Speed against variance"
CURVES = (
    "A line is an estimator whose knob is turned from slow and quiet to quick and noisy; dashed: "
    "the lag that the Cramér–Rao bound allows with all parameters unknown after the fault, dotted "
    "with only this one."
)
POINTS = (
    "One point is one setting of an estimator's knob; `flexaxis tradeoff` draws the whole curve of "
    "each knob, with the bounds."
)


def render(results: Pooled) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Pooled
        As from `flexaxis.experiments.results.pooled.load`.
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
        "figures": page.shown(figure for each in FIGURES for figure in each(results)),
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


def speed_against_variance(results: Pooled) -> Iterator[Shown]:
    """Yield the curves over the knobs where they were swept, else a point an estimator."""
    swept, rows = results.summary.get("tradeoff"), results.summary["rows"]
    if swept:
        yield Shown(SPEED, _words_of(CURVES), tradeoff_figure.figure(swept["points"]))
    elif any(row["changed"] for row in rows):
        yield Shown(SPEED, _words_of(POINTS), figures.speed_variance(rows))


def _words_of(what: str) -> str:
    return (
        f"Nearer to the lower left corner is better. {what} Whiskers are 95 % intervals over seeds."
    )


def _answers(summary: Mapping[str, Any], scenarios: Mapping[str, Scenario]) -> list[str]:
    swept = summary.get("tradeoff")
    if not swept:
        return []
    words = {name: happens(scenario) for name, scenario in scenarios.items()}
    found = ranking.answers(swept["matched"], swept["faults"] | words)
    return found + _not_compared(swept, summary["estimators"])


def _not_compared(swept: Mapping[str, Any], estimators: Iterable[str]) -> list[str]:
    """Return a sentence on those that were run, and are in no row at equal noise."""
    unable = set(swept["left_out"])
    there = {row["estimator"] for row in swept["matched"]} | unable | set(ranking.CONTROLS)
    blind = [name for name in estimators if name not in there]
    found = [f"Not compared at equal noise, for none of what changes here is estimated by them: "
             f"{', '.join(blind)}."] if blind else []  # fmt: skip
    if unable:
        names = ", ".join(name for name in swept["left_out"])
        found.append(f"Not compared at equal noise, for some of these runs failed: {names}.")
    return found


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
    known = [name for name in names if known_structure(scenarios[name])]
    parts = {
        "Known structure": known,
        "Unknown structure": [name for name in names if name not in known],
    }
    return {
        "parts": [
            (title, part, mismatch.mismatch_in_words(rows, summary["as_set"], part))
            for title, part in parts.items()
            if part
        ],
        "estimators": list(dict.fromkeys(row["estimator"] for row in rows)),
        "cells": mismatch.matrix(rows, names),
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


FIGURES: Sequence[Callable[[Pooled], Iterator[Shown]]] = (
    speed_against_variance,
)  # fmt: skip
"""The figures of a run as a whole, in the order of the page: a new one is a function that yields it
(`results.rows` are the rows behind), and its name here."""
