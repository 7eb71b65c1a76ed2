"""The frozen suite of a board, and who is ahead on it: at equal excess error, with ties.

The reference that an entry is matched to is run by whoever asks; of an entry come its own rows.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np

from flexaxis.experiments.board.entry import BoardEntry, EntryError
from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.comparison.matching import MATCHED
from flexaxis.experiments.comparison.mismatch import NUISANCE, TRACKS, UNKNOWN, track_of
from flexaxis.experiments.comparison.ranking import overall
from flexaxis.experiments.running.bench import Bench, Runs
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.seeds import FIRST
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.experiments.storage.files import dumps
from flexaxis.experiments.studies.sweep import FACTORS, again, reference
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.storage.reading import shown

Row = dict[str, Any]

SUITE = "board-v2"
"""The one suite that entries are made on; to move on to another, change its name here."""
QUICK_SEEDS = 5
"""The fewest of which there are intervals; an entry with them is for trying."""
NOTHING = {"lag": np.log(5.0), "excess": 0.0}
"""Logarithms of what whoever does nothing has: its lag is the window in which it is taken [s]."""
MEASURES: Mapping[str, str] = {
    "score": "mean score at equal excess error",
    "lag": "geometric mean lag at equal excess error [s]",
    "excess": "geometric mean excess error, as entered",
}
"""By what the entries of a track are ranked: where a bound is defined, by the score."""


@dataclass(frozen=True)
class Board:
    """What every entry is scored on: a name, scenarios and seeds."""

    name: str
    scenarios: tuple[Scenario, ...]
    seeds: tuple[int, ...]

    @cached_property
    def hash(self) -> str:
        """SHA-256 of names, contents and seeds."""
        content = [[[s.name, s.hash] for s in self.scenarios], list(self.seeds)]
        return sha256(dumps(content).encode()).hexdigest()

    @property
    def faults(self) -> tuple[Scenario, ...]:
        """The scenarios on which knobs are turned, to compare at equal noise."""
        return tuple(s for s in self.scenarios if track_of(s) != NUISANCE)

    @property
    def typed(self) -> str:
        """Its seeds as they are typed."""
        return f"{self.seeds[0]}:{self.seeds[-1] + 1}"

    def quick(self) -> Board:
        """Return the same with few seeds, for trying."""
        return Board(self.name, self.scenarios, self.seeds[:QUICK_SEEDS])


def board() -> Board:
    """Return the frozen one."""
    found = find_suite(SUITE)
    scenarios = tuple(find_scenario(name) for name in found.scenarios)
    return Board(SUITE, scenarios, tuple(range(FIRST, FIRST + found.seeds)))


@dataclass(frozen=True)
class Own:
    """What the rows of an entry come to.

    Attributes
    ----------
    at_excess : list of dict
        One for each fault, at the excess error of the reference, as in
        `flexaxis.experiments.studies.sweep.Sweep`; `estimator` is the label of the entry.
    as_set : list of dict
        One for each scenario without a fault to trade off: ``scenario, estimator, seeds, excess``
        (geometric mean), ``false_alarms_per_1000_s, lost`` and ``values`` of ln excess by seed.
    lost : int
        Runs that were lost at the setting as entered, of `runs`.
    runs : int
    """

    at_excess: list[Row]
    as_set: list[Row]
    lost: int
    runs: int


class Stored(Bench):
    """Rows that were made already, in the place of a bench: what is missing is not run."""

    def __init__(self, rows: Sequence[Mapping[str, Any]]) -> None:
        self.by_setting: dict[tuple[str, str], dict[int, list[Any]]] = defaultdict(dict)
        for row in rows:
            own = self.by_setting[row["hash"], row["estimator"]]
            own.setdefault(row["seed"], []).append(row)

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return rows as `Bench.runs` does; EntryError where there are not all, or of no run."""
        found: dict[tuple[str, str], Runs] = {}
        for scenario in scenarios:
            for text in dict.fromkeys(estimators):
                own, what = (
                    self.by_setting.get((scenario.hash, text), {}),
                    f"{scenario.name}, {text}",
                )
                if lacks := [seed for seed in seeds if seed not in own]:
                    raise EntryError(f"{what}: no rows of {len(lacks)} of {len(seeds)} seeds")
                found[scenario.hash, text] = runs = [own[seed] for seed in seeds]
                if any(len(run) != run[0]["rows"] for run in runs):
                    raise EntryError(f"{what}: rows of a run twice, or not all")
                if any(run[0]["error"] is not None for run in runs):
                    raise EntryError(f"{what}: a run has failed")
        return found


def reference_rows(board: Board, means: Means) -> list[Row]:
    """Return the rows of the reference on the faults of a board, run here."""
    found = Bench(board.faults, None, means).runs(board.faults, [reference()], board.seeds)
    return [row for runs in found.values() for run in runs for row in run]


def check_rows(entry: BoardEntry, board: Board) -> str:
    """Return what is wrong with the rows of an entry: all of its settings, each once, no others."""
    first = {turn for line in entry.turns.values() for turn in line if turn in FACTORS}
    for scenario in board.faults if entry.knob else ():
        if first - {*entry.turns.get(scenario.name, first)}:
            return f"{scenario.name}: lacks turns that other scenarios have"
    try:
        stored = Stored(entry.rows())
        wanted = {(s.hash, text): s for s in board.scenarios for text in entry.settings(s)}
        for key, own in stored.by_setting.items():
            if key not in wanted:
                return f"{shown(key[1])}: no setting of the estimator on a scenario of the suite"
            if strange := {*own} - {*board.seeds}:
                return f"{shown(key[1])}: seed {shown(strange.pop())} is none of the suite"
        for (_, text), scenario in wanted.items():
            stored.runs([scenario], [text], board.seeds)
    except EntryError as error:
        return str(error)
    except (AttributeError, LookupError, TypeError) as error:
        return f"are not what rows are: {error!r}"
    known = {*entry.turns, *entry.left_out}
    missing = [s.name for s in board.scenarios if s.name not in known]
    return f"neither run nor left out: {', '.join(missing)}" if missing else ""


def own_of(entry: BoardEntry, board: Board, usual: Sequence[Row]) -> Own:
    """Return what the rows of an entry come to, beside those of the reference.

    Raises
    ------
    EntryError
        If they are not all there, or not what rows are.
    """
    try:
        bench = Stored(entry.rows())
        bench.by_setting |= Stored(usual).by_setting  # whoever enters the reference has it from us
        lines = {s.name: {entry.label: entry.settings(s)} for s in board.faults}
        faults = [s for s in board.faults if s.name in entry.turns]
        found = again(faults, lines, board.seeds, bench) if faults else []
        as_set, lost, runs = [], 0, 0
        for scenario in (s for s in board.scenarios if s.name in entry.turns):
            text = next(t for t, turn in entry.settings(scenario).items() if turn == 1)
            each = bench.runs([scenario], [text], board.seeds)[scenario.hash, text]
            lost += sum(bool(run[0]["diverged"]) for run in each)
            runs += len(each)
            if scenario not in faults:
                as_set.append(_as_set(scenario, entry.label, each))
    except EntryError as error:
        raise EntryError(*(f"{entry.folder}: {problem}" for problem in error.problems)) from error
    except FlexaxisError as error:
        raise EntryError(f"{entry.folder}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise EntryError(f"{entry.folder}: its rows cannot be pooled: {error!r}") from error
    return Own(found, as_set, lost, runs)


def _as_set(scenario: Scenario, label: str, runs: Runs) -> Row:
    """Return what an estimator is worth on the nuisance track, at its one setting."""
    logs = np.log(np.maximum([float(run[0]["excess"]) for run in runs], FLOOR))
    told = [run[0]["detection"] for run in runs]
    rates = [] if None in told else [found["false_alarms_per_1000_s"] for found in told]
    return {
        "scenario": scenario.name,
        "parameter": None,
        "estimator": label,
        "how": MATCHED,
        "seeds": len(runs),
        "excess": float(np.exp(logs.mean())),
        "false_alarms_per_1000_s": float(np.mean(rates)) if rates else None,
        "lost": sum(bool(run[0]["diverged"]) for run in runs),
        "values": {"excess": [float(f"{value:.6g}") for value in logs]},
    }


def standings(entries: Mapping[str, Own], board: Board) -> dict[str, dict[str, Any]]:
    """Return the places on every track, the best first.

    Parameters
    ----------
    entries : mapping of str to Own
        By label; all on the seeds of the board.
    board : Board

    Returns
    -------
    dict
        By track ``measure, words, scenarios, places``; of a place ``label, value, interval, how,
        over_bound, faults, of, false_alarms, leads``.
    """
    found: dict[str, dict[str, Any]] = {}
    for track, words in TRACKS.items():
        names = [s.name for s in board.scenarios if track_of(s) == track]
        if names:
            measure = {NUISANCE: "excess", UNKNOWN: "lag"}.get(track, "score")
            places = _places(entries, names, measure)
            found[track] = {
                "measure": measure, "words": words, "scenarios": names, "places": places
            }  # fmt: skip
    return found


def _places(entries: Mapping[str, Own], names: Sequence[str], measure: str) -> list[Row]:
    """Return the places by a measure; whoever has none at a fault counts as doing nothing there."""
    known = {label: own.as_set if measure == "excess" else own.at_excess
             for label, own in entries.items()}  # fmt: skip
    rows = {label: [r for r in every if r["scenario"] in names] for label, every in known.items()}
    if measure == "excess":  # all of these scenarios, or none
        rows = {label: mine for label, mine in rows.items() if len(mine) == len(names)}
    found = overall([_gain(row, measure) | {"estimator": label}
                     for label, mine in rows.items() for row in mine])  # fmt: skip
    places = [_place(each, rows[each["estimator"]], measure) for each in found]
    empty = dict.fromkeys(("value", "interval", "over_bound", "false_alarms"))
    empty |= {"how": "none", "faults": 0, "of": found[0]["faults"] if found else 0, "leads": False}
    there = {place["label"] for place in places}
    return [*places, *({"label": label} | empty for label in entries if label not in there)]


def _gain(row: Row, measure: str) -> Row:
    """Return a row whose score is what is gained over doing nothing, by any measure."""
    values = row["values"][measure]
    if measure == "score":
        return row
    gained = None if values is None else [NOTHING[measure] - value for value in values]
    return row | {"bound": True, "values": {"score": gained}}


def _place(found: Row, mine: Sequence[Row], measure: str) -> Row:
    """Return what is said of an entry on a track."""

    def value(score: float) -> float:
        return score if measure == "score" else float(np.exp(NOTHING[measure] - score))

    ends = found["score_interval"]
    over = [row["over_bound"] for row in mine if row.get("over_bound")]
    told = [rate for row in mine if (rate := row["false_alarms_per_1000_s"]) is not None]
    return {
        "label": found["estimator"],
        "value": value(found["score"]),
        "interval": ends and sorted(map(value, ends)),
        "how": found["how"],
        "over_bound": float(np.exp(np.mean(np.log(over)))) if over else None,
        "faults": sum(measure == "excess" or row["lag"] is not None for row in mine),
        "of": found["faults"],
        "false_alarms": float(np.mean(told)) if told else None,
        "leads": found["leads"],
    }
