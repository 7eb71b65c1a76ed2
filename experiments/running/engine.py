"""Run what is missing of a plan, on processes or any executor; rows as they come.

One path for all: a study, a run (a study without axes), what `compare`, `tune` and `tradeoff` ask
for. In a folder the rows outlive a kill and are not run again; without one they are only given.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from flexaxis.experiments.building.code import require
from flexaxis.experiments.building.guest import limited
from flexaxis.experiments.building.guest import time_limit as limit
from flexaxis.experiments.building.processes import Workers, spread
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.estimate import keep_all
from flexaxis.experiments.running.folder import cases as all_cases
from flexaxis.experiments.running.folder import done, opened
from flexaxis.experiments.running.plan import Plan, make_plan
from flexaxis.experiments.running.progress import progress, remark
from flexaxis.experiments.running.study import Study, Unit
from flexaxis.experiments.running.work import Outcome, run_unit
from flexaxis.experiments.storage.files import NotRun

Worker = Callable[[Unit], Outcome]


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
    workers : Workers, optional
        Processes to be used by one call after the other, as from `kept`.
    """

    jobs: int = 1
    executor: Executor | None = None
    in_flight: int | None = None
    store: RecordCache | None = None
    advance: Callable[[Outcome], None] | None = None
    work: Worker | None = None
    workers: Workers | None = None

    @contextmanager
    def kept(self) -> Iterator[Means]:
        """Give the same means, with processes that all calls inside share."""
        if self.jobs == 1 or self.executor is not None or self.workers is not None:
            yield self
            return
        with Workers(self.jobs) as workers:
            yield replace(self, workers=workers)

    def also(self, called: Callable[[Outcome], None]) -> Means:
        """Return the same means, with something else called with each outcome, too."""
        before = self.advance

        def both(outcome: Outcome) -> None:
            called(outcome)
            if before:
                before(outcome)

        return replace(self, advance=both)

    @contextmanager
    def shown(
        self, what: str, total: float, heard: Callable[[Outcome], None], *,
        time_limit: float | None = None, by_case: bool = True,
    ) -> Iterator[tuple[Means, Callable[[float], None]]]:  # fmt: skip
        """Give the means as from `kept`, with progress, and what is called with other progress.

        Parameters
        ----------
        what : str
            What is done.
        total : float
            How much of it there is.
        heard : callable
            Called with each outcome.
        time_limit : float, optional
            How long code of a user may take for one run [s].
        by_case : bool
            Whether progress is that of the cases.
        """
        with limited(time_limit), progress(what, total or 1) as advance:

            def landed(outcome: Outcome) -> None:
                heard(outcome)
                if by_case:
                    advance(outcome.cases)

            with self.also(landed).kept() as means:
                yield means, advance

    def outcomes(
        self, plan: Plan, done: Any = None, *, whole: bool = False, traced: bool = False
    ) -> Generator[Outcome, None, None]:
        """Yield the outcomes of what is missing of a plan.

        Raises
        ------
        NotRun
            If cases are missing at the end though nobody has stopped the work.
        """
        work = self.work or partial(
            run_unit, store=self.store, whole=whole, traced=traced, time_limit=limit()
        )
        wanted = found = 0
        missing: list[str] = []

        def units() -> Iterator[Unit]:
            nonlocal wanted
            for unit in plan.units(done):
                wanted += unit.cases
                yield unit

        jobs = self.jobs if self.jobs > 1 else 0
        own = self.workers if jobs else None
        with closing(
            spread(
                units(), work, jobs=jobs, executor=self.executor, in_flight=self.in_flight,
                workers=own,
            )
        ) as outcomes:  # fmt: skip
            for outcome in outcomes:
                found += outcome.cases
                missing += outcome.missing
                yield outcome
        if found != wanted:
            why = missing[0] if missing else "nothing says why: please report this"
            raise NotRun(
                f"{wanted - found} of {wanted} cases were not run: {why}. What is done is kept, "
                "and the same line goes on"
            )


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
    overwrite: bool = False,
    keep: Literal["none", "all"] = "none",
    traced: bool = False,
    run_code: bool = False,
    about: Mapping[str, Any] | None = None,
) -> Finished:
    """Run what is missing of a study and add its rows to a folder.

    Parameters
    ----------
    study : Study or Plan
        As from `load_study`; a plan from `make_plan` where only a share is to be run.
    folder : Path or str
        Made if it is missing.
    means : Means, optional
        With what: one process and no cache by default.
    overwrite, about
        As for `flexaxis.experiments.running.folder.opened`.
    keep : {"none", "all"}
        Whose estimates to write to the folder `trajectories`: nobody's, or everyone's.
    traced : bool
        Whether to keep what the figures of a run are drawn from.
    run_code : bool
        Whether estimators may name code (`path.py:Class`, `module:Class`, `pipe:COMMAND`), which
        is then run, here or wherever the executor works.

    Raises
    ------
    CodeRefused
        If they do, and may not.
    StudyError
        If the study is wrong, or does not go with what is in the folder.
    OutputError
        If rows cannot be written. Those that were stay, and the same call goes on.
    """
    folder = Path(folder)
    whole = study.study if isinstance(study, Plan) else study
    require(run_code, whole.estimators, source=whole.name)
    plan = study if isinstance(study, Plan) else make_plan(study, run_code=run_code)
    means = means or Means()
    cases = failed = simulated = 0
    with opened(plan, folder, overwrite=overwrite, about=about) as store:
        there = done(folder, plan)
        tell_kept(folder, plan.work(there).cases)
        outcomes = means.outcomes(plan, there, whole=keep == "all", traced=traced)
        with closing(outcomes):
            for outcome in outcomes:
                keep_all(folder, outcome.kept)  # first: a case that has rows has it
                store.add(outcome.rows, outcome.traces)
                cases, failed = cases + outcome.cases, failed + outcome.failed
                simulated += outcome.simulated
                if means.advance:
                    means.advance(outcome)
    return Finished(cases, failed, simulated)


def tell_kept(folder: Path, missing: int | None = None) -> None:
    """Say how many cases a folder holds, and how many more are to be run."""
    if there := all_cases(folder):
        more = "" if missing is None else f"; {missing} of those asked for are still to be run"
        remark(f"{folder}: {there} case{'s'[: there != 1]} there, and kept{more}")
