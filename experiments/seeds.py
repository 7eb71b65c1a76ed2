"""Numbers that users give: seeds, as a number of them or a range, and processes."""

from __future__ import annotations

import os
from typing import Any

from flexaxis.sim.errors import FlexaxisError

FIRST = 1000
"""The first seed that is reported on; 0 to 99 are for tuning."""
END = 2**63
MOST_SEEDS = 100_000
MOST_JOBS = max(64, 4 * (os.cpu_count() or 1))


def parse_seeds(text: str, *, what: str = "--seeds") -> list[int]:
    """Return the seeds of "N" (1000 … 1000+N−1) or "A:B" (A … B−1).

    Parameters
    ----------
    text : str
    what : str
        Name of the option, for the message.

    Raises
    ------
    FlexaxisError
        If it is neither, or has too many seeds.

    Examples
    --------
    >>> parse_seeds("3"), parse_seeds("5:7")
    ([1000, 1001, 1002], [5, 6])
    """
    first, colon, last = text.partition(":")
    try:
        seeds = range(int(first), int(last)) if colon else range(FIRST, FIRST + int(text))
    except ValueError:
        seeds = range(0)
    if not seeds or seeds[0] < 0:
        raise FlexaxisError(
            f"{what} {text!r}: give a number of seeds, such as 8, or a range from:to, such as "
            "1000:1030 (the last is not included)"
        )
    check_number(seeds[-1] - seeds[0] + 1, what=f"{what} {text!r}")
    check_seed(seeds[-1], what=what)
    return list(seeds)


def check_number(number: int, *, what: str = "seeds") -> None:
    """Refuse too many seeds; `what` is the name in the message.

    Raises
    ------
    FlexaxisError
    """
    if number > MOST_SEEDS:
        raise FlexaxisError(f"{what}: at most {MOST_SEEDS} seeds, which fix a std to 0.2 %")


def check_seed(seed: Any, *, what: str = "seed") -> None:
    """Refuse a seed that is no whole number from 0 to 2^63 − 1.

    Raises
    ------
    FlexaxisError
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < END:
        raise FlexaxisError(f"{what} {str(seed)[:40]}: give a whole number from 0 to 2^63 - 1")


def check_jobs(jobs: Any, *, what: str = "jobs") -> None:
    """Refuse a number of processes that is none; `what` is its name in the message.

    Raises
    ------
    FlexaxisError
    """
    whole = hasattr(jobs, "__index__") and not isinstance(jobs, bool)
    if not whole or not 1 <= jobs <= MOST_JOBS:
        raise FlexaxisError(
            f"{what} {str(jobs)[:40]}: give a number of processes, 1 to {MOST_JOBS}"
        )
