"""Create the main tables of a run, and convert tables to text for the terminal.

The main tables contain the lags at equal noise, and the scores with default settings.
"""

import sys
from collections.abc import Mapping, Sequence
from typing import Any

import rich.table
from rich.console import Console
from rich.markup import escape

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, REFERENCE, too_few
from flexaxis.experiments.reporting import sentences, tables
from flexaxis.experiments.reporting.tables import Cell, Table, between, short

NOTES = {REFERENCE: "the paper’s method", RECOMMENDED: "recommended", "frozen": "never moves"}
LEGEND = (
    "★ marks the fastest estimator, and all estimators that are not significantly slower",
    "Below each lag are the ratio of lag to bound (×) and the 95 % confidence interval of the lag",
    "The lag is the mean absolute error after the fault, divided by the size of the fault, times "
    "5 s (after a step, an estimator that never reacts has a lag of 5 s)",
    "The bound is the Cramér–Rao bound for an estimator that knows the time of the fault, but not "
    "the changed parameter",
    "≤ and ≥ mark upper and lower limits of the lag of estimators that cannot be tuned to the "
    f"noise of {REFERENCE}",
)


def as_text(*tables: Table) -> str:
    """Convert tables to text that fits the terminal, or 200 columns in a file or a pipe."""
    # The log of a CI build is a file. All names fit into 200 columns.
    console = Console(width=None if sys.stdout.isatty() else 200)
    with console.capture() as capture:
        console.print(*map(_shown, tables))
    return capture.get().rstrip()


def _shown(table: Table) -> rich.table.Table:
    """Convert a table to a `rich` table, with the name at the top and the notes at the end."""
    shown = rich.table.Table(box=None, padding=(0, 1, 0, 0), title=table.name, title_justify="left",
                             caption="\n".join(table.notes), caption_justify="left")  # fmt: skip
    for head in table.heads:
        shown.add_column(escape(head), justify="right", overflow="fold")
    shown.columns[0].justify = "left"
    for _, cells in table.rows:
        shown.add_row(*(escape(f"{'★ ' * c.best}{c.text}\n{c.small}".strip()) for c in cells))
    return shown


def run_text(summary: Mapping[str, Any]) -> str:
    """Return the main tables of a run as text, with the lags at equal noise first.

    Parameters
    ----------
    summary : mapping
        Content of summary.json.
    """
    swept = summary.get("tradeoff") or {}
    first = [equal_noise_table(swept)] if swept.get("matched") else []
    return as_text(*first, default_table(summary["rows"]))


def equal_noise_table(swept: Mapping[str, Any]) -> Table:
    """Return the table of lags at equal noise, with a row per estimator and a column per fault.

    The last column contains the overall score of each estimator.

    Parameters
    ----------
    swept : mapping
        Entry ``tradeoff`` of summary.json. The entry contains ``matched``, ``overall`` and
        ``definitions``.
    """
    few, faults, cells = too_few(swept["matched"]), sentences.fault_words(swept), {}
    for row in swept["overall"]:
        text, ends = f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}", row["score_interval"]
        cells[row["estimator"], ""] = Cell(text, row["score"], between(ends), row["leads"])
    for row in swept["matched"]:
        text = AT_MOST.get(row["how"], "") + short(row["lag"]) if row["lag"] else "lost"
        small = f"{short(row['over_bound'])} ×, {between(row['lag_interval'])}"
        cell = Cell(text, row["lag"] or "", small, row["leads"] and not few)
        cells[row["estimator"], f"{row['scenario']}: {row['parameter']}"] = cell
    heads = [f"{text}: lag [s]\n{fault}" for fault, text in faults.items()]
    rows = [(who, [Cell(who, small=NOTES.get(who, "")),
                   *(cells.get((who, column), Cell("–", "")) for column in (*faults, ""))])
            for who in dict.fromkeys(who for who, _ in cells)]  # fmt: skip
    notes = [few] * bool(few) + [*LEGEND]
    return Table("Lag at equal noise", ["estimator", *heads, "score\n0–100"], rows, notes)


def default_table(pooled: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table of the scores of estimators with default settings.

    The table contains the changed parameters of each scenario. If no parameter changes, the table
    contains all parameters.

    Parameters
    ----------
    pooled : sequence of mapping
        Pooled scores with one mapping for each scenario, estimator and parameter.
    """
    rows = tables.flat(pooled)
    cases = rows.groupby(["scenario", "estimator"])["changed"]
    rows = rows[rows["changed"] | ~cases.transform("any")]
    rows = rows.drop(columns=rows.filter(like="_interval"))
    rows = rows.assign(last=rows["estimator"] == "frozen").sort_values(["scenario", "last"])
    heads = {name: name for name in ("scenario", "estimator", "parameter")} | tables.COLUMNS
    title = "Default settings: do not rank by lag, because the noise of the estimators differs"
    return tables.table(title, rows, heads)
