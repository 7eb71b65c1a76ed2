"""What every call that runs cases does: progress, a time limit, and warnings about users' code."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from flexaxis.experiments.building.guest import in_words
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.processes import check_jobs

if TYPE_CHECKING:
    from flexaxis.experiments.building.guest import Remark


@contextmanager
def working(
    what: str, total: float, *, jobs: int = 1, time_limit: float | None = None
) -> Iterator[Means]:
    """Give the means to run cases.

    Parameters
    ----------
    what : str
        What is done, for the progress.
    total : float
        Cases, at most.
    jobs : int
        Processes.
    time_limit : float, optional
        How long code of a user may take for one run [s].
    """
    check_jobs(jobs)
    remarks: list[Remark] = []
    means = Means(jobs=jobs, store=default_cache())
    with means.shown(
        what, total, lambda outcome: remarks.extend(outcome.remarks), time_limit=time_limit
    ) as (shown, _):
        yield shown
    for text in in_words(remarks):  # at the line of the user, who called through two of ours
        warnings.warn(text, stacklevel=5)
