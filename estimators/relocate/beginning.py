"""
Fit what is learnt once to all data since the start, again and again while they are few.

A recursive filter linearises early data at a poor start, and never forgets what it made of them
where it forgets nothing. So the first seconds are fitted anew from what was known before them,
until they say more than that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.explain import SPREAD
from flexaxis.estimators.relocate.fit import normal_equations
from flexaxis.estimators.relocate.guesses import ABSENT, TOLD, WALKS, Guess, measured_sizes
from flexaxis.estimators.relocate.memory import Memory, Present
from flexaxis.estimators.relocate.needed import Posterior, Question, needed
from flexaxis.estimators.relocate.search import Descent, Evaluated
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

STARTED = 1.0  # s of motion that say how large it is, and what the noise
EXPLAINED = 2.0  # mean square of the residual over that of the noise, of a model that explains it
WORSE = 40.0  # Σε²/σ² that a model with less parameters may leave more: 20 nats, for ten of them
ITERATIONS = 60  # of a fit, at most
CONVERGED = 1e-5  # of the sum of squares, that a further step gains
LINEAR = ("c_sin", "c_cos")  # what is fitted first, beside what is tracked
FITTED = (1.0, 2.0, 4.0)  # s of motion, of which all is fitted


class Prior(NamedTuple):
    """θ (p,) before the first sample, standard deviations of the (known,) first, noise variance."""

    theta: Array
    deviation: Array
    noise: float


class Fitted(NamedTuple):
    """θ (p,) that explains the data, and which of it they ask for; the rest is as it was told."""

    theta: Array
    active: NDArray[np.int64]


def output_gain(design: Design) -> float:
    """Return y over the motor speed, one unless y has another unit."""
    A, _, C = design.model.matrices(design.theta0)
    gain = float(np.abs(C).sum())
    if design.output == "increment":  # its state integrates the speed over a sample
        gain *= design.period * float(np.abs(A[design.model.reset[-1]]).sum())
    return gain


@dataclass(frozen=True)
class Beginning:
    """
    What is known before the first sample, and how more is made of it.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    design : Design
        That of the filter.
    roles : Roles
    guesses : tuple of Guess
        Of what has a prior of its own.
    nominal : mapping
    """

    terms: Terms
    design: Design
    roles: Roles
    guesses: tuple[Guess, ...]
    nominal: Mapping[str, float]

    def prior(self, memory: Memory) -> Prior | None:
        """Return what was known before, in sizes of what has moved since; None while that rests."""
        samples = round(STARTED / self.design.period)
        noise = self.design.noise**2 or memory.roughness(samples)
        if memory.state["samples"] < samples or not noise > 0:
            return None
        u, y, _ = memory.signals(memory.first)
        speed = y / output_gain(self.design)
        sizes = measured_sizes(u[:-1, 0], speed, self.design.period, self.nominal)
        mine = self.roles.prior
        scale, names = self.design.scale[mine], self.design.model.names
        guesses = [
            guess.at(self.nominal[names[i]], sizes)
            for i, guess in zip(mine, self.guesses, strict=True)
        ]
        start, deviation = np.array(guesses).reshape(-1, 2).T / scale
        theta = self.design.theta0.copy()
        theta[mine] = start
        own = np.full(self.roles.given, SPREAD)
        return Prior(np.clip(theta, *self.box), np.r_[own, np.abs(deviation)], noise)

    @property
    def box(self) -> tuple[Array, Array]:
        """Where the parameters may be."""
        return self.design.lower, self.design.upper

    def drift(self, state: Present, prior: Prior, walk: float) -> Array:
        """
        Return Δ (p, p), what P gains in a sample.

        What is tracked walks, relative to what it is expected to be. The sum of speeds is an angle
        that wanders by T σ in a sample, and so does the phase of what depends on it:
        a sin Nφ + b cos Nφ by N T σ.
        """
        design, T = self.design, self.design.period
        theta, in_use = state["theta"], np.diag(state["P"]) > 0
        walks = np.zeros(len(theta))
        for i, name in enumerate(design.model.names[: self.roles.tracked]):
            walks[i] = walk * WALKS.get(name, 1.0) * abs(prior.theta[i]) * in_use[i]
        drift = np.diag(walks**2 * T / prior.noise)
        if design.output == "speed" and "c_sin" in design.model.names:
            turning = [design.model.names.index(name) for name in ("c_sin", "c_cos")]
            a, b = (in_use * theta)[turning] * design.scale[turning]
            along = self.nominal["poles"] * T * np.array([-b, a]) / design.scale[turning]
            drift[np.ix_(turning, turning)] += np.outer(along, along)
        return drift

    def fit(self, memory: Memory, prior: Prior) -> Fitted | None:
        """Explain all data that are remembered, with no more parameters than they ask for."""
        names, every = self.design.model.names, np.arange(self.roles.known)
        few = np.array([i for i in every if i < self.roles.tracked or names[i] in LINEAR])
        first = self._descend(memory, prior, few, (prior.theta, memory.state["theta"].copy()))
        whole = self._descend(memory, prior, every, (first.theta,))
        samples = memory.count - memory.first
        if not np.isfinite(whole.square):
            return None
        if whole.square > EXPLAINED * samples:
            return Fitted(whole.theta, every)
        less = self._reduced(memory, prior, whole)
        return less or Fitted(whole.theta, every)

    def _reduced(self, memory: Memory, prior: Prior, whole: Evaluated) -> Fitted | None:
        """Return a fit with less parameters than the whole, None if it explains much less."""
        known, questions = self.roles.known, self._questions(prior)
        posterior = Posterior(np.arange(known), whole.theta[:known], whole.H)
        mean, deviation = prior.theta[:known], prior.deviation
        active, fixed = needed(posterior, questions, mean=mean, deviation=deviation)
        theta = prior.theta.copy()
        theta[active.active] = active.theta
        for places, told in fixed:
            theta[places] = told
        theta = np.clip(theta, *self.box)
        found = self._descend(memory, prior, active.active, (theta,))
        if found.square > whole.square + WORSE:
            return None
        return Fitted(found.theta, active.active)

    def _questions(self, prior: Prior) -> list[Question]:
        """Return what may be as it was told, for parameters that the model has."""
        names = self.design.model.names[: self.roles.known]
        lower = self.design.lower

        def places(of: Sequence[str]) -> NDArray[np.int64]:
            return np.array([names.index(name) for name in of if name in names], np.int64)

        absent = [
            Question(places(of), np.maximum(lower[places(of)], 0.0), places(with_them))
            for of, with_them in ABSENT
            if set(of) <= set(names)
        ]
        sheet = [places([name]) for name in TOLD if name in names]
        return absent + [Question(i, prior.theta[i], places([])) for i in sheet]

    def _descend(
        self, memory: Memory, prior: Prior, active: NDArray[np.int64], starts: Sequence[Array]
    ) -> Evaluated:
        """Return the most probable values of some parameters, all others as they are."""
        u, y, present = memory.signals(memory.first)
        x, nothing = memory.stretch(memory.first).x[0], np.zeros(ORDER)
        signals = u[:-1].copy(), y, present, nothing, nothing, prior.noise, active
        known, deviation = self.roles.known, prior.deviation

        def evaluate(theta: Array) -> Evaluated:
            square, H, g = normal_equations(self.terms, theta, x, *signals)
            if not np.isfinite(square):
                return Evaluated(theta, np.inf, np.zeros_like(H), np.zeros_like(g))
            off = (theta - prior.theta)[:known] / deviation
            H += np.diag(deviation[active] ** -2)
            return Evaluated(theta, square + off @ off, H, g - (off / deviation)[active])

        start = min((evaluate(theta) for theta in starts), key=lambda tried: tried.square)
        descent = Descent(
            start,
            self.box,
            active,
            sizes=deviation[active],
            iterations=ITERATIONS,
            converged=CONVERGED,
        )
        while not descent.done:
            descent.take(evaluate(descent.trial))
        return descent.at
