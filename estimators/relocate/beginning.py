"""
Fit what is learnt once to all data since the start, again and again while they are few.

A recursive filter linearises early data at a poor start, and never forgets what it made of them
where it forgets nothing. So the first seconds are fitted anew from what was known before them,
until they say more than that.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.explain import SPREAD
from flexaxis.estimators.relocate.fit import normal_equations
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.search import Descent, Evaluated
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

NOTICED = 50  # samples that say what the noise is, with a relative deviation of 20 %
FITTED = (1.0, 2.0, 4.0)  # s after the noise is known, at which the data are fitted


@dataclass(frozen=True)
class Beginning:
    """
    What was known before the first sample, and how more is made of it.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    box : (lower, upper), each (p,)
    theta0 : (p,) array
        Parameters that the filter began with.
    roles : Roles
    """

    terms: Terms
    box: tuple[Array, Array]
    theta0: Array
    roles: Roles

    @property
    def deviation(self) -> Array:
        """Standard deviations (known,) of what was known of the parameters that are estimated."""
        return np.r_[np.full(self.roles.named, SPREAD), self.roles.deviation]

    def fit(self, memory: Memory, noise: float) -> Array:
        """Return the most probable parameters (p,) for all data that are remembered."""
        u, y, present = memory.signals(memory.first)
        x = memory.stretch(memory.first).x[0]
        active, nothing = np.arange(self.roles.known), np.zeros(ORDER)

        def evaluate(theta: Array) -> Evaluated:
            square, H, g = normal_equations(
                self.terms, theta, x, u[:-1].copy(), y, present, nothing, nothing, noise, active
            )
            if not np.isfinite(square):
                return Evaluated(theta, np.inf, np.zeros_like(H), np.zeros_like(g))
            off = (theta - self.theta0)[active] / self.deviation
            H += np.diag(self.deviation**-2)
            return Evaluated(theta, square + off @ off, H, g - off / self.deviation)

        start = min(
            (evaluate(theta) for theta in (self.theta0, memory.state["theta"].copy())),
            key=lambda tried: tried.square,
        )
        descent = Descent(start, self.box, active)
        while not descent.done:
            descent.take(evaluate(descent.trial))
        return descent.at.theta
