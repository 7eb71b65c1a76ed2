"""Seeds from text: a number of them, or a range."""

from __future__ import annotations

from flexaxis.sim.errors import FlexaxisError

FIRST = 1000  # 0–99 are for tuning; what is reported is on others


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
        If it is neither, or empty.

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
    return list(seeds)
