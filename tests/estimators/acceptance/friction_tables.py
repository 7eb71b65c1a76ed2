"""The tables of estimators on axes with friction, as plain text; a missed target has a mark."""

from collections import Counter
from collections.abc import Sequence
from functools import cache

import numpy as np

from acceptance.friction import Judged, in_catalogue, judged
from acceptance.friction_rows import pooled
from acceptance.friction_targets import (
    COLUMNS,
    CONFUSED,
    KNOWN,
    MOVES,
    OTHERS,
    QUIET,
    UNKNOWN,
    UNKNOWN_COLUMNS,
    WG,
    Column,
    Given,
)
from flexaxis.estimators.errors import EstimatorError

REFERENCE = "rpem-forgetting"
WIDTH = 24  # of an estimator's name
NAMED = ("k_T", "J_a", "f_m", "f_c", "J_m", "k_g")
runs = cache(judged)
"""Every run is made once, whatever tables it stands in."""


def scenario_rows(
    names: Sequence[str],
    estimators: Sequence[str],
    seeds: tuple[int, int],
    columns: Sequence[Column] = COLUMNS,
) -> None:
    """A block a scenario: the targets, then an estimator a line."""
    widths = [max(7, len(column.heading) + 1) for column in columns]
    for name in in_catalogue(names):
        plain = pooled(runs(name, REFERENCE, *seeds))
        print(f"\n{name}, {plain.runs} runs")
        _line("", [column.heading for column in columns], widths)
        aims = [column.target(Given(name, plain, plain)) for column in columns]
        _line("  target", aims, widths)
        for spec in dict.fromkeys([REFERENCE, *estimators]):
            try:
                row = plain if spec == REFERENCE else pooled(runs(name, spec, *seeds))
            except EstimatorError as error:
                print(f"{spec[: WIDTH - 1]:{WIDTH}}{error}")
                continue
            _line(spec, [column.cell(Given(name, row, plain)) for column in columns], widths)


def _line(first: str, cells: Sequence[str], widths: Sequence[int]) -> None:
    right = "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    print(f"{first[: WIDTH - 1]:{WIDTH}}{right}", flush=True)


def confusion(names: Sequence[str], estimators: Sequence[str], seeds: tuple[int, int]) -> None:
    """What each fault was taken for, a second after the alarm; target 95 % on the diagonal."""
    for spec in estimators:
        print(f"\n{spec}: named one second after the alarm, % of the runs (target 95)")
        _line("", [*NAMED, "other", "no", "missed", "at alarm"], [9] * 10)
        for name in in_catalogue(names):
            mine = runs(name, spec, *seeds)
            _line(name, _taken_for(mine), [9] * 10)


def _taken_for(mine: Sequence[Judged]) -> list[str]:
    found = [(fault, f) for run in mine for fault, f in zip(run.faults, run.found, strict=True)]
    said = Counter("missed" if f is None else _word(f.renamed) for _, f in found)
    first = [f is not None and f.named == (fault,) for fault, f in found]
    truth = found[0][0]
    shares = {word: 100 * said[word] / len(found) for word in (*NAMED, "other", "no", "missed")}
    short = shares.get(truth, 100.0) < 95
    cells = [f"{shares[word]:.0f}{'!' if short and word == truth else ''}" for word in shares]
    return [*cells, f"{100 * np.mean(first):.0f}"]


def _word(named: tuple[str, ...]) -> str:
    if not named:
        return "no"
    return named[0] if len(named) == 1 and named[0] in NAMED else "other"


def quiet(names: Sequence[str], estimators: Sequence[str], seeds: tuple[int, int]) -> None:
    """False alarms in 2000 s without a fault; target 1 at most, over all of these."""
    names = in_catalogue(names)
    print("\nwithout a fault: false alarms in 2000 s (target ≤ 1)")
    _line("", [*(name.removesuffix("-v1") for name in names), "all"], [18] * (len(names) + 1))
    for spec in estimators:
        each = [runs(name, spec, *seeds) for name in names]
        rates = [_rate(mine) for mine in [*each, [run for mine in each for run in mine]]]
        _line(spec, [f"{r:.1f}{'!' if r > 1 else ''}" for r in rates], [18] * len(rates))


def _rate(mine: Sequence[Judged]) -> float:
    return 2000 * sum(run.false for run in mine) / sum(run.calm for run in mine)


def friction(
    estimators: Sequence[str], seeds: tuple[int, int], scenarios: Sequence[str], parts: str
) -> None:
    """
    Print the tables asked for.

    Parameters
    ----------
    estimators : sequence of str
        As typed on a command line; plain forgetting stands beside them.
    seeds : (first, last)
        Half-open.
    scenarios : sequence of str
        Only these; all by default.
    parts : str
        Letters: k(nown structure), c(onfusion), w(g), u(nknown structure), m(oves and encoder),
        q(uiet).
    """

    def some(names: Sequence[str]) -> list[str]:
        return [name for name in names if not scenarios or name in scenarios]

    listed = {*KNOWN, *OTHERS, *CONFUSED, *WG, *UNKNOWN, *MOVES, *QUIET}
    if rest := [name for name in scenarios if name not in listed]:
        scenario_rows(rest, estimators, seeds)
    if "k" in parts:
        scenario_rows(some((*KNOWN, *OTHERS)), estimators, seeds)
    if "w" in parts:
        scenario_rows(some(WG), estimators, seeds)
    if "m" in parts:
        scenario_rows(some(MOVES), estimators, seeds)
    if "u" in parts:
        scenario_rows(some(UNKNOWN), estimators, seeds, UNKNOWN_COLUMNS)
    if "c" in parts and some(CONFUSED):
        confusion(some(CONFUSED), estimators, seeds)
    if "q" in parts and some(QUIET):
        quiet(some(QUIET), estimators, seeds)
