"""What was found, in the terminal: scores at equal noise and as set, and what failed in words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence, Set
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.mismatch import misled
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, too_few
from flexaxis.experiments.reporting.tables import Table as Page
from flexaxis.experiments.reporting.tables import number, pair, settled
from flexaxis.experiments.scoring import pooling
from flexaxis.experiments.scoring.score_definition import Score
from flexaxis.experiments.scoring.score_table import SCORES
from flexaxis.sim.scenario import scenario_from

LEGENDS = (
    {
        "lag": "lag after the fault, ± 95 % half-width over seeds; in brackets where the bias "
        "before it is over half its size",
        "std": "std and bias before it [% of nominal]",
    },
    {"score": "score: 0 for doing nothing, 100 on the Cramér–Rao bound with all θ unknown "
              "(steps only)"},
    {"x-talk": "x-talk: largest error caused in another parameter [% of nominal]"},
    {
        "lost": "lost: diverged runs",
        "open": "open: other runs never settled",
        "µs": "µs: time per sample",
    },
)  # fmt: skip
"""What columns mean, by the first word of their heading: a line for those that belong together."""

ALWAYS = ("estimator", "θ", "lag", "lost")
"""Columns that the narrowest terminal has: without the lost runs a lag would praise who loses."""

_SAMPLE = re.compile(r", sample \d+( \([^)]*\))?")
ALIKE = 60  # characters by which two reasons are told apart

BIAS = SCORES["bias"]  # beside the spread: who errs by more is not ahead
SHOWN = [
    each
    for score in SCORES.values()
    if score.short
    for each in ((score, BIAS) if score.name == "std" else (score,))
    if each is not BIAS or score.name == "std"
]


WIDE = 200  # columns where there is no terminal, as in the log of a build: no name is cut


NAME = 20  # columns that the names of estimators have at least; longer ones are folded


def named(text: str) -> str:
    """Return a name for a cell: brackets are mark-up there, and a terminal obeys what is unseen."""
    return escape(text)


def _called(estimator: str) -> str:
    """Return an estimator for a cell; the one that is recommended says so."""
    return named(estimator) + (" (recommended)" if estimator == RECOMMENDED else "")


def show(table: Table) -> None:
    """Print a table, in a file or a pipe as wide as it needs."""
    Console(width=_width()).print(table)


def _width() -> int:
    console = Console()
    return console.width if console.is_terminal else WIDE


def show_table(table: Page, *, caption: str) -> None:
    """Print a table of words as pages have it, as wide as the terminal."""
    found = Table(box=None, padding=(0, 1, 0, 0), caption=caption)
    for place, column in enumerate(table.columns):
        found.add_column(escape(column.heading), ratio=int(place > 0) or None, no_wrap=place == 0)
    for row in table.rows:
        style = "bold red" if row.cells[0].text == "✗" else None
        found.add_row(*(named(cell.text) for cell in row.cells), style=style)
    Console().print(found)


def show_run(summary: Mapping[str, Any]) -> None:
    """Print what the report of a run says first: scores at equal noise, then as set.

    Parameters
    ----------
    summary : mapping
        As in summary.json.
    """
    swept = summary.get("tradeoff") or {}
    if swept.get("matched"):
        show(equal_noise_table(swept["matched"], swept["overall"]))
        Console(width=_width()).print("\nas set, not at equal noise")
    scenarios = {
        name: scenario_from(entry["definition"], source=name)
        for name, entry in summary["scenarios"].items()
    }
    show(score_table(summary["rows"], misled(summary["rows"], scenarios)))


def score_table(
    rows: Sequence[Mapping[str, Any]], wrong: Set[tuple[str, str, str]] = frozenset()
) -> Table:
    """Return a line per scenario and estimator, on the parameter that changed.

    Without a fault, or for who does not estimate what changed, there is one for each parameter. In
    a narrow terminal the last columns but that of lost runs are left out, and named below.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`: their lags stand in brackets.
    """
    found = {(row["scenario"], row["estimator"]) for row in rows if row["changed"]}
    shown = [r for r in rows if r["changed"] or (r["scenario"], r["estimator"]) not in found]
    adapted = any(row.get("recovered") is not None for row in shown)
    scores = [score for score in SHOWN if adapted or score.name != "recovered"]
    lines = [_cells(row, scores, _cross_talk(rows, row)) for row in shown]
    for row, cells in zip(shown, lines, strict=True):
        if (row["scenario"], row["parameter"], row["estimator"]) in wrong:
            cells[2] = f"({cells[2]})"
    units = ["[s]" if score.unit == "s" else score.unit or "" for score in scores]
    short = [
        f"{score.short or score.name} {unit}".strip()
        for score, unit in zip(scores, units, strict=True)
    ]
    headings = ["estimator", "θ", *short, "x-talk", "µs"]
    kept = _fitting([headings, *lines], _width())
    heads = [headings[i] for i in kept]
    table = Table(box=None, padding=(0, 1, 0, 0), caption_justify="left")
    without = [heading for heading in headings if heading not in heads]
    table.caption = _legend(heads) + _left_out(without)
    for place, heading in enumerate(heads):
        how: Any = {"overflow": "fold"} if place == 0 else {"no_wrap": True}
        table.add_column(escape(heading), justify="right" if place > 1 else "left", **how)
    for before, row, cells in zip([None, *shown], shown, lines, strict=False):
        if before is None or before["scenario"] != row["scenario"]:
            table.add_row(f"[bold]{named(row['scenario'])}[/]")
        table.add_row(*(cells[i] for i in kept), style="red" if row["diverged"] else None)
    return table


def _fitting(lines: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return which columns have room beside the names of estimators, those of ALWAYS at least."""
    columns = list(zip(*lines, strict=True))
    wide = [max(map(len, column)) + 1 for column in columns]
    wide[0] = min(wide[0], NAME)
    kept = list(range(len(wide)))
    for place in kept[::-1]:
        if sum(wide[i] for i in kept) <= width:
            break
        if _word(lines[0][place]) not in ALWAYS:
            kept.remove(place)
    return kept


def _word(heading: str) -> str:
    return heading.partition(" ")[0]


def _legend(headings: Sequence[str]) -> str:
    """Return what the columns that are shown mean."""
    words = {_word(heading) for heading in headings}
    lines = ("; ".join(text for key, text in part.items() if key in words) for part in LEGENDS)
    return "\n".join(line for line in lines if line)


def _left_out(headings: Sequence[str]) -> str:
    if not headings:
        return ""
    return f"\nleft out, for the terminal is narrow: {', '.join(map(escape, headings))}"


def _cells(row: Mapping[str, Any], scores: Sequence[Score], cross_talk: float | None) -> list[str]:
    return [
        "  " + _called(row["estimator"]),
        named(row["parameter"]),
        *(_cell(score, row) for score in scores),
        number(cross_talk, 2),
        _cost(row["cost"]["us_per_sample"]),
    ]


def _cell(score: Score, row: Mapping[str, Any]) -> str:
    value = row.get(score.name)
    if score.name == "lag":
        low, high = row["lag_interval"] or (0.0, 0.0)
        return number(value, 2) + f" ±{(high - low) / 2:.1g}" * (low != high)
    if score.pool is pooling.median:
        return settled(value, row["changed"])
    if score.kind == "truth":  # a count, of runs in which there was something to settle
        return "–" if score.pool is pooling.count_kept and not row["changed"] else str(value)
    if score.better == "more":
        return "–" if value is None else f"{value:.0f}"
    return number(value, 2)


def _cost(microseconds: float | None) -> str:
    if microseconds is None:  # it failed in all runs
        return "–"
    return f"{microseconds:.2f}" if microseconds < 10 else f"{microseconds:.0f}"


def _cross_talk(rows: Sequence[Mapping[str, Any]], row: Mapping[str, Any]) -> float | None:
    """Return the largest error that the fault causes in another parameter."""
    others = [
        other["cross_talk"]
        for other in rows
        if (other["scenario"], other["estimator"]) == (row["scenario"], row["estimator"])
        and other["cross_talk"] is not None
    ]
    return max(others, default=None)


def equal_noise_table(
    matched: Sequence[Mapping[str, Any]], overall: Sequence[Mapping[str, Any]]
) -> Table:
    """Return the lags at equal noise, a line a fault and estimator, and the scores of all faults.

    Parameters
    ----------
    matched, overall : sequence of mapping
        As from a `flexaxis.experiments.studies.sweep.Sweep`, and from `comparison.ranking.overall`.
    """
    few = too_few(matched)
    caption = EQUAL.format(few or BEST)
    table = Table(box=None, padding=(0, 1, 0, 0), caption=caption, caption_justify="left")
    table.add_column("estimator", overflow="fold")
    for heading in (r"lag \[s]", "95 %", "×bound", "after %", "false"):
        table.add_column(heading, justify="right", no_wrap=True)
    for scenario, parameter in dict.fromkeys((r["scenario"], r["parameter"]) for r in matched):
        table.add_row(f"[bold]{named(scenario)}[/], {named(parameter)}")
        mine = [r for r in matched if (r["scenario"], r["parameter"]) == (scenario, parameter)]
        for row in sorted(mine, key=lambda r: r["lag"] or math.inf):
            values = (row["over_bound"], row["std_after"], row["false_alarms_per_1000_s"])
            table.add_row(
                ("* " if row["leads"] and not few else "  ") + _called(row["estimator"]),
                AT_MOST.get(row["how"], "") + number(row["lag"]),
                pair(row["lag_interval"]),
                *(number(value, 2) for value in values),
            )
    if overall:
        table.add_row("[bold]score at equal excess error[/]")
    for row in overall:
        sign = AT_LEAST.get(row["how"], "")
        name = ("* " if row["leads"] and not few else "  ") + _called(row["estimator"])
        table.add_row(name, f"{sign}{row['score']:.0f}", pair(row["score_interval"]))
    return table


BEST = "*: the best, and those that paired seeds cannot tell from it"

EQUAL = """\
lag where the std of θ before the fault is that of rpem-forgetting at its default
{}
≤, ≥: quieter, or noisier, than that at every setting of its knob
after: std in the last 2 s of the window; false: false alarms in 1000 s"""


def failures_in_words(failures: Sequence[Mapping[str, Any]]) -> list[tuple[str, int]]:
    """Return a sentence for each kind of failure, and how many cases failed like that.

    Parameters
    ----------
    failures : sequence of mapping
        With `scenario`, `estimator`, `seed` and `error`.
    """
    told: dict[tuple[str, str], list[str]] = {}
    for row in failures:
        where = f"{row['scenario']}, seed {row['seed']}"
        text = row["error"].partition(": ")[2]
        if not text.startswith(row["estimator"]):  # else it says itself of whom and where
            text = f"{row['estimator']} failed on {where}: {row['error']}"
        alike = row["estimator"], _SAMPLE.sub("", row["error"].replace(where, ""))[:ALIKE]
        told.setdefault(alike, []).append(text)
    return [(texts[0], len(texts)) for texts in told.values()]
