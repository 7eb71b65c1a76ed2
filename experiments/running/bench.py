"""Where cases are run that are asked for bit by bit, each once."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.running import rows
from flexaxis.experiments.running.engine import Means, write_outcome
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.folder import check_code, opened
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.work import Outcome, Row
from flexaxis.sim.scenario import Scenario

Runs = list[list[Row]]
"""Rows of an estimator on a scenario: a list a seed, in their order, with a row a parameter."""


class Bench:
    """Where cases are run that are asked for bit by bit, as a search or a comparison does.

    Each case is run once. A context manager; with a folder, that is taken for as long.

    Parameters
    ----------
    scenarios : sequence of Scenario
        All that will be asked for.
    folder : Path, optional
        Where the rows are kept, and found again.
    means : Means, optional
    resume, replace, about
        As for `flexaxis.experiments.running.folder.opened`.
    repeat : int
        As in `flexaxis.sim.simulate.simulate`; such rows are in no folder.
    traced : bool
        Whether to keep what figures are drawn from; only in a folder.
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        folder: Path | None = None,
        means: Means | None = None,
        *,
        resume: bool = False,
        replace: bool = False,
        about: Mapping[str, Any] | None = None,
        repeat: int = 0,
        traced: bool = False,
    ) -> None:
        self._study = Study("cases", tuple(scenarios), (), ())
        self._folder, self._means = folder, means or Means()
        self._how: dict[str, Any] = {"resume": resume, "replace": replace, "about": about}
        self._repeat, self._traced = repeat, traced and folder is not None
        self._known: dict[tuple[str, str], dict[int, list[Row]]] = defaultdict(dict)
        self._file: rows.RowFile | None = None
        self._stack = ExitStack()

    def __enter__(self) -> Bench:
        """Take the folder, and read what it holds."""
        if self._folder is not None:
            with ExitStack() as stack:
                self._file = stack.enter_context(self._opened(self._folder))
                self._stack = stack.pop_all()  # kept, where nothing went wrong
        return self

    @contextmanager
    def _opened(self, folder: Path) -> Iterator[rows.RowFile]:
        with opened(make_plan(self._study), folder, **self._how) as path:
            for row in (r for file in rows.row_files(folder) for r in rows.read(file)):
                check_code(row["estimator"], row.get("code"), folder)
                self._learn(row)
            with rows.RowFile(path) as file:
                yield file

    def __exit__(self, *error: object) -> None:
        """Leave the folder to others."""
        self._stack.close()

    @property
    def cases(self) -> int:
        """Number of cases that are known."""
        return sum(map(len, self._known.values()))

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the rows of some cases, by hash of the scenario and text of the estimator.

        Raises
        ------
        EstimatorError, EstimatorCrash
            If an estimator cannot be made, or fails on a record; the others are run before.
        StudyError
            As from `run_study`.
        """
        if self._folder is not None and self._file is None:
            raise ValueError("a Bench with a folder takes it by `with Bench(…) as bench:`")
        study = Study("cases", tuple(scenarios), tuple(dict.fromkeys(estimators)), tuple(seeds))
        plan = make_plan(study, repeat=self._repeat, run_code=True)
        with closing(self._means.outcomes(plan, self._done(), traced=self._traced)) as outcomes:
            for outcome in outcomes:
                self._take(outcome)
        found = {
            (s.hash, e): [self._known[s.hash, e][seed] for seed in study.seeds]
            for s in scenarios
            for e in study.estimators
        }
        check_failures(row for runs in found.values() for run in runs for row in run)
        return found

    def _take(self, outcome: Outcome) -> None:
        if self._file is not None:
            assert self._folder is not None
            write_outcome(self._folder, self._file, outcome)
        for line in outcome.lines.splitlines():
            self._learn(json.loads(line))
        if self._means.advance:
            self._means.advance(outcome)

    def _learn(self, row: Row) -> None:
        runs = self._known[row["hash"], row["estimator"]]
        if row["seed"] not in runs or runs[row["seed"]][0]["parameter"] == row["parameter"]:
            runs[row["seed"]] = []
        runs[row["seed"]].append(row)

    def _done(self) -> Any:
        ids = [int(run[0]["case"], 16) for runs in self._known.values() for run in runs.values()]
        return np.unique(np.array(ids, np.uint64))


def check_failures(found: Iterable[Row]) -> None:
    """Raise what the first of some rows that has failed says.

    Raises
    ------
    EstimatorCrash
        If the code of an estimator raised something.
    EstimatorError, StudyError
        If an estimator refused to run, or a simulation failed.
    """
    failed = next((row["error"] for row in found if row["error"] is not None), None)
    if failed is None:
        return
    kind, _, text = failed.partition(": ")
    kinds = {"EstimatorCrash": EstimatorCrash, "EstimatorError": EstimatorError}
    raise kinds.get(kind, StudyError)(text)
