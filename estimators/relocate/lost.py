"""Whether a filter is lost altogether, and where it should be then."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.memory import SEARCHED, Memory, Present
from flexaxis.estimators.relocate.search import Evaluated, Search
from flexaxis.estimators.relocate.work import CALL, Work
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

CHECK = SEARCHED  # s between two looks, and of the past that is searched
# Of the mean square of y left unexplained, and of that share what could be foretold and so is no
# noise. Friction and play leave up to 0.01 and half of it; a local minimum 0.005 to 0.6, and 0.6
# to 0.95 of it: what is suspicious is worth a search, what is absurd is worth telling.
SUSPICIOUS = 0.002, 0.5
ABSURD = 0.1, 0.8
BETTER = 0.25  # of the mean square of the residual, that other parameters have to leave
UNKNOWN = 1.0  # s after which a wrong state has been forgotten


@dataclass(frozen=True)
class Found:
    """
    What came of a search.

    Attributes
    ----------
    first : int
        Sample before the stretch that was searched.
    better : Evaluated or None
        Parameters that explain it much better than those of the filter; None if there are none.
    """

    first: int
    better: Evaluated | None


class Lookout:
    """
    Looks from time to time whether parameters of now leave most of the output unexplained.

    Then it searches all over the box, one evaluation a sample.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    box : (lower, upper), each (p,)
    identified : int
        How many of the parameters, the first, are identified.
    period : float
        Sampling period [s].
    grain : float
        Operations of a piece of the work.
    """

    def __init__(
        self,
        terms: Terms,
        box: tuple[Array, Array],
        *,
        identified: int,
        period: float,
        grain: float = np.inf,
    ) -> None:
        self._grain = grain
        self._terms, self._box, self._identified = terms, box, identified
        self._check, self._unknown = round(CHECK / period), round(UNKNOWN / period)
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._search: Search | None = None
        self._first = 0  # sample before what is searched
        self._next = self._wait = self._check  # count of the next search, samples between two
        self._said = False

    def warm_up(self, memory: Memory) -> Work[None]:
        """Let everything compile that a search needs."""
        search = self._search_of(memory, memory.first, memory.state["theta"])
        yield from search.advance()

    @property
    def searching(self) -> bool:
        """Whether there is an evaluation to be done."""
        return self._search is not None

    def due(self, count: int) -> int:
        """Return the count at which to look next."""
        return count + 1 if self._search else count - count % self._check + self._check

    def look(self, memory: Memory, expected: Array) -> Work[Found | None]:
        """
        Do what is due at this sample; return what came of a search that has ended.

        Parameters
        ----------
        memory : Memory
        expected : (p,) array
            About how large each parameter may be.
        """
        if self._search is not None and self._first < memory.first:
            self._search = None  # other work took so long that its start is forgotten
            self._later(memory)
        if self._search is not None:
            yield from self._search.advance()
            yield 2 * CALL
            return self._end(memory, self._search.best) if self._search.done else None
        if memory.count % self._check == 0:
            if not left(memory.state, SUSPICIOUS):
                self._said, self._wait, self._next = False, self._check, memory.count
            elif memory.count >= self._next:
                yield 4 * CALL
                self._begin(memory, expected)
        return None

    def _begin(self, memory: Memory, expected: Array) -> None:
        """Search the last seconds; of the state before them, only that of the start is known."""
        self._first = first = memory.count - self._check
        self._search = self._search_of(memory, first, expected)

    def _search_of(self, memory: Memory, first: int, expected: Array) -> Search:
        u, y, present = memory.signals(first)
        if first:
            present[: self._unknown] = False
        return Search(
            self._terms,
            memory.state["theta"].copy(),
            self._box,
            expected=expected,
            identified=self._identified,
            x=memory.state_at(first),
            signals=(u[:-1].copy(), y, present),
            grain=self._grain,
        )

    def _later(self, memory: Memory) -> None:
        """Search again after a while: where nothing came of it, ever less often."""
        self._wait *= 2
        self._next = memory.count + self._wait

    def _end(self, memory: Memory, best: Evaluated | None) -> Found | None:
        """Judge what was found by what the filter leaves of the same samples; say so once."""
        self._search = None
        own = np.nan_to_num(memory.read("epsilon", self._first + self._unknown))
        if best is not None and best.square < BETTER * np.mean(own**2):
            return Found(self._first, best)
        self._later(memory)
        if self._said or not left(memory.state, ABSURD):
            return None
        self._said = True
        return Found(self._first, None)


def left(state: Present, limits: tuple[float, float]) -> bool:
    """Whether more than this share of y is left unexplained, and more than that of it no noise."""
    share, foretold = limits
    unexplained = state["noise"] > share * state["power"]
    return bool(unexplained and 1 - state["model"][-1] > foretold)
