"""Work spread over samples: so much in each, while a copy of the filter goes on without it."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from flexaxis.estimators.relocate.finding import Finding
from flexaxis.estimators.relocate.front import Front
from flexaxis.estimators.relocate.judge import Judge
from flexaxis.estimators.relocate.work import CALL, bill, samples_of


class Pace:
    """
    The work of one judge, of which every sample does a part.

    While there is work to be done the filter waits, and a copy of it takes the samples. What it has
    missed it takes then, faster than it came, and the copy is thrown away. So nothing changes
    under the hands of a judgement, and nothing that it needs is forgotten.

    Parameters
    ----------
    judge : Judge
    budget : float
        Operations in a sample.
    sample : float
        Operations of the filter in one.
    most : int
        Samples that may wait before alarms are no more looked into, until fewer do.

    Attributes
    ----------
    front : Front or None
        What goes on while there is work to be done.
    told : tuple of Finding
        What had been found before that.
    spent : float
        Operations that the last sample did.
    """

    def __init__(self, judge: Judge, budget: float, sample: float, most: int) -> None:
        self.judge, self._budget, self._sample, self._most = judge, budget, sample, most
        self.reset()

    def reset(self) -> None:
        """Throw the work away."""
        self._work: Iterator[float] | None = None
        self._next = 0.0  # what its next piece takes
        self._missed: list[tuple[float, float, bool]] = []
        self.front: Front | None = None
        self.told: tuple[Finding, ...] = ()
        self.spent = 0.0

    def hasten(self) -> None:
        """Do now what is left of the work, to copy it; its result comes as late as ever."""
        if self._work is not None:
            with np.errstate(all="ignore"):
                self._work = bill(self._work)

    def run(self, *samples: Any) -> int:
        """Take samples, as `flexaxis.estimators.relocate.memory.Memory` does."""
        if self.front is None:
            taken = self.judge.memory.run(*samples)
            self._begin()
            return taken
        u, y, present = samples[:3]
        self._missed.append((u[0], y[0], present[0]))
        return self.front.run(*(of[:1] for of in samples))

    def go_on(self) -> bool:
        """Do the work of a sample; return whether something has been found, and is told now."""
        left, known = self._budget, len(self.told)
        with np.errstate(all="ignore"):  # a filter that diverges is a result
            while self._work is not None or self._missed:
                takes = self._next if self._work is not None else CALL + self._sample
                # what no sample has time for is done nevertheless: else all would wait for ever
                if takes > left and left < self._budget:
                    break
                left -= self._piece() if self._work is not None else self._catch_up(left)
        self.spent = self._budget - left
        return len(self.told) > known

    def _begin(self) -> None:
        """Say what is to be done after a sample; where there is something, go on without it."""
        waiting = len(self._missed)
        self._work = self.judge.attend(present=not waiting, behind=waiting > self._most)
        self._next = next(self._work, -1.0)
        if self._next < 0:
            self._work = None
        elif self.front is None:
            self.front = self.judge.memory.fork()

    def _piece(self) -> float:
        """Do the next piece; return what it took."""
        assert self._work is not None
        took, self._next = self._next, next(self._work, -1.0)
        if self._next < 0:
            self._work = None
            self._tell()
        return took

    def _catch_up(self, left: float) -> float:
        """Take what has been missed, as much of it as there is time for; return what that took."""
        N = min(samples_of(left - CALL, self._sample), len(self._missed))
        u, y, present = (np.array(column) for column in zip(*self._missed[:N], strict=True))
        room = np.empty((N, self.judge.tracked)), np.empty((N, 3))
        taken = self.judge.memory.run(u, y, present, *room)
        del self._missed[:taken]
        self._tell()
        self._begin()
        return CALL + taken * self._sample

    def _tell(self) -> None:
        """Where nothing is missed any more, be the filter that waited, and tell its findings."""
        if not self._missed:
            now, told = self.judge.memory.count - 1, len(self.told)
            found = self.judge.found
            found[told:] = [replace(finding, alarm=now) for finding in found[told:]]
            self.front, self.told = None, tuple(found)
