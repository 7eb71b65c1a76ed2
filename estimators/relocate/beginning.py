"""
Fit what is learnt once to all data since the start, again and again while they are few.

A recursive filter linearises early data at a poor start, and never forgets what it made of them
where it forgets nothing. So the first seconds are fitted anew from what was known before them,
until they say more than that.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.explain import SPREAD
from flexaxis.estimators.relocate.fit import normal_equations
from flexaxis.estimators.relocate.guesses import Guess, measured_sizes
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.search import Descent, Evaluated
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

STARTED = 1.0  # s of motion that say how large it is, and what the noise
FITTED = (1.0, 2.0, 4.0)  # s of motion, of which all is fitted


class Prior(NamedTuple):
    """θ (p,) before the first sample, standard deviations of the (known,) first, noise variance."""

    theta: Array
    deviation: Array
    noise: float


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
        sizes = measured_sizes(u[:-1, 0], y, self.design.period, self.nominal)
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

    def fit(self, memory: Memory, prior: Prior) -> Array:
        """Return the most probable parameters (p,) for all data that are remembered."""
        u, y, present = memory.signals(memory.first)
        x = memory.stretch(memory.first).x[0]
        active, nothing = np.arange(self.roles.known), np.zeros(ORDER)
        signals = u[:-1].copy(), y, present, nothing, nothing, prior.noise, active

        def evaluate(theta: Array) -> Evaluated:
            square, H, g = normal_equations(self.terms, theta, x, *signals)
            if not np.isfinite(square):
                return Evaluated(theta, np.inf, np.zeros_like(H), np.zeros_like(g))
            off = (theta - prior.theta)[active] / prior.deviation
            H += np.diag(prior.deviation**-2)
            return Evaluated(theta, square + off @ off, H, g - off / prior.deviation)

        starts = prior.theta, memory.state["theta"].copy()
        start = min((evaluate(theta) for theta in starts), key=lambda tried: tried.square)
        descent = Descent(start, self.box, active)
        while not descent.done:
            descent.take(evaluate(descent.trial))
        return descent.at.theta
