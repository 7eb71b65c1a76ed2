"""The page of a comparison: its verdict, the runs on the worst seed, all scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from flexaxis.experiments.gate.comparison_rows import cells, ordered, row_command, worst
from flexaxis.experiments.gate.decide import BETTER, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.verdicts import Verdict
from flexaxis.experiments.gate.words import explanation, headline, knobs, meaning
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.run.over_time import trajectories
from flexaxis.experiments.reporting.tables import Cell, Column, Row, Table
from flexaxis.experiments.scoring.curves import curve_of
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import Scenario

KINDS = {WORSE: "bad", UNDECIDED: "maybe", BETTER: ""}  # of the box with the verdict
COLUMNS = (
    Column("scenario", term="scenario", kind="text"),
    Column("score", kind="text"),
    Column("base"),
    Column("candidate"),
    Column("change [%]"),
    Column("interval [%]", kind="text"),
    Column("verdict", kind="text"),
    Column("to look at it", kind="command", more=True),
)


def comparison_page(
    found: Comparison,
    scenarios: Sequence[Scenario],
    *,
    sources: Mapping[str, str],
    command: str,
    traces: Traces,
) -> str:
    """Return the page as HTML.

    Parameters
    ----------
    found : Comparison
    scenarios : sequence of Scenario
        What was run; without them nothing is drawn.
    sources : mapping of str to str
        Path of each scenario that is not in the catalogue.
    command : str
        The line that does all of it again.
    traces : Traces
        Estimates of the runs.
    """
    focus = worst(found)
    chart = _chart(found, focus, {s.name: s for s in scenarios}, traces)
    rows = [_row(v, row_command(found, v, sources)) for v in ordered(found.verdicts)]
    content = {
        "found": found,
        "headline": headline(found),
        "kind": KINDS.get(found.verdict, "neutral"),
        "meaning": meaning(found),
        "knobs": knobs(found),
        "table": Table("All scores", COLUMNS, rows, explanation(found)),
        "charts": page.charted([] if chart is None else [chart]),
        "again": row_command(found, focus, sources),
        "command": command,
    }
    return page.render("gate/templates/compare.html", content)


def _row(v: Verdict, again: str) -> Row:
    scenario, score, base, candidate, change, interval, verdict = cells(v)
    size = None if v.change is None else 100 * v.change / (v.scale or 1.0)
    return Row(
        [
            Cell(scenario),
            Cell(score),
            Cell(base, v.base),
            Cell(candidate, v.candidate),
            Cell(change, size),
            Cell(interval),
            Cell(verdict, v.verdict),
            Cell(again),
        ],
        kind=v.verdict,
        group=v.scenario,
    )


def _chart(
    found: Comparison, focus: Verdict, scenarios: Mapping[str, Scenario], traces: Traces
) -> Chart | None:
    """Return both runs on the worst seed over time."""
    scenario = scenarios.get(focus.worst_scenario)
    if scenario is None:
        return None
    curves = []
    for side, text in (("base", found.base), ("candidate", found.candidate)):
        one = traces.find(scenario.hash, text).get(focus.worst_seed or 0)
        if one is None:
            return None
        each = [one.curve], [one.detail.near]
        curves.append(curve_of(scenario, f"{side}: {text}", one.names, *each))
    said = cells(focus)
    where = f"Both runs on {scenario.name}, seed {focus.worst_seed}; truth dashed."
    return replace(
        trajectories(curves, scenario, name="worst"),
        title="Where the candidate compares worst",
        words=f"{said[1]}: {said[-1]}. {where}",
    )
