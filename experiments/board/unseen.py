"""What an entry's rank rests on, run on seeds that nobody knew and with faults at other times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from flexaxis.experiments.board.agreement import LEAST_RATIO, MOVED_RATIO, Pair
from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.stored import Own
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.scoring.tracks import NOMINAL, NUISANCE, track_of
from flexaxis.sim.scenario import Scenario

Rows = list[dict[str, Any]]
Make = Callable[[str, Scenario, Sequence[int]], Mapping[int, Rows]]
"""Runs an estimator on some seeds of a scenario, and gives its rows by seed."""
SEEDS, EARLIER = "unknown seeds", "faults that come earlier"


@dataclass(frozen=True)
class Ranked:
    """A setting of which a rank is made.

    Attributes
    ----------
    scenario : Scenario
    text : str
    group : str
        What is compared together: a track, and which side of the match a setting is.
    """

    scenario: Scenario
    text: str
    group: str


def ranked(entry: Entry, own: Own, board: Board) -> list[Ranked]:
    """Return all settings that carry a rank: on either side of the match, or as entered.

    Between the two settings on either side of the reference's noise the match is interpolated: who
    is as honest at both as on reported seeds is so at the match.
    """
    known = {scenario.name: scenario for scenario in board.scenarios}
    found: dict[tuple[str, str], Ranked] = {}
    for row in own.at_excess:
        scenario = known[row["scenario"]]
        for text, side in zip(row["settings"], _sides(entry, row), strict=True):
            group = f"{track_of(scenario)}, {side}"
            found.setdefault((scenario.name, text), Ranked(scenario, text, group))
    for row in own.as_set:
        scenario = known[row["scenario"]]
        found[scenario.name, ""] = Ranked(scenario, entry.estimator, NUISANCE)
    return list(found.values())


def _sides(entry: Entry, row: Mapping[str, Any]) -> list[str]:
    turns = entry.settings[row["scenario"]]
    order = sorted(row["settings"], key=lambda text: turns[text])
    words = ("quieter setting", "noisier setting") if len(order) > 1 else ("nearest setting",)
    return [words[order.index(text)] for text in row["settings"]]


def reported(rows: Sequence[Mapping[str, Any]], settings: Sequence[Ranked], board: Board) -> Any:
    """Return the rows of the frozen seeds by setting: `(scenario and setting, seed)`."""
    wanted = {(each.scenario.hash, each.text): _what(each) for each in settings}
    found: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for row in rows:
        what = wanted.get((row["hash"], row["estimator"]))
        if what is not None and row["seed"] in board.seeds:
            found.setdefault((what, row["seed"]), []).append(row)
    return found


def pairs(
    settings: Sequence[Ranked],
    known: Mapping[tuple[str, int], Sequence[Mapping[str, Any]]],
    seeds: Sequence[int],
    moved: Callable[[Scenario], Scenario],
    make: Make,
) -> Iterator[Pair]:
    """Yield what is to be compared, group by group.

    Parameters
    ----------
    settings : sequence of Ranked
    known : mapping
        As from `reported`.
    seeds : sequence of int
        The first half for what is in the catalogue, the second for faults that come earlier: two
        runs of one seed would differ for the first time where the fault is.
    moved : callable
        Gives a scenario with its faults at other times.
    make : callable
    """
    first, second = seeds[: len(seeds) // 2], seeds[len(seeds) // 2 :]
    for group in dict.fromkeys(each.group for each in settings):
        mine = [each for each in settings if each.group == group]
        whats = {_what(each) for each in mine}
        usual = {key: rows for key, rows in known.items() if key[0] in whats}
        yield Pair(SEEDS, group, usual, _made(mine, first, make), LEAST_RATIO)
        if all(track_of(each.scenario) == NOMINAL for each in mine):
            early = [Ranked(moved(each.scenario), each.text, group) for each in mine]
            yield Pair(EARLIER, group, usual, _made(early, second, make), MOVED_RATIO)


def _made(
    settings: Sequence[Ranked], seeds: Sequence[int], make: Make
) -> dict[tuple[str, int], Rows]:
    return {
        (_what(each), seed): rows
        for each in settings
        for seed, rows in make(each.text, each.scenario, seeds).items()
    }


def _what(each: Ranked) -> str:
    """Return a name of a setting on a scenario, wherever its faults are."""
    return f"{each.scenario.name} {each.text}"
