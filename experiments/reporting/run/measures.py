"""What columns of scores show in the report of a run: the cell of each score, and its words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.reporting.tables import TERMS, Cell, pair, scored, settled
from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.score_definition import Score
from flexaxis.experiments.scoring.score_table import SCORES, label

Pooled = Mapping[str, Any]
NOTHING = 1e-9  # per cent, or a plain number: less is rounding
HEADINGS = {"diverged": "lost"}


@dataclass(frozen=True)
class Measure:
    """What a column of scores shows.

    Attributes
    ----------
    name : str
        The word of the glossary for it.
    heading : str
        With the unit.
    of : callable
        ``of(row)``: the cell of a pooled row.
    words : str
        What it is, in a sentence.
    """

    name: str
    heading: str
    of: Callable[[Pooled], Cell]
    words: str


def measures() -> dict[str, Measure]:
    """Return everything that a column can show, by name."""
    found = {s.name: Measure(s.heading, HEADINGS.get(s.name, label(s.name)), _of(s), s.words)
             for s in SCORES.values() if s.heading}  # fmt: skip
    return {**found, **_FURTHER}


def _of(score: Score) -> Callable[[Pooled], Cell]:
    def cell(row: Pooled) -> Cell:
        value, ends = row.get(score.name), row.get(f"{score.name}_interval")
        if score.kind == "truth":
            return Cell(f"{value} of {row['seeds']}", value)
        if score.unit in {"%", ""} and value is not None and abs(value) < NOTHING:
            value, ends = 0.0, None
        if ends is not None and ends[0] is not None and ends[0] == ends[1]:
            ends = None  # of an estimator that never moves
        if score.pool is pooling.median:
            text = settled(value, row["changed"])
            return Cell(text, "" if value is None else value, pair(ends) if value else "")
        return scored(value, within=pair(ends))

    return cell


def over_bound(row: Pooled) -> Cell:
    """Return the lag over that of the bound."""
    lag, bound = row.get("lag"), row.get("lag_bound")
    return scored(lag / bound if lag is not None and bound else None, digits=2)


def t10(row: Pooled) -> Cell:
    """Return the settling time."""
    return Cell(settled(row["t10"], row["changed"]), "" if row["t10"] is None else row["t10"])


def _within(table: str, name: str) -> Callable[[Pooled], Cell]:
    """Return what shows a score that is part of a table of scores."""
    return lambda row: scored((row.get(table) or {}).get(name), digits=2)


def _false_alarms(row: Pooled) -> Cell:
    """Return the rate of false alarms, with what the time in which they were counted allows."""
    found = row.get("detection") or {}
    ends, rate = found.get("false_alarms_interval"), found.get("false_alarms_per_1000_s")
    within = f"{pair(ends)} in {found['calm'] / 3600:.2g} h" if ends else ""
    return scored(rate, within=within, digits=2)


_FURTHER: Mapping[str, Measure] = {
    "alarms": Measure(
        "alarms", "alarms", _within("detection", "alarms"),
        "Changes that the estimator says it found, a run; false ones are outside the windows of "
        "all faults."),
    "delay": Measure(
        "delay", "delay [s]", _within("detection", "delay"),
        "From the fault to the first alarm in its window."),
    "over_bound": Measure("× bound", "× bound", over_bound, TERMS["× bound"]),
    "false_alarms": Measure(
        "false alarms", "false alarms / 1000 s", _false_alarms,
        TERMS["false alarms"]),
    "efficiency": Measure(
        "error over bound", "error after 200 samples / bound", _within("efficiency", "200"),
        TERMS["error over bound"]),
    "cost": Measure(
        "µs/sample", "µs/sample", _within("cost", "us_per_sample"),
        "Time of the estimator on this machine; compare within one report only."),
}  # fmt: skip


def glossary() -> dict[str, str]:
    """Return what each column means, by its word."""
    return {measure.name: measure.words for measure in measures().values()}
