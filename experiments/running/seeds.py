"""Seeds from text: a number of them, or a range."""

from __future__ import annotations

from typing import Any

from flexaxis.sim.errors import FlexaxisError

FIRST = 1000  # 0–99 are for tuning; what is reported is on others
END = 2**63  # the columns of a result hold signed integers of 64 bits
MOST = 100_000  # of them a std is known to 0.2 %; more is a slip


def parse_seeds(text: str, *, what: str = "--seeds") -> list[int]:
    """Return the seeds that "N" (1000 … 1000+N−1) or "A:B" (A … B−1) stands for.

    Parameters
    ----------
    text : str
    what : str
        What it was given as, for the message.

    Raises
    ------
    FlexaxisError
        If it is neither, or empty, or more than `MOST` or beyond `END`.

    Examples
    --------
    >>> parse_seeds("3")
    [1000, 1001, 1002]
    >>> parse_seeds("5:7")
    [5, 6]
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
    """Refuse a number of seeds that nobody means; `what` stands before the message.

    Raises
    ------
    FlexaxisError
    """
    if number > MOST:
        raise FlexaxisError(f"{what}: at most {MOST} seeds, of which a std is known to 0.2 %")


def check_seed(seed: Any, *, what: str = "seed") -> None:
    """Refuse what is no number of a run; `what` stands before it in the message.

    Raises
    ------
    FlexaxisError
        If it is no whole number from 0 on, or beyond `END`.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise FlexaxisError(f"{what} {seed!r}: give a whole number from 0 on")
    if seed >= END:
        raise FlexaxisError(f"{what} of {len(str(seed))} digits: give one below 2^63")
