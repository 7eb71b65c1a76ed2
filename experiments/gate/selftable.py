"""The table of the self-test: for the terminal, and as Markdown for docs/gate.md.

Made of what `flexaxis compare --self-test --json` prints, so that a stored self-test has one, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.table import Table

Row = Mapping[str, Any]

NOTHING = "–"  # promised


def columns(rates: Sequence[Row]) -> list[str]:
    """Return the headings: what, the seeds of each look, what is promised."""
    return ["in % of comparisons", *dict.fromkeys(map(_seeds, rates)), "promised"]


def _seeds(rate: Row) -> str:
    """Return the seeds of a comparison; with an arrow where it looks more than once."""
    first, last = rate["looks"][0], rate["looks"][-1]
    return f"{first} seeds" if first == last else f"{first} → {last}"


def lines(rates: Sequence[Row]) -> list[list[str]]:
    """Return the cells of each row, with exact 95 % intervals; a broken promise is marked."""
    groups: dict[str, list[Row]] = {}
    for rate in rates:
        groups.setdefault(rate["what"], []).append(rate)
    return [[what, *map(_cell, group), _promised(group)] for what, group in groups.items()]


def _cell(rate: Row) -> str:
    low, high = map(_percent, rate["interval"])
    return f"{_percent(rate['rate'])} ({low} … {high})" + ("" if rate["kept"] else " BROKEN")


def _percent(share: float) -> str:
    """Return per cent, to the hundredth where next to nothing is left of it or missing."""
    percent = 100 * share
    return f"{percent:.2f}" if percent < 5 or 95 < percent < 100 else f"{percent:.0f}"


def _promised(group: Sequence[Row]) -> str:
    given = [rate for rate in group if rate["promise"] != NOTHING]
    if not given:
        return NOTHING
    where = "" if len(given) == len(group) else f" at {_seeds(given[0])}"
    return f"{given[0]['promise']}{where}"


def markdown(rates: Sequence[Row]) -> str:
    """Return the table as Markdown; docs/gate.md shows it.

    Parameters
    ----------
    rates : sequence of mapping
        As from `selftest.Rate.as_dict`.
    """
    head = columns(rates)
    rows = [f"| {' | '.join(row)} |" for row in lines(rates)]
    return "\n".join([f"| {' | '.join(head)} |", f"|{'---|' * len(head)}", *rows]) + "\n"


def terminal(rates: Sequence[Row]) -> Table:
    """Return the table for a terminal."""
    head, *rest = columns(rates)
    table = Table(head, box=None, padding=(0, 1, 0, 0))
    for name in rest:
        table.add_column(name, justify="right")
    for row in lines(rates):
        table.add_row(*row, style="red" if any("BROKEN" in cell for cell in row) else None)
    return table
