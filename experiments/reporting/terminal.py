"""Tables in the terminal: lags at equal noise, then scores at default settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.mismatch import misled
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, CONTROLS, REFERENCE, too_few
from flexaxis.experiments.reporting import tables, words
from flexaxis.experiments.reporting.tables import COLUMNS, Cell, pair, short
from flexaxis.sim.scenario import stored_scenario

Row = Mapping[str, Any]
WIDE = 200  # columns where there is no terminal, as in the log of a build: no name is cut
DEFAULT = ("lag", "t10", "std", "bias", "diverged", "never_settled", "score", "cross_talk", "cost")
EQUAL = ("lag [s]", "95 % interval", "/ bound", "std after [%]", "false alarms / 1000 s")
LEGEND = f"""\
★        fastest, or not distinguishable from it on these seeds
lag      mean |error| after the fault / size of the fault × 5 s: 5 s = never reacts
/ bound  lag relative to the Cramér–Rao bound of an estimator that knows when, not what, changed
≤, ≥     no setting is as noisy, or as quiet, as {REFERENCE}: the lag is at most, at least, this"""
DEFAULT_LEGEND = """\
*        the estimate was wrong by over half the size of the fault before it: not comparable
std, bias, cross-talk in % of nominal; score: 0 = never reacts, 100 = Cramér–Rao bound"""


def show(table: Table) -> None:
    """Print a table, in a file or a pipe as wide as it needs."""
    console = Console()
    Console(width=console.width if console.is_terminal else WIDE).print(table)


def show_table(table: tables.Table, *, caption: str) -> None:
    """Print a table of texts, as wide as the terminal; a row that begins with ✗ is red."""
    shown = Table(box=None, padding=(0, 1, 0, 0), caption=caption)
    for place, head in enumerate(table.heads):
        shown.add_column(escape(head), ratio=int(place > 0) or None, no_wrap=place == 0)
    for _, cells in table.rows:
        texts = [cell.text for cell in cells]
        shown.add_row(*map(escape, texts), style="bold red" if texts[0] == "✗" else None)
    Console().print(shown)


def show_run(summary: Row) -> None:
    """Print what the report of a run says first: lags at equal noise, then default settings.

    Parameters
    ----------
    summary : mapping
        As in summary.json.
    """
    swept = summary.get("tradeoff") or {}
    if swept.get("matched"):
        show(equal_noise_table(swept, len(summary["seeds"])))
    scenarios = {
        name: stored_scenario(entry["definition"], source=name)
        for name, entry in summary["scenarios"].items()
    }
    show(default_table(summary["rows"], misled(summary["rows"], scenarios)))


def equal_noise_table(swept: Row, seeds: int) -> Table:
    """Return the lags at equal noise, a line a fault and estimator, and the overall scores.

    Parameters
    ----------
    swept : mapping
        With ``matched``, ``overall`` and ``definitions``, as in a summary.
    seeds : int
    """
    few, names = too_few(swept["matched"]), words.fault_names(swept["matched"])
    known = swept.get("definitions", {})
    count = len(dict.fromkeys(names))
    table = _table(
        f"Lag at equal noise: who follows a fault fastest?  ({count} faults × {seeds} seeds)",
        "\n".join([few, LEGEND] if few else [LEGEND]),
        ("estimator", *EQUAL),
    )
    for fault in dict.fromkeys(names):
        rows = [r for name, r in zip(names, swept["matched"], strict=True) if name == fault]
        code = rows[0]["scenario"]
        happens = words.happens(known[code]) if code in known else rows[0]["parameter"]
        table.add_row(f"[bold]{escape(happens)}[/]  ({escape(fault)})")
        for row in sorted(rows, key=_by_lag):
            table.add_row(
                _name(row["estimator"], best=row["leads"] and not few),
                AT_MOST.get(row["how"], "") + short(row["lag"]),
                pair(row["lag_interval"]),
                *map(short, (row["over_bound"], row["std_after"], row["false_alarms_per_1000_s"])),
            )
    if swept["overall"]:
        table.add_row("[bold]overall score, 0–100[/]")
    for row in swept["overall"]:
        score = f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}"
        name = _name(row["estimator"], best=row["leads"] and not few)
        table.add_row(name, score, pair(row["score_interval"]))
    return table


def default_table(
    rows: Sequence[Row], wrong: set[tuple[str, str, str]] | frozenset[Any] = frozenset()
) -> Table:
    """Return scores at default settings: a line an estimator, on the parameter that changed.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`.
    """
    changed = {(row["scenario"], row["estimator"]) for row in rows if row["changed"]}
    shown = [r for r in rows if r["changed"] or (r["scenario"], r["estimator"]) not in changed]
    heads = [COLUMNS[name][0] if name in COLUMNS else "not settled" for name in DEFAULT]
    table = _table(
        "Default settings: the noise differs, so do not rank by lag",
        DEFAULT_LEGEND,
        ("estimator", "parameter", *heads),
    )
    for name in dict.fromkeys(row["scenario"] for row in shown):
        table.add_row(f"[bold]{escape(name)}[/]")
        here = [row for row in shown if row["scenario"] == name]
        for row in sorted(here, key=lambda r: r["estimator"] in CONTROLS):
            cells = [_text(each, row, rows) for each in DEFAULT]
            cells[0] += "*" * ((name, row["parameter"], row["estimator"]) in wrong)
            style = "red" if row["diverged"] else None
            table.add_row(_name(row["estimator"]), escape(row["parameter"]), *cells, style=style)
    return table


def _table(title: str, legend: str, heads: Sequence[str]) -> Table:
    table = Table(
        box=None,
        padding=(0, 1, 0, 0),
        title=title,
        title_justify="left",
        caption=legend,
        caption_justify="left",
    )
    for place, head in enumerate(heads):
        side = "right" if place else "left"
        table.add_column(escape(head), justify=side, no_wrap=bool(place), overflow="fold")
    return table


def _name(estimator: str, *, best: bool = False) -> str:
    note = " (recommended)" if estimator == RECOMMENDED else ""
    note = " (never moves)" if estimator == "frozen" else note
    return f"{'★' if best else ' '} {escape(estimator)}{note}"


def _by_lag(row: Row) -> float:
    return float("inf") if row["lag"] is None else row["lag"]


def _text(name: str, row: Row, rows: Sequence[Row]) -> str:
    """Return the text of a score; cross-talk is the largest of the other parameters."""
    if name == "cross_talk":
        others = [
            r["cross_talk"]
            for r in rows
            if r["cross_talk"] is not None
            and (r["scenario"], r["estimator"]) == (row["scenario"], row["estimator"])
        ]
        return short(max(others, default=None))
    if name == "never_settled":
        return str(row[name]) if row["changed"] else "–"
    cell: Cell = COLUMNS[name][1](row)
    return str(row[name]) if name == "diverged" else cell.text
