"""The HTML report of a run: one file that is readable, and can be played with, offline."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.catalogue.card import happens, in_a_line
from flexaxis.experiments.reporting import (
    failures,
    page,
    run_charts,
    run_ecdf,
    run_first,
    run_seeds,
    run_speed,
    run_tables,
)
from flexaxis.experiments.reporting.charts import Chart, Picks
from flexaxis.experiments.reporting.run_budget import Budget, Thinning
from flexaxis.experiments.results.pooled import Pooled
from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.names import SUMMARY
from flexaxis.experiments.scoring import mismatch, ranking
from flexaxis.experiments.scoring.curves import Curve
from flexaxis.experiments.scoring.described import known_structure
from flexaxis.experiments.scoring.tracks import track_of
from flexaxis.sim.scenario import Scenario, stored_scenario

TEMPLATE = "reporting/templates/run.html"
AT_FIRST = 9  # estimators that are shown unless others are asked for: more cannot be told apart


@dataclass(frozen=True)
class Run:
    """What the report of a run is made of.

    Attributes
    ----------
    pooled : Pooled
    scenarios : mapping of str to Scenario
        Those that were run.
    order : sequence of str
        Estimators in the order of the one ranking.
    singles : Singles
        All runs.
    few : str
        Which estimators charts show at first, where these are not all.
    """

    pooled: Pooled
    scenarios: Mapping[str, Scenario]
    order: Sequence[str]
    singles: run_seeds.Singles
    few: str = ""

    @classmethod
    def of(cls, results: Pooled) -> Run:
        """Return what there is of a run, its single runs from its folder."""
        summary = results.summary
        scenarios = {
            name: stored_scenario(entry["definition"], source=name)
            for name, entry in summary["scenarios"].items()
        }
        order, aside = run_first.drawn_first(summary, AT_FIRST)
        singles = run_seeds.Singles.of(Results.load(results.folder), order)
        for name, _ in singles.runs:
            if name not in scenarios:
                raise StudyError(
                    f"{results.folder}: its rows are of a scenario {name!r}, of which {SUMMARY} "
                    "says nothing: one of the two was changed"
                )
        return cls(results, scenarios, order, singles, aside)

    @property
    def summary(self) -> dict[str, Any]:
        """What stands in summary.json."""
        return self.pooled.summary


def render(results: Pooled, *, size: float | None = None) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Pooled
        As from `flexaxis.experiments.results.pooled.load`.
    size : float, optional
        How large it may be [MB]: single runs are left out of one that would be larger. 3 MB by
        default, 12 MB with more than twelve scenarios.
    """
    run = Run.of(results)
    budget = Budget.of(size, scenarios=len(run.scenarios))
    content = _content(run)
    drawn: dict[Thinning, dict[str, Chart]] = {}

    def made(chosen: Sequence[run_seeds.Single], said: str, thinning: Thinning) -> str:
        if thinning not in drawn:
            drawn[thinning] = _trajectories(run, thinning)
        return page.render(
            TEMPLATE, content | _singles(run, drawn[thinning], chosen) | {"left": said}
        )

    return budget.fitted(list(run.singles.wanted()), made, str(results.folder))


def _content(run: Run) -> dict[str, Any]:
    """Return what the template names, but for the single runs."""
    summary = run.summary
    equal = run_first.at_equal_noise(summary)
    return {
        "summary": summary,
        "order": run.order,
        "aside": run.order[AT_FIRST:],
        "few": run.few,
        "failed": len(summary.get("failures", [])),
        "failures": failures.in_words(summary.get("failures", [])),
        "answers": run_first.answers(summary),
        "by_fault": _by_fault(run),
        "findings": ranking.in_words(summary["as_set"]),
        "equal": equal,
        "figures": page.charted(chart for each in CHARTS for chart in each(run)),
        "sections": [_section(name, run) for name in run.scenarios],
        "further": _further(run),
        "tracks": run_ecdf.tracks(run.scenarios),
        "mismatch": _mismatch(run),
        "controls": ranking.CONTROLS,
        "at_most": ranking.AT_MOST,
        "at_least": ranking.AT_LEAST,
        "glossary": run_tables.glossary(),
        "columns": run_tables.HEADINGS,
        "provenance": _provenance(run),
    }


def _by_fault(run: Run) -> list[str]:
    """Return a sentence a fault, and on those that are in no row at equal noise."""
    swept = run.summary.get("tradeoff")
    if not swept:
        return []
    words = {name: happens(scenario) for name, scenario in run.scenarios.items()}
    found = ranking.answers(swept["matched"], swept["faults"] | words)
    return found + run_first.not_compared(swept, run.summary["estimators"])


def speed_against_noise(run: Run) -> Iterator[Chart]:
    """Yield the curves over the knobs where they were swept, else a point an estimator."""
    swept, rows = run.summary.get("tradeoff"), run.summary["rows"]
    if swept and swept["points"]:
        yield run_speed.tradeoff(swept["points"], run.order)
    elif chart := run_speed.as_set(rows, run.order):
        yield chart


def distributions(run: Run) -> Iterator[Chart]:
    """Yield how often each comes how near to the bound, a chart a track."""
    rows = (row for runs in run.singles.runs.values() for one in runs for row in one.rows)
    yield from run_ecdf.charts(rows, run.scenarios, run.order)


def _section(name: str, run: Run) -> dict[str, Any]:
    scenario, place = run.scenarios[name], {e: i for i, e in enumerate(run.order)}
    rows = [row for row in run.summary["rows"] if row["scenario"] == name]
    rows.sort(key=lambda row: place.get(row["estimator"], len(place)))
    return {
        "name": name,
        "track": track_of(scenario),
        "card": scenario.card,
        "faults": in_a_line(scenario),
        "hash": run.summary["scenarios"][name]["hash"],
        "toml": scenario.to_toml(),
        "tables": run_tables.tables(rows),
    }


def _trajectories(run: Run, thinning: Thinning) -> dict[str, Chart]:
    """Return the chart over time of each scenario that has one."""
    place = {estimator: i for i, estimator in enumerate(run.order)}
    curves: dict[str, list[Curve]] = {name: [] for name in run.scenarios}
    for curve in run.pooled.curves:
        curves[curve.scenario].append(curve)
    return {
        name: run_charts.trajectories(
            sorted(own, key=lambda curve: place.get(curve.estimator, len(place))),
            run.scenarios[name],
            thinning,
            name=f"curves-{name}",
        )
        for name, own in curves.items()
        if own
    }


def _singles(
    run: Run, drawn: Mapping[str, Chart], chosen: Sequence[run_seeds.Single]
) -> dict[str, Any]:
    """Return what can be opened of single runs, and for each scenario what opens them."""
    shown = {one.name for one in chosen}
    medians = {key: runs[len(runs) // 2].name for key, runs in run.singles.runs.items()}
    places = {}
    for name in run.scenarios:
        opening = {e: m for (s, e), m in medians.items() if s == name and m in shown}
        over_time = _drawn(drawn.get(name))
        points = _drawn(run_seeds.scatter(run.singles, name, shown, run.order))
        places[name] = {
            "over_time": page.charted(run_charts.opening(chart, opening) for chart in over_time),
            "points": page.charted(points),
            "rows": [one for one in chosen if one.scenario == name],
        }
    return {
        "singles": places,
        "single_columns": run_tables.SINGLE,
        "picks": Picks(run_seeds.picks(run.singles, chosen, run.scenarios)),
    }


def _drawn(chart: Chart | None) -> list[Chart]:
    return [] if chart is None else [chart]


def _further(run: Run) -> list[dict[str, Any]]:
    """Return the scenarios that were swept at equal noise, and not run otherwise."""
    swept = run.summary.get("tradeoff")
    if not swept:
        return []
    study = Results.load(run.pooled.folder).study
    known = [stored_scenario(s, source="study.json") for s in study["tradeoff"]["scenarios"]]
    place = {estimator: i for i, estimator in enumerate(run.order)}
    points = sorted(swept["points"], key=lambda p: (place[p["estimator"]], p["std"] or 0.0))
    return [
        {
            "name": s.name,
            "track": track_of(s),
            "card": s.card,
            "faults": in_a_line(s),
            "toml": s.to_toml(),
            "points": [p for p in points if p["scenario"] == s.name],
            "command": _sweep_of(s.name, study),
        }
        for s in known
        if s.name not in run.scenarios
    ]


def _sweep_of(name: str, study: Mapping[str, Any]) -> str:
    """Return the line that sweeps the knobs on a scenario again."""
    words = ["flexaxis", "tradeoff", name]
    for estimator in study["tradeoff"]["estimators"]:
        words += ["--estimator", estimator]
    return shlex.join([*words, "--seeds", f"{study['seeds'][0]}:{study['seeds'][-1] + 1}"])


def _provenance(run: Run) -> list[str]:
    """Return with what, and on which machines, the rows were computed, each once."""
    rows = Rows(Results.load(run.pooled.folder), ("cost.versions", "cost.host"))
    made: dict[str, dict[str, None]] = {}
    for row in rows:
        if row["cost.versions"]:
            made.setdefault(row["cost.versions"], {})[row["cost.host"]] = None
    return [f"{what} on {', '.join(filter(None, hosts))}" for what, hosts in made.items()]


def _mismatch(run: Run) -> dict[str, Any] | None:
    names, rows = mismatch.mismatched(run.scenarios), run.summary["rows"]
    if not names:
        return None
    known = [name for name in names if known_structure(run.scenarios[name])]
    parts = {
        "Known structure": known,
        "Unknown structure": [name for name in names if name not in known],
    }
    there = dict.fromkeys(row["estimator"] for row in rows)
    wrong = mismatch.misled(
        [r for r in rows if r["scenario"] in names], {n: run.scenarios[n] for n in names}
    )
    return {
        "parts": [
            (title, part, mismatch.mismatch_in_words(rows, run.summary["as_set"], part, wrong))
            for title, part in parts.items()
            if part
        ],
        "estimators": [name for name in run.order if name in there],
        "cells": mismatch.matrix(rows, names),
        "wrong": wrong,
    }


CHARTS: Sequence[Callable[[Run], Iterable[Chart]]] = (
    speed_against_noise,
    distributions,
)  # fmt: skip
"""The charts of a run as a whole, in the order of the page: a new one is a function that yields it
(`run.pooled.rows` are the rows behind), and its name here."""
