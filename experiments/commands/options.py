"""Options that commands which run cases have in common, and what they say on the way."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.commands.answers import CRASH, FINDING, say
from flexaxis.experiments.files import NotRun, optional_package
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.running.run import Runner

RESUME, OVERWRITE = "--resume", "--overwrite"


def add_jobs(parser: Any, *, what: str = "the scores do") -> None:
    """Declare --jobs."""
    parser.add_argument(
        "--jobs",
        type=int,
        # As text: argparse takes what is the default itself, a small number, for not typed, and so
        # would not see that it excludes another option.
        default=str(os.cpu_count() or 1),
        metavar="N",
        help=f"processes (default: one a core); {what} not depend on it",
    )


def add_time_limit(parser: argparse.ArgumentParser) -> None:
    """Declare --time-limit."""
    parser.add_argument(
        "--time-limit", type=float, metavar="S",
        help="how long code of your own may take for one run [s] (default 600)",
    )  # fmt: skip


def add_resume(parser: argparse.ArgumentParser) -> None:
    """Declare --overwrite, and --resume."""
    removal = parser.add_mutually_exclusive_group()
    removal.add_argument(
        OVERWRITE,
        action="store_true",
        help="remove what DIR holds first (default: keep it, and run what is missing)",
    )
    removal.add_argument(RESUME, action="store_true", help="go on with what DIR holds: the default")


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Declare where to work and what share of it: processes here, a cluster, a part of many."""
    where = parser.add_mutually_exclusive_group()
    add_jobs(where, what="the rows do")
    where.add_argument("--dask", metavar="ADDRESS", help="scheduler of a Dask cluster that runs")
    parser.add_argument(
        "--shard", metavar="I/N", help="run only the I-th of N shards; --from puts them together"
    )
    add_resume(parser)
    add_time_limit(parser)


def add_from(parser: argparse.ArgumentParser) -> None:
    """Declare --from."""
    parser.add_argument(
        "--from", dest="shards", nargs="+", type=Path, metavar="DIR",
        help="put finished shards together in the folder of -o, each case once, and report",
    )  # fmt: skip


def merge_shards(args: argparse.Namespace) -> int:
    """Put shards together and report; exit with 1 if runs are missing from all of them."""
    from flexaxis.experiments.commands.answers import answer
    from flexaxis.experiments.files import check_not_input
    from flexaxis.experiments.running.results import Results
    from flexaxis.experiments.running.run import Runner
    from flexaxis.experiments.studies.benchmark import report

    if args.output is None:
        raise FlexaxisError("--from: name the folder of the whole with -o DIR")
    check_not_input(args.shards, args.output)
    with Runner(args.output, jobs=int(args.jobs), overwrite=args.overwrite) as runner:
        total = sum(runner.store.take(folder) for folder in args.shards)
        results = Results.load(args.output)
        cases, study = results.cases, results.study
        missing = len(study["variants"]) * len(study["seeds"]) - cases
        path = report(args.output, runner)
    if missing:
        say(f"{missing} of {cases + missing} cases are in no shard")
    content: dict[str, object] = {"cases": cases, "doubles": max(0, total - cases)}
    content |= {"missing": missing, "folder": args.output, "report": path}
    count = f"{cases} cases; {max(0, total - cases)} were in more than one shard"
    return answer(args, content, FINDING if missing else 0, count, path)


def line(args: argparse.Namespace, *more: str, whole: bool = False) -> str:
    """Return the line that was typed, without what says what becomes of what is there.

    A `whole` one is without what asks for a part of the work only.
    """
    words = [word for word in args.words if word not in {RESUME, OVERWRITE}]
    if whole and "--shard" in words:
        place = words.index("--shard")
        del words[place : place + 2]
    words = [word for word in words if not (whole and word.startswith("--shard="))]
    return shlex.join(["flexaxis", *words, *more])


def add_cache(parser: argparse.ArgumentParser, *, default: bool) -> None:
    """Declare --cache and --no-cache."""
    parser.add_argument(
        "--cache",
        action=argparse.BooleanOptionalAction,
        default=default,
        help="keep simulated records for the next run that needs them, or "
        f"simulate all and keep none (default: --{'' if default else 'no-'}cache)",
    )


def check_jobs(args: argparse.Namespace) -> None:
    """Refuse a number of processes that is none."""
    from flexaxis.experiments.seeds import check_jobs

    if args.jobs is not None:
        check_jobs(args.jobs, what="--jobs")


def shard(args: argparse.Namespace) -> tuple[int, int]:
    """Return which share is to be run, of how many."""
    if args.shard is None:
        return 1, 1
    mine, _, shares = args.shard.partition("/")
    if not (mine.isdigit() and shares.isdigit() and 1 <= int(mine) <= int(shares)):
        raise FlexaxisError(f"--shard {args.shard!r}: give I/N with I from 1 to N, such as 3/100")
    return int(mine), int(shares)


def check_dask(args: argparse.Namespace) -> None:
    """Refuse a cluster where its client is not installed."""
    from importlib.util import find_spec

    if find_spec("distributed") is None:
        raise FlexaxisError(
            f"--dask {args.dask}: this needs distributed: python -m pip install distributed"
        )


def executor(args: argparse.Namespace, stack: ExitStack) -> tuple[Any, int]:
    """Return where to work, None for processes of our own, and how many work there."""
    if getattr(args, "dask", None) is None:
        return None, args.jobs

    distributed = optional_package("distributed")
    try:
        client = stack.enter_context(distributed.Client(args.dask, timeout=10))
    except (OSError, ValueError) as error:
        raise FlexaxisError(f"--dask {args.dask}: no scheduler answers there: {error}") from error
    workers = sum(client.nthreads().values())
    if not workers:
        raise FlexaxisError(f"--dask {args.dask}: the cluster has no workers yet")
    return client.get_executor(retries=2), workers


@contextmanager
def working(
    args: argparse.Namespace, what: str, total: float, folder: Path | None = None, *,
    cache: bool = True, by_case: bool = True,
) -> Iterator[tuple[Runner, Callable[[float], object]]]:  # fmt: skip
    """Give a runner with progress, and say how to resume if it is stopped.

    Parameters
    ----------
    args : argparse.Namespace
        With `jobs`, and `words` as typed.
    what : str
        What is done, for the progress.
    total : float
        How much of it there is.
    folder : Path, optional
        Where the rows are kept.
    cache : bool
        Whether records are kept.
    by_case : bool
        Whether progress is that of the cases.

    Yields
    ------
    Runner
    callable
        To be called with what is done besides cases.
    """
    from flexaxis._results import remarks_in_words
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.running.run import Runner

    with ExitStack() as stack:
        place, jobs = executor(args, stack)
        advance = stack.enter_context(progress(what, total))
        runner = stack.enter_context(Runner(
            folder, jobs=int(jobs or os.cpu_count() or 1), executor=place,
            cache=default_cache() if cache else None, overwrite=args.overwrite,
            time_limit=getattr(args, "time_limit", None), advance=advance if by_case else None,
        ))  # fmt: skip
        try:
            yield runner, advance
        except FlexaxisError as error:
            if not runner.done:
                raise
            kind = NotRun if isinstance(error, NotRun) else FlexaxisError
            raise kind(f"{error}\n{go_on(args, runner.done)}") from error
        finally:
            args.remarks += runner.remarks
            for text in remarks_in_words(runner.remarks):
                say(text)


def go_on(args: argparse.Namespace, done: int) -> str:
    """Return how many cases were just run, and the line that goes on from there."""
    kept = f"{done} case{'s'[: done != 1]} done just now"
    return f"{kept}; go on with: {line(args, RESUME)}"


def tell_failures(failures: Sequence[Mapping[str, Any]]) -> None:
    """Say on stderr which estimators failed where, and why: each kind of failure once."""
    from flexaxis.experiments.reporting.words import failures_in_words as in_words

    for text, count in in_words(failures):
        say(f"{text} (and {count - 1} like it)" if count > 1 else text)
    if failures:
        cases = "1 case" if len(failures) == 1 else f"{len(failures)} cases"
        say(f"{cases} could not be run: `error` in the rows says why")


def failed(failures: Sequence[Mapping[str, Any]], remarks: Sequence[tuple[str, str]] = ()) -> int:
    """Return the exit status where some cases could not be run: 70 if code crashed, else 1.

    It is 1 as well where a user's estimator returned what is not finite.
    """
    crashed = any(row["error"].startswith("EstimatorCrash") for row in failures)
    return CRASH if crashed else FINDING if failures or remarks else 0
