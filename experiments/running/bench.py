"""Where cases are run that are asked for bit by bit, each once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any, Self

import pandas as pd

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.running.engine import Means, tell_kept
from flexaxis.experiments.running.folder import opened
from flexaxis.experiments.running.plan import Plan, make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.work import Row
from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.storage.store import Store
from flexaxis.sim.scenario import Scenario

Runs = list[list[Row]]
"""Rows of an estimator on a scenario: a list a seed, in their order, with a row a parameter."""


Run = Callable[[Sequence[Scenario], Sequence[str], Sequence[int]], pd.DataFrame]
"""``run(scenarios, estimators, seeds)``: the rows of these cases as a flat table, one a parameter;
those of a case that failed are of a lost run, and say why in ``error``."""


class Bench:
    """Where cases are run that are asked for bit by bit, as a search or a comparison does.

    Each case is run once. A context manager.

    Parameters
    ----------
    scenarios : sequence of Scenario
        All that will be asked for.
    folder : Path, optional
        Where the rows are kept, and found again; else they are in memory.
    means : Means, optional
    overwrite, about
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
        overwrite: bool = False,
        about: Mapping[str, Any] | None = None,
        repeat: int = 0,
        traced: bool = False,
    ) -> None:
        self._study = Study("cases", tuple(scenarios), (), ())
        self._folder, self._means = folder, means or Means()
        self._how: dict[str, Any] = {"overwrite": overwrite, "about": about}
        self._repeat, self._traced = repeat, traced and folder is not None
        self._store = Store(None) if folder is None else None
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        """Take the folder."""
        if self._folder is not None:
            self._store = self._stack.enter_context(
                opened(make_plan(self._study), self._folder, **self._how)
            )
            tell_kept(self._folder)
        return self

    def __exit__(self, *error: object) -> None:
        """Leave the folder."""
        self._stack.close()

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
        found = self.with_failed(scenarios, estimators, seeds)
        check_failures(row for runs in found.values() for run in runs for row in run)
        return found

    def with_failed(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the same with the cases that failed: their rows are of lost runs."""
        if self._store is None:
            raise ValueError("a Bench with a folder takes it by `with Bench(…) as bench:`")
        study = Study("cases", tuple(scenarios), tuple(dict.fromkeys(estimators)), tuple(seeds))
        plan = make_plan(study, repeat=self._repeat, run_code=True)
        done = self._store.done(plan.codes)
        with closing(self._means.outcomes(plan, done, traced=self._traced)) as outcomes:
            for outcome in outcomes:
                self._store.add(outcome.rows, outcome.traces)
                if self._means.advance:
                    self._means.advance(outcome)
        return {
            (s.hash, e): self._known(s.hash, e, plan) for s in scenarios for e in study.estimators
        }

    def frame(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> pd.DataFrame:
        """Return the same as a flat table: tables in rows become columns with dotted names."""
        cases = self.with_failed(scenarios, estimators, seeds).values()
        return pd.json_normalize([row for runs in cases for run in runs for row in run])

    def _known(self, key: str, estimator: str, plan: Plan) -> Runs:
        assert self._store is not None
        runs: dict[int, list[Row]] = {seed: [] for seed in plan.study.seeds}
        for row in self._store.rows(key, estimator, plan.codes[estimator]):
            if row["seed"] in runs:
                runs[row["seed"]].append(row)
        return list(runs.values())


def check_failures(found: Iterable[Mapping[str, Any]]) -> None:
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
