"""Tables in the terminal: lags at equal noise, then scores at default settings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, REFERENCE, too_few
from flexaxis.experiments.reporting import tables, words
from flexaxis.experiments.reporting.tables import between, short

WIDE = 200  # columns where there is no terminal, as in the log of a build: no name is cut
NOTES = {RECOMMENDED: " (recommended)", "frozen": " (never moves)"}
ALARMS = "false_alarms_per_1000_s"
EQUAL = (
    "estimator",
    "lag [s]",
    "95 % interval",
    "/ bound",
    "std after [%]",
    "false alarms / 1000 s",
)
LEGEND = f"""\
★        fastest, or not distinguishable from it on these seeds
lag      mean |error| after the fault / size of the fault × 5 s: 5 s = never reacts
/ bound  lag relative to the Cramér–Rao bound of an estimator that knows when, not what, changed
≤, ≥     no setting is as noisy, or as quiet, as {REFERENCE}: the lag is at most, at least, this"""
DEFAULT_LEGEND = """\
*        wrong by more than half the size of the fault already before it: not comparable
std, bias and cross-talk in % of nominal; score: 0 = never reacts, 100 = Cramér–Rao bound"""


def show(table: Table) -> None:
    """Print a table, in a file or a pipe as wide as it needs."""
    console = Console()
    Console(width=console.width if console.is_terminal else WIDE).print(table)


def lines(title: str, heads: Sequence[str], rows: Any, legend: str) -> Table:
    """Return a table; a row of one cell is a heading, one that begins with ✗ is red."""
    table = Table(*map(escape, heads), box=None, padding=(0, 1, 0, 0), title=title,
                  title_justify="left", caption=legend, caption_justify="left")  # fmt: skip
    for column in table.columns:
        column.justify, column.overflow = "left" if column is table.columns[0] else "right", "fold"
    for row in rows:
        style = "bold" if len(row) == 1 else "red" if row[0] == "✗" else None
        table.add_row(*map(escape, row), style=style)
    return table


def show_run(summary: Mapping[str, Any]) -> None:
    """Print what the report of a run says first: lags at equal noise, then default settings.

    Parameters
    ----------
    summary : mapping
        As in summary.json.
    """
    if (summary.get("tradeoff") or {}).get("matched"):
        show(equal_noise_table(summary["tradeoff"], len(summary["seeds"])))
    show(default_table(summary["rows"]))


def equal_noise_table(swept: Mapping[str, Any], seeds: int) -> Table:
    """Return the lags at equal noise, a line a fault and estimator, and the overall scores.

    Parameters
    ----------
    swept : mapping
        With ``matched``, ``overall`` and ``definitions``, as in a summary.
    seeds : int
    """
    few, faults = too_few(swept["matched"]), words.fault_words(swept)
    title = (
        f"Lag at equal noise: who follows a fault fastest?  ({len(faults)} faults × {seeds} seeds)"
    )
    return lines(title, EQUAL, _equal(swept, faults, few), f"{few}\n{LEGEND}".strip())


def _equal(swept: Mapping[str, Any], faults: Mapping[str, str], few: str) -> Iterator[list[str]]:
    matched = words.faults_of(swept["matched"]).sort_values("lag")
    for fault, text in faults.items():
        yield [f"{text}  ({fault})"]
        for row in matched[matched["fault"] == fault].to_dict("records"):
            lag = AT_MOST.get(row["how"], "") + short(row["lag"])
            rest = [short(row[name]) for name in ("over_bound", "std_after", ALARMS)]
            yield [_name(row, few), lag, between(row["lag_interval"]), *rest]
    yield ["overall score: 0 = never reacts, 100 = Cramér–Rao bound"]
    for row in swept["overall"]:
        score = f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}"
        yield [_name(row, few), score, between(row["score_interval"])]


def _name(row: Mapping[str, Any], few: str = "") -> str:
    star = "★" if row.get("leads") and not few else " "
    return f"{star} {row['estimator']}{NOTES.get(row['estimator'], '')}"


def default_table(rows: Sequence[Mapping[str, Any]], wrong: Any = frozenset()) -> Table:
    """Return scores at default settings: a line an estimator, on the parameter that changed.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled.
    wrong : set of (str, str, str)
        (scenario, parameter, estimator) whose lag says nothing.
    """
    title = "Default settings: the noise differs, so do not rank by lag"
    heads = ["estimator", "parameter", *tables.COLUMNS.values()]
    return lines(title, heads, _default(tables.flat(rows), wrong), DEFAULT_LEGEND)


def _default(rows: pd.DataFrame, wrong: Any) -> Iterator[list[str]]:
    cases = rows.groupby(["scenario", "estimator"])
    rows = rows.assign(cross_talk=cases["cross_talk"].transform("max"))
    rows = rows[rows["changed"] | ~cases["changed"].transform("any")]
    rows = rows.sort_values("estimator", key=lambda names: names == "frozen", kind="stable")
    for scenario, own in rows.groupby("scenario", sort=False):
        yield [str(scenario)]
        for row in own.to_dict("records"):
            cells = [short(row[name]) for name in tables.COLUMNS]
            cells[0] += "*" * ((scenario, row["parameter"], row["estimator"]) in wrong)
            yield [_name(row), row["parameter"], *cells]
