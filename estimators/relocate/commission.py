"""Begin a filter that learns: when its noise and motion are known, and when all is fitted anew."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.beginning import SPREADS, STARTED, Beginning
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.prior import Prior
from flexaxis.estimators.relocate.remainder import remaining
from flexaxis.estimators.relocate.rewind import Rewind
from flexaxis.estimators.relocate.work import CALL, Work

Array = NDArray[np.float64]


class Commission:
    """
    The first seconds of a filter.

    Parameters
    ----------
    beginning : Beginning or None
        What is known before; None for a filter that learns nothing once.
    rewind : Rewind
    walk : float
        Standard deviation of what is tracked after a second, relative to θ(0).

    Attributes
    ----------
    fixed_because : dict of str to str
        What is not learnt, and why.
    """

    def __init__(self, beginning: Beginning | None, rewind: Rewind, walk: float) -> None:
        self._beginning, self._rewind, self._walk = beginning, rewind, walk
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._prior: Prior | None = None  # what was known before, once it is known
        self._fits: list[int] = []
        self.fixed_because: dict[str, str] = {}

    def warm_up(self, memory: Memory) -> Work[None]:
        """Let everything compile that a fit needs."""
        if (beginning := self._beginning) is not None:
            u, y, present = memory.signals(memory.first)
            given = beginning.design.theta0, memory.state_at(memory.first), (u[:-1], y, present)
            yield from remaining(beginning.terms, *given, 0, grain=beginning.grain)

    @property
    def longest(self) -> float:
        """Operations of the longest piece of its work, however small a grain is."""
        return 0.0 if self._beginning is None else SPREADS

    def expected(self, p: int) -> Array:
        """Return about how large each of p parameters may be: one relative to θ(0), or a prior."""
        return np.ones(p) if self._prior is None else np.abs(self._prior.theta)

    def due(self, count: int) -> list[int]:
        """Return the counts at which something is to be done."""
        if self._beginning is None:
            return []
        return self._fits if self._prior is not None else [count + 1]

    def goes_on(self, count: int) -> bool:
        """Return whether there are more fits to come."""
        return self._beginning is not None and (self._prior is None or count < self._fits[-1])

    def recover(self, memory: Memory) -> Work[bool]:
        """
        Where the filter has diverged, begin anew with what was told; return whether it had.

        Laws do nothing then, until the next fit.
        """
        state = memory.state
        if not state["guarded"] or np.isfinite(state["theta"]).all():
            return False
        assert self._prior is not None and self._beginning is not None  # or it is not guarded
        theta = self._beginning.design.theta0
        yield from self._rewind.to_told(memory, theta, self._prior.noise)
        state = memory.state
        state["guarded"] = bool(np.isfinite(state["theta"]).all())  # nothing more can be done
        return True

    def attend(self, memory: Memory) -> Work[bool]:
        """Do what is due at this sample; return whether the filter has begun anew."""
        beginning = self._beginning
        if beginning is None:
            return False
        if self._prior is None:
            prior = yield from beginning.prior(memory)
            if prior is None:
                return False
            self._prior, period = prior, beginning.design.period
            memory.state["guarded"] = 1
            self._fits = [memory.count + round((t - STARTED) / period) for t in beginning.fitted]
        if memory.count not in self._fits:
            return False
        fitted = yield from beginning.fit(memory, self._prior)
        if fitted is not None:
            self._prior = self._prior._replace(noise=fitted.noise)
            self.fixed_because = fitted.because
            yield from self._rewind.to_fit(memory, self._prior, fitted)
        # what has been found to be absent walks no more
        yield CALL
        memory.drift = beginning.drift(memory.state, self._prior, self._walk)
        return fitted is not None
