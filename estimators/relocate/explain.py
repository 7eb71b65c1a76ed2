"""
Which change, of which parameters and when, explains a stretch of the past: all hypotheses, ranked.

Pure: nothing here changes a filter. A hypothesis lets one parameter change, or all identified ones
at once. All are judged to first order at all times, those that may be true are fitted.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.fit import Change, Past, explain, explaining
from flexaxis.estimators.relocate.screen import screen, screening
from flexaxis.estimators.relocate.work import CALL, Work, finished
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

SPREAD = 0.5  # of a change, relative to the value before: from half to one and a half
UNLIKELY = 2.0  # nats against a change of what is not identified
SEVERAL = 6.0  # nats against a change of all identified parameters at once
FAR = 20.0  # nats behind the leader, to first order, from which on a hypothesis is not fitted
TINY = 1e-9  # nats behind the leader, of none but that one
NOTHING = -1e300  # nats for what cannot even be evaluated


class Screened(NamedTuple):
    """Time and value after it of a change of each parameter, and what it gains, (p,) arrays."""

    onset: NDArray[np.int64]
    theta: Array
    gain: Array


class Explanation(NamedTuple):
    """
    What a hypothesis makes of the past.

    Attributes
    ----------
    active : (q,) int array
        Parameters that changed, by the hypothesis.
    odds : float
        Its evidence less its cost, but for a constant [nats]; to first order if not fitted.
    change : Change or None
        What it says; None where it was not fitted.
    """

    active: NDArray[np.int64]
    odds: float
    change: Change | None


@dataclass(frozen=True)
class Ranking:
    """
    All hypotheses, and what they make of the past.

    Attributes
    ----------
    explanations : tuple of Explanation
        Those of the single parameters first.
    singles : int
        How many these are.
    """

    explanations: tuple[Explanation, ...]
    singles: int

    @cached_property
    def best(self) -> int:
        """Which one of those that were fitted has the most evidence."""
        return max(self._fitted, key=lambda i: self.explanations[i].odds)

    @cached_property
    def _fitted(self) -> list[int]:
        """Those with a change; where all are absurd, one that was not fitted may be a tie."""
        return [i for i, found in enumerate(self.explanations) if found.change is not None]

    @property
    def change(self) -> Change:
        """What the best one says."""
        change = self.explanations[self.best].change
        assert change is not None  # only what was fitted leads
        return change

    @property
    def odds(self) -> float:
        """Evidence of the best one less its cost [nats]."""
        return self.explanations[self.best].odds

    @property
    def lead(self) -> float:
        """How far the best one is ahead of every other single parameter [nats]."""
        others = [
            found.odds
            for i, found in enumerate(self.explanations[: self.singles])
            if i != self.best
        ]
        return self.odds - max(others, default=-np.inf)


@dataclass(frozen=True)
class Hypotheses:
    """
    Each single parameter, and all identified ones at once.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    box : (lower, upper), each (p,)
        Where the parameters may be.
    identified : int
        How many of the parameters, the first, are identified.
    candidates : (c,) int array
        Parameters that may have changed, the identified ones first.
    promising : float
        What the best must gain to first order, for more than that one to be fitted [nats].
    """

    terms: Terms
    box: tuple[Array, Array]
    identified: int
    candidates: NDArray[np.int64]
    promising: float = -np.inf

    @cached_property
    def choices(self) -> list[NDArray[np.int64]]:
        """Which parameters each hypothesis lets change."""
        several = [np.arange(self.identified)] if self.identified > 1 else []
        return [np.array([i]) for i in self.candidates] + several

    @cached_property
    def costs(self) -> Array:
        """Evidence against each before any data [nats]."""
        single = [0.0 if i < self.identified else UNLIKELY for i in self.candidates]
        return np.array(single + ([SEVERAL] if self.identified > 1 else []))

    def rank(self, past: Past, noise: float, before: Ranking | None) -> Ranking:
        """
        Rank all hypotheses.

        Parameters
        ----------
        past : Past
        noise : float
            Variance of the noise before the change.
        before : Ranking or None
            That of an earlier look at the same past, of which less was known.
        """
        return finished(self.ranking(past, noise, before))

    def ranking(
        self, past: Past, noise: float, before: Ranking | None, *, grain: float = np.inf
    ) -> Work[Ranking]:
        """Do as `rank`, in pieces of so many operations."""
        seen = yield from self._screen(past, noise, grain)
        yield 3 * CALL
        gains = np.array([np.max(seen.gain[active]) for active in self.choices]) - self.costs
        gains = np.nan_to_num(gains, nan=NOTHING)  # a filter that has diverged explains nothing
        behind = gains.max() - gains
        if before is not None:
            odds = np.array([found.odds for found in before.explanations])
            behind = np.minimum(behind, odds.max() - odds)
        enough = gains.max() >= self.promising
        near = [int(i) for i in np.flatnonzero(behind < (FAR if enough else TINY))]
        fitted = {}
        for i in near:
            fitted[i] = yield from self._explain(past, i, seen, before, grain)
        found = {
            i: np.nan_to_num(change.evidence, nan=NOTHING) - self.costs[i]
            for i, change in fitted.items()
        }
        most = max(found.values())
        return Ranking(
            tuple(
                Explanation(active, found.get(i, most - behind[i]), fitted.get(i))
                for i, active in enumerate(self.choices)
            ),
            singles=len(self.candidates),
        )

    def _screen(self, past: Past, noise: float, grain: float) -> Work[Screened]:
        """Return time, size and gain of a change of each parameter, to first order."""
        theta, candidates = past.theta[0], self.candidates
        p = len(theta)
        onset, change, gain = np.zeros(p, np.int64), np.zeros(p), np.full(p, -np.inf)
        stretch = past.x[0], past.u, past.y, past.present
        given = self.terms, theta, candidates, *stretch, noise, *self.box, SPREAD
        if grain == np.inf:
            yield np.inf
            found = screen(*given)
        else:
            found = yield from screening(*given, grain=grain)
        onset[candidates], change[candidates], gain[candidates] = found
        onset = np.minimum(onset, len(past.theta) - 1)
        return Screened(onset, np.clip(theta + change, *self.box), gain)

    def _explain(
        self, past: Past, choice: int, seen: Screened, before: Ranking | None, grain: float
    ) -> Work[Change]:
        """Fit one hypothesis, from where it was at the last look and from where it is seen now."""
        active, found = self.choices[choice], []
        last = before.explanations[choice].change if before is not None else None
        if last is not None:
            found.append((yield from self._fit(past, active, last.onset, last.theta, grain)))
        best = active[np.argmax(seen.gain[active])]
        onset = int(seen.onset[best])
        if not found or abs(onset - found[0].onset) > 1:
            theta = past.theta[onset].copy()
            if len(active) == 1:
                theta[best] = seen.theta[best]
            found.append((yield from self._fit(past, active, onset, theta, grain)))
        return max(found, key=lambda change: change.evidence)

    def _fit(
        self, past: Past, active: NDArray[np.int64], guess: int, theta: Array, grain: float
    ) -> Work[Change]:
        given = self.terms, past, active, *self.box, SPREAD, guess, theta
        if grain == np.inf:
            yield np.inf
            return explain(*given)
        return (yield from explaining(*given, grain=grain))
