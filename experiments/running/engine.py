"""Run a study: whatever is missing in its folder, on any executor, rows as they come."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

from flexaxis.experiments.running import rows
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.running.consent import require
from flexaxis.experiments.running.dispatch import Worker, spread
from flexaxis.experiments.running.folder import opened
from flexaxis.experiments.running.plan import Plan, make_plan
from flexaxis.experiments.running.trajectories import keep_all, keep_worst
from flexaxis.experiments.running.work import Outcome, run_unit
from flexaxis.experiments.studies.definition import Study

Keep = Literal["none", "worst", "all"]


@dataclass(frozen=True)
class Finished:
    """What a call of `run_study` did.

    Attributes
    ----------
    cases : int
        Cases run by this call; those that were there before are not run again.
    failed : int
        How many of them could not be run; their rows say why.
    """

    cases: int
    failed: int


def run_study(
    study: Study | Plan,
    folder: Path,
    executor: Executor | None = None,
    *,
    jobs: int = 1,
    in_flight: int | None = None,
    resume: bool = False,
    keep: Keep = "none",
    store: RecordCache | None = None,
    advance: Callable[[Outcome], None] | None = None,
    work: Worker | None = None,
    run_code: bool = False,
) -> Finished:
    """Run what is missing of a study and append its rows to a folder.

    Parameters
    ----------
    study : Study or Plan
        As from `load_study`; a plan from `make_plan` where only a share is to be run.
    folder : Path
        Made if it is missing.
    executor : concurrent.futures.Executor, optional
        Where to work, for example that of a Dask client; else in `jobs` processes here.
    jobs : int
        Processes; one stays in this process.
    in_flight : int, optional
        Units that an executor is given at a time; twice the jobs by default.
    resume : bool
        Whether rows may be there already.
    keep : {"none", "worst", "all"}
        Whose estimates to write to the folder `trajectories`: nobody's, those of the worst case
        of each estimator at each point, or everyone's.
    store : RecordCache, optional
        Where records are kept; without one every record is simulated.
    advance : callable, optional
        Called with each outcome, after its rows are written.
    work : callable, optional
        Stands in for `run_unit`, from unit to outcome.
    run_code : bool
        Whether estimators may name code (`path.py:Class`, `module:Class`, `pipe:COMMAND`), which
        is then run, here or wherever the executor works.

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
    whole = study.study if isinstance(study, Plan) else study
    require(run_code, whole.estimators, source=whole.name)
    plan = study if isinstance(study, Plan) else make_plan(study, run_code=run_code)
    work = work or partial(run_unit, store=store, whole=keep == "all")
    cases = failed = 0
    with opened(plan.study, folder, shard=plan.shard, resume=resume) as path:
        with rows.RowFile(path) as file:
            units = plan.units(rows.done(folder))
            for outcome in spread(units, work, jobs=jobs, executor=executor, in_flight=in_flight):
                keep_all(folder, outcome.kept)  # first: a case that has rows has its estimates
                file.append(outcome.lines)
                cases, failed = cases + outcome.cases, failed + outcome.failed
                if advance:
                    advance(outcome)
        if keep == "worst":
            keep_worst(folder, plan)
    return Finished(cases, failed)
