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
from flexaxis.experiments.storage.files import NotRun, needed
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.building.guest import Remark
    from flexaxis.experiments.running.engine import Means

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
        "--shard", metavar="I/N", help="run only the I-th of N shares, to a file of rows of its own"
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
    from flexaxis.experiments.running.merge import merge
    from flexaxis.experiments.storage.files import spare
    from flexaxis.experiments.studies.benchmark import report

    if args.output is None:
        raise FlexaxisError("--from: name the folder of the whole with -o DIR")
    spare(args.shards, args.output)
    merged = merge(args.shards, args.output)
    path = report(args.output)
    if merged.makers[1:]:
        say("the shards were run with different versions:\n" + "\n".join(merged.makers))
    if merged.missing is None:
        say("the shards have different estimators or seeds, so missing runs cannot be counted")
    if merged.missing:
        say(f"{merged.missing} of {merged.cases + merged.missing} cases are in no shard")
    content: dict[str, object] = {"cases": merged.cases, "doubles": merged.doubles}
    content |= {"missing": merged.missing, "folder": args.output, "report": path}
    count = f"{merged.cases} cases; {merged.doubles} were in more than one shard"
    return answer(args, content, FINDING if merged.missing else 0, count, path)


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
    from flexaxis.experiments.building.processes import check_jobs

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
    if args.dask is None:
        return None, args.jobs

    distributed = needed("distributed")
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
    args: argparse.Namespace,
    what: str,
    total: float,
    *,
    cache: bool = True,
    by_case: bool = True,
    place: tuple[Any, int] | None = None,
) -> Iterator[tuple[Means, Callable[[float], None]]]:
    """Give the means to run cases, with progress, and say how to go on where that is stopped.

    Parameters
    ----------
    args : argparse.Namespace
        With `jobs`, and `words` as typed.
    what : str
        What is done, for the progress.
    total : float
        How much of it there is.
    cache : bool
        Whether records are kept.
    by_case : bool
        Whether progress is that of the cases.
    place : (executor, int), optional
        As from `executor`.

    Yields
    ------
    Means
    callable
        To be called with what is done besides cases.
    """
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.engine import Means

    elsewhere, workers = place or (None, args.jobs or os.cpu_count() or 1)
    done, remarks = 0, args.remarks

    def heard(outcome: Any) -> None:
        nonlocal done
        done += outcome.cases
        remarks.extend(outcome.remarks)

    means = Means(
        jobs=1 if elsewhere else workers, executor=elsewhere, in_flight=2 * workers,
        store=default_cache() if cache else None,
    )  # fmt: skip
    limit = getattr(args, "time_limit", None)
    with telling(remarks):
        try:
            with means.shown(what, total, heard, time_limit=limit, by_case=by_case) as both:
                yield both
        except KeyboardInterrupt:
            raise KeyboardInterrupt(go_on(args, done)) from None
        except FlexaxisError as error:
            if done:
                kind = NotRun if isinstance(error, NotRun) else FlexaxisError
                raise kind(f"{error}\n{go_on(args, done)}") from error
            raise


@contextmanager
def telling(remarks: Sequence[Remark]) -> Iterator[None]:
    """Say on stderr, in the end, what there is to be known of users' code."""
    from flexaxis.experiments.building.guest import in_words

    try:
        yield
    finally:
        for text in in_words(remarks):
            say(text)


def go_on(args: argparse.Namespace, done: int) -> str:
    """Return how many cases were just run, and the line that goes on from there."""
    kept = f"{done} case{'s'[: done != 1]} done just now"
    return f"{kept}; go on with: {line(args, RESUME)}"


def leave_out(scenarios: Sequence[Any], estimators: Sequence[str]) -> list[Any]:
    """Return the scenarios that all estimators can read; which are left out is said on stderr."""
    from flexaxis.experiments.building.ready import readable

    kept, left = readable(scenarios, estimators)
    for name, reason in left.items():
        say(f"{name} is left out: {reason}")
    return kept


def tell_failures(failures: Sequence[Mapping[str, Any]]) -> None:
    """Say on stderr which estimators failed where, and why: each kind of failure once."""
    from flexaxis.experiments.reporting.terminal import failures_in_words as in_words

    for text, count in in_words(failures):
        say(f"{text} (and {count - 1} like it)" if count > 1 else text)
    if failures:
        cases = "1 case" if len(failures) == 1 else f"{len(failures)} cases"
        say(f"{cases} could not be run: `error` in the rows says why")


def failed(failures: Sequence[Mapping[str, Any]], remarks: Sequence[Remark] = ()) -> int:
    """Return the exit status where some cases could not be run: 70 if code crashed, else 1.

    It is 1 as well where a user's estimator returned what is not finite.
    """
    crashed = any(row["error"].startswith("EstimatorCrash") for row in failures)
    return CRASH if crashed else FINDING if failures or remarks else 0
