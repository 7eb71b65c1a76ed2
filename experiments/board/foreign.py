"""Whether the rows of an entry are those of its suite: no other scenario, seed or estimator."""

from __future__ import annotations

from collections.abc import Iterator

from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.running.rows import read, row_files
from flexaxis.experiments.studies.sweep import reference
from flexaxis.sim.reading import shown


def foreign(entry: Entry, board: Board) -> Iterator[str]:
    """Yield what is wrong with rows: what nobody ranks would only change what is compared with.

    Rows of a run that failed, such as those of a knob that turns no further, rank nothing.
    """
    names = {scenario.hash: scenario.name for scenario in board.scenarios}
    seeds, seen = {*board.seeds}, set()
    for file in row_files(entry.run):
        for row in read(file):
            key = (row["hash"], row["estimator"], row["seed"], row["parameter"])
            what = f"{shown(row['scenario'])}, {shown(row['estimator'])}, seed {row['seed']!r}"
            own = str(row["estimator"]).startswith(entry.estimator)
            if names.get(row["hash"]) != row["scenario"]:
                yield f"{what}: no scenario of the suite has this name and this hash"
            elif type(row["seed"]) is not int or row["seed"] not in seeds:
                yield f"{what}: no seed of the suite"
            elif not (own or row["estimator"] == reference()):
                yield f"{what}: neither the estimator nor the reference"
            elif key in seen and row["error"] is None:
                yield f"{what}: a row twice"
            seen.add(key)
