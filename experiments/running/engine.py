"""Run what is missing of a plan, on processes or any executor; rows as they come.

One path for all: a study, a run (a study without axes), what `compare`, `tune` and `tradeoff` ask
for. In a folder the rows outlive a kill and are not run again; without one they are only given.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.consent import require
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.running import rows
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.dispatch import spread
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.folder import check_code, opened
from flexaxis.experiments.running.plan import Plan, make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.traces import write_traces
from flexaxis.experiments.running.trajectories import keep_all, keep_worst
from flexaxis.experiments.running.units import Unit
from flexaxis.experiments.running.work import Outcome, Row, run_unit
from flexaxis.sim.scenario import Scenario

Keep = Literal["none", "worst", "all"]
Worker = Callable[[Unit], Outcome]
Runs = list[list[Row]]
"""Rows of an estimator on a scenario: a list a seed, in their order, with a row a parameter."""


@dataclass(frozen=True)
class Means:
    """With what cases are run.

    Attributes
    ----------
    jobs : int
        Processes; one stays in this process.
    executor : concurrent.futures.Executor, optional
        Where to work instead, for example that of a Dask client.
    in_flight : int, optional
        Units that are handed out at a time; twice the jobs by default.
    store : RecordCache, optional
        Where records are kept; without one every record is simulated.
    advance : callable, optional
        Called with each outcome, after its rows are written.
    work : callable, optional
        Stands in for `run_unit`, from unit to outcome.
    """

    jobs: int = 1
    executor: Executor | None = None
    in_flight: int | None = None
    store: RecordCache | None = None
    advance: Callable[[Outcome], None] | None = None
    work: Worker | None = None

    def also(self, called: Callable[[Outcome], None]) -> Means:
        """Return the same means, with something else called with each outcome, too."""
        before = self.advance

        def both(outcome: Outcome) -> None:
            called(outcome)
            if before:
                before(outcome)

        return replace(self, advance=both)

    def outcomes(
        self, plan: Plan, done: Any = None, *, whole: bool = False, traced: bool = False
    ) -> Generator[Outcome, None, None]:
        """Yield the outcomes of what is missing of a plan."""
        work = self.work or partial(run_unit, store=self.store, whole=whole, traced=traced)
        return spread(
            plan.units(done), work, jobs=self.jobs, executor=self.executor,
            in_flight=self.in_flight,
        )  # fmt: skip


@dataclass(frozen=True)
class Finished:
    """What a call of `run_study` did.

    Attributes
    ----------
    cases : int
        Cases run by this call; those that were there before are not run again.
    failed : int
        How many of them could not be run; their rows say why.
    simulated : int
        Records that were simulated for them.
    """

    cases: int
    failed: int
    simulated: int = 0


def run_study(
    study: Study | Plan,
    folder: Path | str,
    means: Means | None = None,
    *,
    resume: bool = False,
    replace: bool = False,
    keep: Keep = "none",
    traced: bool = False,
    run_code: bool = False,
    about: Mapping[str, Any] | None = None,
    then: Callable[[], object] | None = None,
) -> Finished:
    """Run what is missing of a study and append its rows to a folder.

    Parameters
    ----------
    study : Study or Plan
        As from `load_study`; a plan from `make_plan` where only a share is to be run.
    folder : Path or str
        Made if it is missing.
    means : Means, optional
        With what: one process and no cache by default.
    resume, replace, about
        As for `flexaxis.experiments.running.folder.opened`.
    keep : {"none", "worst", "all"}
        Whose estimates to write to the folder `trajectories`: nobody's, those of the worst case
        of each estimator at each point, or everyone's.
    traced : bool
        Whether to keep what the figures of a run are drawn from.
    run_code : bool
        Whether estimators may name code (`path.py:Class`, `module:Class`, `pipe:COMMAND`), which
        is then run, here or wherever the executor works.
    then : callable, optional
        Called when all is run, while nobody else may work in the folder.

    Raises
    ------
    CodeRefused
        If they do, and may not.
    StudyError
        If the study is wrong, the folder is in use or holds something else, or a worker dies
        again and again.
    OutputError
        If rows cannot be written. Those that were stay, and `resume` goes on.
    """
    folder = Path(folder)
    whole = study.study if isinstance(study, Plan) else study
    require(run_code, whole.estimators, source=whole.name)
    plan = study if isinstance(study, Plan) else make_plan(study, run_code=run_code)
    means = means or Means()
    cases = failed = simulated = 0
    with opened(plan, folder, resume=resume, replace=replace, about=about) as path:
        with rows.RowFile(path) as file:
            outcomes = means.outcomes(plan, rows.done(folder), whole=keep == "all", traced=traced)
            with closing(outcomes):
                for outcome in outcomes:
                    _write(folder, file, outcome)
                    cases, failed = cases + outcome.cases, failed + outcome.failed
                    simulated += outcome.simulated
                    if means.advance:
                        means.advance(outcome)
        if keep == "worst":
            keep_worst(folder, plan)
        if then:
            then()
    return Finished(cases, failed, simulated)


def _write(folder: Path, file: rows.RowFile, outcome: Outcome) -> None:
    # First what goes with the rows: a case that has rows has it.
    keep_all(folder, outcome.kept)
    write_traces(folder, outcome.traces)
    file.append(outcome.lines)


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
            _write(self._folder, self._file, outcome)
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
