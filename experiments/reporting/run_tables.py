"""The tables of scores in the report of a run: which columns come first, and what a cell says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.reporting.cells import number, pair, settled
from flexaxis.experiments.reporting.glossary import TERMS
from flexaxis.experiments.scoring import pools
from flexaxis.experiments.scoring.table import SCORES, Score, label

Row = Mapping[str, Any]
NOTHING = 1e-9  # per cent, or a plain number: less is rounding


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    name : str
        The word of the glossary for it.
    heading : str
        With the unit.
    of : callable
        ``of(row)``: value for sorting, text, and the interval in words.
    words : str
        What it is, in a sentence.
    more : bool
        Whether it is shown on demand.
    """

    name: str
    heading: str
    of: Callable[[Row], Cell]
    words: str
    more: bool = False


@dataclass(frozen=True)
class Cell:
    """What stands in a cell: a value to sort by (None for none), its text, its interval."""

    value: float | str | None
    text: str
    within: str = ""

    @property
    def sorted_by(self) -> str:
        """The value for sorting and saving, with six digits."""
        return f"{self.value:.6g}" if isinstance(self.value, float) else str(self.value)


FIRST = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged", "false_alarms")
"""What is seen without asking where something changes, in this order."""

HEADINGS = {"diverged": "lost"}

FIRST_WITHOUT_FAULT = ("std", "bias", "excess", "nees", "diverged", "false_alarms")
FIRST_UNCHANGED = ("cross_talk", "std", "bias", "std_after", "diverged")
OF_A_CASE = ("excess", "nees", "nis", "whiteness", "alarms", "false_alarms", "cost")
"""The same in all rows of a case, and shown beside what changed."""

NEEDS_A_FAULT = ("lag", "over_bound", "t10", "score", "never_settled", "efficiency", "delay")


def columns(first: Sequence[str], *, without: Sequence[str] = ()) -> list[Column]:
    """Return all columns, those named first in their order, and the others on demand."""
    known = known_columns()
    more = [name for name in known if name not in first and name not in without]
    return [known[name] for name in first] + [
        Column(c.name, c.heading, c.of, c.words, more=True) for c in (known[n] for n in more)
    ]


@dataclass(frozen=True)
class Table:
    """A table of pooled rows.

    Attributes
    ----------
    name : str
        Of its file, where it is saved.
    columns : sequence of Column
    rows : sequence of mapping
    folded : str
        What it is called where it is folded away; empty for one that is not.
    """

    name: str
    columns: Sequence[Column]
    rows: Sequence[Row]
    folded: str = ""


def tables(rows: Sequence[Row]) -> list[Table]:
    """Return the tables of a scenario: first of what changed, folded away what did not.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows of one scenario.
    """
    changed = [row for row in rows if row["changed"]]
    rest = [row for row in rows if not row["changed"]]
    if not rows:
        return []
    name = rows[0]["scenario"]
    if not changed:
        return [Table(name, columns(FIRST_WITHOUT_FAULT, without=NEEDS_A_FAULT), rest)]
    found = [Table(name, columns(FIRST, without=("cross_talk",)), changed)]
    if rest:
        kept = columns(FIRST_UNCHANGED, without=(*NEEDS_A_FAULT, *OF_A_CASE))
        said = f"Parameters that did not change ({len(rest)} row{'s'[: len(rest) != 1]})"
        found.append(Table(f"{name}-unchanged", kept, rest, said))
    return found


def known_columns() -> dict[str, Column]:
    """Return every column there is, by name."""
    scores = {s.name: Column(s.heading, HEADINGS.get(s.name, label(s.name)), _of(s), s.words)
              for s in SCORES.values() if s.heading}  # fmt: skip
    return (
        scores
        | {c.name.replace(" ", "_"): c for c in _FURTHER}
        | {key: column for key, column in _NAMED.items()}
    )


def _of(score: Score) -> Callable[[Row], Cell]:
    def cell(row: Row) -> Cell:
        value, within = row.get(score.name), pair(row.get(f"{score.name}_interval"))
        if score.kind == "truth":
            return Cell(value, f"{value} of {row['seeds']}")
        if score.unit in {"%", ""} and value is not None and abs(value) < NOTHING:
            value, within = 0.0, ""
        if score.pool is pools.median:
            return Cell(value, settled(value, row["changed"]), within if value else "")
        return Cell(value, number(value), "" if _is_point(row, score.name) else within)

    return cell


def _is_point(row: Row, name: str) -> bool:
    """Whether an interval has no width, as of an estimator that never moves."""
    low, high = row.get(f"{name}_interval") or (0.0, 1.0)
    return low is not None and low == high


def _over_bound(row: Row) -> Cell:
    lag, bound = row.get("lag"), row.get("lag_bound")
    over = lag / bound if lag is not None and bound else None
    return Cell(over, number(over, 2))


def _detected(key: str) -> Callable[[Row], Cell]:
    def cell(row: Row) -> Cell:
        value = (row.get("detection") or {}).get(key)
        return Cell(value, number(value, 2))

    return cell


def _efficiency(row: Row) -> Cell:
    value = (row.get("efficiency") or {}).get("200")
    return Cell(value, number(value, 2))


def _cost(row: Row) -> Cell:
    value = row["cost"]["us_per_sample"]
    return Cell(value, number(value, 2))


_FURTHER: tuple[Column, ...] = (
    Column("alarms", "alarms", _detected("alarms"),
           "Changes that the estimator says it found, a run; false ones are outside the windows of "
           "all faults."),
    Column("delay", "delay [s]", _detected("delay"),
           "From the fault to the first alarm in its window."),
)  # fmt: skip
_NAMED: Mapping[str, Column] = {
    "over_bound": Column(
        "× bound", "× bound", _over_bound, TERMS["× bound"]),
    "false_alarms": Column(
        "false alarms", "false alarms / 1000 s", _detected("false_alarms_per_1000_s"),
        TERMS["false alarms"]),
    "efficiency": Column(
        "error over bound", "error after 200 samples / bound", _efficiency,
        TERMS["error over bound"]),
    "cost": Column(
        "µs/sample", "µs/sample", _cost,
        "Time of the estimator on this machine; compare within one report only."),
}  # fmt: skip


def _settles(row: Row) -> Cell:
    return Cell(row["t10"], settled(row["t10"], row["changed"]))


SINGLE: Sequence[Column] = (
    Column("lag", "lag [s]", lambda row: Cell(row["lag"], number(row["lag"])), ""),
    Column("× bound", "× bound", _over_bound, ""),
    Column("t10", "t10 [s]", _settles, ""),
    Column("std", "std [%]", lambda row: Cell(row["std"], number(row["std"])), ""),
    Column("score", "score", lambda row: Cell(row["score"], number(row["score"])), ""),
    Column(
        "diverged", "lost", lambda row: Cell(row["diverged"], "lost" if row["diverged"] else ""), ""
    ),
)
"""What is said of a single run, by its first row."""


def glossary() -> dict[str, str]:
    """Return what each column means, by its word."""
    return {column.name: column.words for column in known_columns().values()}
