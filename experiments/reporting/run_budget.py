"""How large the report of a run may be, and which single runs find room in it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

SMALL, LARGE = 3.0, 12.0  # MB: of a report of a few scenarios, and of the whole catalogue
FEW = 12  # scenarios
ALL = 10_000  # estimators: more than there are
AT_ONCE = 500  # runs of which there is no need to learn how much one takes, if all have room
PROBES = 24  # runs that are tried to learn how much one takes
CURVES = 0.85  # of the room that all but the single runs may take before curves are thinned
TRIES = 6


@dataclass(frozen=True)
class Thinning:
    """What is left out of the curves over time, of the estimators after so many of the ranking.

    Attributes
    ----------
    bands : int
        How many have a band about their median.
    near : int
        How many are drawn sample by sample at the fault.
    drawn : int
        How many are drawn at all.
    """

    bands: int = ALL
    near: int = ALL
    drawn: int = ALL

    @property
    def words(self) -> str:
        """What that means for who looks at it; empty where nothing is left out."""
        parts = {
            "have a band": self.bands,
            "are drawn sample by sample at the fault": self.near,
            "are drawn over time": self.drawn,
        }
        limits = [f"only the first {n} {what}" for what, n in parts.items() if n < ALL]
        return f"In the order of the ranking, {' and '.join(limits)}." if limits else ""


Made = Callable[[Sequence[Any], str, Thinning], str]
FULL = Thinning()
THINNINGS = (
    FULL,
    Thinning(bands=9),
    Thinning(bands=9, near=9),
    Thinning(bands=3, near=9),
    Thinning(bands=3, near=9, drawn=9),
)
"""What is tried one after the other; nine are shown unless others are asked for."""


@dataclass(frozen=True)
class Budget:
    """The bytes of a report.

    Attributes
    ----------
    most : float
        How large it may be [bytes].
    """

    most: float

    @classmethod
    def of(cls, size: float | None, *, scenarios: int) -> Budget:
        """Return what was asked for [MB], or what reports of so many scenarios have by default."""
        default = SMALL if scenarios <= FEW else LARGE
        return cls(1e6 * (default if size is None else size))

    def fitted(
        self,
        wanted: Sequence[Any],
        made: Callable[[Sequence[Any], str, Thinning], str],
        folder: str,
    ) -> str:
        """Return a page with as many of the things that are wanted as there is room for.

        Curves come first: they are thinned where they alone would take most of the room.

        Parameters
        ----------
        wanted : sequence
            The more important ones first.
        made : callable
            ``made(chosen, left, thinning)``: the page with some of them, and what is left out.
        folder : str
            Of the run, for the line that gives all of them.
        """
        if len(wanted) <= AT_ONCE and _size(page := made(wanted, "", FULL)) <= self.most:
            return page
        for thinning in THINNINGS:
            bare = _size(made([], "", thinning))
            if bare <= CURVES * self.most:
                break
        probes = wanted[:: -(-len(wanted) // PROBES)] if wanted else []
        each = max(1.0, (_size(made(probes, "", thinning)) - bare) / max(1, len(probes)))
        count = min(len(wanted), max(0, int((self.most - bare) / each)))
        for _ in range(TRIES):
            left = f"{thinning.words} {_left(count, len(wanted))}".strip()
            if left:
                left += f" All of it: {_line(folder, bare + each * len(wanted), thinning)}"
            page = made(wanted[:count], left, thinning)
            over = _size(page) - self.most
            if over <= 0 or count == 0:
                break
            count = max(0, int(count - 1.1 * over / each) - 1)
        return page


def _size(page: str) -> int:
    return len(page.encode())


def _left(count: int, all_of_them: int) -> str:
    """Return what is left out of single runs."""
    if count == all_of_them:
        return ""
    first = ", the worst and the median of each estimator first" if count > 1 else ""
    return f"{count} of {all_of_them} single runs can be opened{first}, for the size of this file."


def _line(folder: str, size: float, thinning: Thinning) -> str:
    """Return the line that gives all, with a size [MB] that is enough for it."""
    most = size if thinning is FULL else 2 * size  # a thinned curve is half of one at least
    return shlex.join(["flexaxis", "report", folder, "--size", str(math.ceil(1.1 * most / 1e6))])
