"""How large the report of a run may be, and which single runs find room in it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

SMALL, LARGE = 3.0, 12.0  # MB: of a report of a few scenarios, and of the whole catalogue
FEW = 12  # scenarios
PROBES = 24  # runs that are tried to learn how much one takes
TRIES = 6


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
        self, wanted: Sequence[Any], made: Callable[[Sequence[Any], str], str], *, folder: str
    ) -> str:
        """Return a page with as many of the things that are wanted as there is room for.

        Parameters
        ----------
        wanted : sequence
            The more important ones first.
        made : callable
            ``made(chosen, left)``: the page with some of them, and a sentence on the others.
        folder : str
            Of the run, for the line that gives all of them.
        """
        bare = _size(made([], ""))
        if not wanted:
            return made([], "")
        probes = wanted[:: -(-len(wanted) // PROBES)]
        each = max(1.0, (_size(made(probes, "")) - bare) / len(probes))
        count = min(len(wanted), max(0, int((self.most - bare) / each)))
        for _ in range(TRIES):
            said = _left(count, len(wanted), bare + each * len(wanted), folder)
            page = made(wanted[:count], said)
            over = _size(page) - self.most
            if over <= 0 or count == 0:
                break
            count = max(0, int(count - 1.1 * over / each) - 1)
        return page


def _size(page: str) -> int:
    return len(page.encode())


def _left(count: int, all_of_them: int, size: float, folder: str) -> str:
    """Return what is left out, and the line that gives it."""
    if count == all_of_them:
        return ""
    line = shlex.join(["flexaxis", "report", folder, "--size", str(math.ceil(1.1 * size / 1e6))])
    first = ", the worst and the median of each estimator first" if count > 1 else ""
    said = f"{count} of {all_of_them} single runs can be opened here{first}"
    return f"{said}, for the size of this file. All of them: {line}"
