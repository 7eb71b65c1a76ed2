"""What the rows of an entry come to, from its files alone: at equal noise, and as set."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.running.bench import Bench, Runs
from flexaxis.experiments.running.rows import read, row_files
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.experiments.studies.sweep import again, reference
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Row = dict[str, Any]


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

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows: dict[tuple[str, str], dict[int, list[Row]]] = defaultdict(
            lambda: defaultdict(list)
        )
        for row in rows:
            self._rows[row["hash"], row["estimator"]][row["seed"]].append(row)

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return rows as `Bench.runs` does.

        Raises
        ------
        EntryError
            If there are none of a case, or they say that it could not be run.
        """
        found: dict[tuple[str, str], Runs] = {}
        for scenario in scenarios:
            for text in dict.fromkeys(estimators):
                own = self._rows.get((scenario.hash, text), {})
                lacks = [seed for seed in seeds if not own.get(seed)]
                if lacks:
                    raise EntryError(
                        f"{scenario.name}, {text}: no rows of {len(lacks)} of {len(seeds)} seeds"
                    )
                if any(len(own[seed]) != own[seed][0]["rows"] for seed in seeds):
                    raise EntryError(f"{scenario.name}, {text}: rows of a run twice, or not all")
                found[scenario.hash, text] = [own[seed] for seed in seeds]
                if any(rows[0]["error"] is not None for rows in found[scenario.hash, text]):
                    raise EntryError(f"{scenario.name}, {text}: a run has failed")
        return found


def own(entry: Entry, board: Board) -> Own:
    """Return what the rows of an entry come to.

    Raises
    ------
    EntryError
        If they are not all there, or not what rows are.
    """
    try:
        rows = [row for file in row_files(entry.run) for row in read(file)]
        return own_of(rows, entry.label, entry.estimator, entry.settings, board)
    except EntryError as error:
        raise EntryError(*(f"{entry.folder}: {problem}" for problem in error.problems)) from error
    except FlexaxisError as error:
        raise EntryError(str(error)) from error
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise EntryError(f"{entry.folder}: its rows cannot be pooled: {error!r}") from error


def own_of(
    rows: Sequence[Row],
    label: str,
    estimator: str,
    settings: Mapping[str, Mapping[str, float]],
    board: Board,
) -> Own:
    """Return what some rows come to, as `own` does."""
    bench = Stored(rows)
    faults = [s for s in board.faults if s.name in settings]
    calm = [s for s in board.nuisances if s.name in settings]
    lines = {s.name: {label: dict(settings[s.name])} for s in faults}
    found = again(faults, lines, board.seeds, bench) if faults else []
    as_set, lost, runs = [], 0, 0
    for scenario in [*faults, *calm]:
        text = next((t for t, turn in settings[scenario.name].items() if turn == 1), estimator)
        each = bench.runs([scenario], [text], board.seeds)[scenario.hash, text]
        lost += sum(bool(run[0]["diverged"]) for run in each)
        runs += len(each)
        if scenario in calm:
            as_set.append(_as_set(scenario, label, each))
    return Own(found, as_set, lost, runs)


def _as_set(scenario: Scenario, label: str, runs: Runs) -> Row:
    """Return what an estimator is worth on the nuisance track, at its one setting."""
    excess = [float(run[0]["excess"]) for run in runs]
    logs = np.log(np.maximum(excess, FLOOR))
    return {
        "scenario": scenario.name,
        "estimator": label,
        "seeds": len(runs),
        "excess": float(np.exp(logs.mean())),
        "false_alarms_per_1000_s": _rate(runs, "false_alarms_per_1000_s"),
        "lost": sum(bool(run[0]["diverged"]) for run in runs),
        "values": {"excess": [float(f"{value:.6g}") for value in logs]},
    }


def _rate(runs: Runs, key: str) -> float | None:
    """Return the mean of what the detection says, None of an estimator that finds nothing."""
    found = [run[0]["detection"] for run in runs]
    get: Callable[[Row], float] = lambda each: float(each[key])  # noqa: E731
    return None if None in found else float(np.mean([get(each) for each in found]))


__all__ = ["Own", "Stored", "own", "own_of", "reference"]
