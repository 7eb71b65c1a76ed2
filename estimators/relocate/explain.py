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

from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.fit import Change, Past, explain
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.rows import Stretch
from flexaxis.estimators.relocate.screen import screen
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

SPREAD = 0.5  # of a change, relative to the value before: from half to one and a half
UNLIKELY = 2.0  # nats against a change of what is not identified
SEVERAL = 6.0  # nats against a change of all identified parameters at once
FAR = 20.0  # nats behind the leader, to first order, from which on a hypothesis is not fitted
TINY = 1e-9  # nats behind the leader, of none but that one
NOTHING = -1e300  # nats for what cannot even be evaluated
OUTLIER = 6.0  # standard deviations of a lone residual that no change of a parameter makes, …
LONELY = 4.0  # … times larger than its neighbours


class Normal(NamedTuple):
    """
    What the residual was like before an alarm.

    Attributes
    ----------
    variance : float
        Of the noise.
    colour : (ORDER+1,) array
        As from `flexaxis.estimators.relocate.colour.write_colour`.
    """

    variance: float
    colour: Array


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
        """Which one has the most evidence."""
        return int(np.argmax([found.odds for found in self.explanations]))

    @property
    def change(self) -> Change:
        """What the best one says."""
        change = self.explanations[self.best].change
        assert change is not None  # whoever leads was fitted
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
        seen = self._screen(past, noise)
        gains = np.array([np.max(seen.gain[active]) for active in self.choices]) - self.costs
        gains = np.nan_to_num(gains, nan=NOTHING)  # a filter that has diverged explains nothing
        behind = gains.max() - gains
        if before is not None:
            odds = np.array([found.odds for found in before.explanations])
            behind = np.minimum(behind, odds.max() - odds)
        enough = gains.max() >= self.promising
        near = [int(i) for i in np.flatnonzero(behind < (FAR if enough else TINY))]
        fitted = {i: self._explain(past, i, seen, before) for i in near}
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

    def _screen(self, past: Past, noise: float) -> Screened:
        """Return time, size and gain of a change of each parameter, to first order."""
        theta, candidates = past.theta[0], self.candidates
        p = len(theta)
        onset, change, gain = np.zeros(p, np.int64), np.zeros(p), np.full(p, -np.inf)
        onset[candidates], change[candidates], gain[candidates] = screen(
            self.terms,
            theta,
            candidates,
            past.x[0],
            past.u,
            past.y,
            past.present,
            noise,
            *self.box,
            SPREAD,
        )
        onset = np.minimum(onset, len(past.theta) - 1)
        return Screened(onset, np.clip(theta + change, *self.box), gain)

    def _explain(self, past: Past, choice: int, seen: Screened, before: Ranking | None) -> Change:
        """Fit one hypothesis, from where it was at the last look and from where it is seen now."""
        active, found = self.choices[choice], []
        last = before.explanations[choice].change if before is not None else None
        if last is not None:
            found.append(self._fit(past, active, last.onset, last.theta))
        best = active[np.argmax(seen.gain[active])]
        onset = int(seen.onset[best])
        if not found or abs(onset - found[0].onset) > 1:
            theta = past.theta[onset].copy()
            if len(active) == 1:
                theta[best] = seen.theta[best]
            found.append(self._fit(past, active, onset, theta))
        return max(found, key=lambda change: change.evidence)

    def _fit(self, past: Past, active: NDArray[np.int64], guess: int, theta: Array) -> Change:
        return explain(self.terms, past, active, *self.box, SPREAD, guess, theta)


def past_of(before: Stretch, memory: Memory, normal: Normal) -> Past:
    """
    Return the past in which a change is looked for.

    Parameters
    ----------
    before : Stretch
        What the filter knew at each sample at which the change may have happened, as it was before
        anything was taken up.
    memory : Memory
        For what was measured since.
    normal : Normal
    """
    u, y, present = memory.signals(before.first)
    residuals = memory.read("epsilon", before.first - ORDER)
    alone = outliers(
        residuals, np.sqrt(normal.variance * memory.read("scale", before.first - ORDER))
    )
    epsilon = np.where(alone | np.isnan(residuals), 0.0, residuals)[: len(before.rows) + ORDER]
    weights, remains = normal.colour[:-1], normal.colour[-1]
    own = before.rows["epsilon"]
    known = ~np.isnan(own) & ~alone[ORDER : ORDER + len(own)]
    epsilon[ORDER:] = np.where(known, own, 0.0)
    white = whitened(epsilon, before.rows["scale"], known, normal)
    return Past(
        theta=before.theta,
        x=before.x,
        likelihood=likelihood(white, before.rows["scale"], known),
        u=u[:-1].copy(),
        y=y,
        present=present & ~alone[ORDER + 1 :],
        epsilon=epsilon,
        colour=weights,
        variance=float(remains * normal.variance),
    )


def residual(memory: Memory, first: int, normal: Normal) -> tuple[Array, float]:
    """Return the whitened residual of the filter from a sample on, and its log-likelihood."""
    raw, scale = memory.read("epsilon", first - ORDER), memory.read("scale", first)
    known = ~np.isnan(raw)
    known[ORDER:] &= ~outliers(raw, np.sqrt(normal.variance))[ORDER:]
    white = whitened(np.where(known, raw, 0.0), scale, known[ORDER:], normal)
    return white, float(likelihood(white, scale, known[ORDER:])[-1])


def whitened(epsilon: Array, scale: Array, known: NDArray[np.bool_], normal: Normal) -> Array:
    """
    Return the residual (N,) of unit variance, less what the last ones say of it; zero in gaps.

    Parameters
    ----------
    epsilon : (ORDER + N,) array
        From ORDER samples earlier on; zero in gaps.
    scale : (N,) array
        1 + ψᵀPψ.
    known : (N,) bool array
        False in gaps.
    normal : Normal
    """
    relative = epsilon / np.sqrt(np.r_[np.ones(ORDER), scale])
    white = np.convolve(relative, np.r_[1.0, -normal.colour[:-1]])[ORDER : len(relative)]
    return np.where(known, white, 0.0) / np.sqrt(normal.colour[-1] * normal.variance)


def likelihood(white: Array, scale: Array, known: NDArray[np.bool_]) -> Array:
    """Return the logarithm of the likelihood up to each sample, but for a constant [nats]."""
    return np.cumsum(-(white**2 + np.where(known, np.log(scale), 0.0)) / 2)


def outliers(epsilon: Array, deviation: Array | float) -> NDArray[np.bool_]:
    """
    Say which residuals stand alone, as no change of a parameter makes them.

    What a parameter does to y passes through the masses and is still there one sample later. The
    last residual has yet to show that.
    """
    size = np.nan_to_num(np.abs(epsilon))
    around = np.maximum(np.r_[0.0, size[:-1]], np.r_[size[1:], 0.0])
    return (size > OUTLIER * deviation) & (size > LONELY * np.maximum(around, deviation))
