"""
A user-written estimator that smooths the estimates of a standard method
========================================================================

Your own estimator can be any class with the members `names`, `output` and `step`. Figures and
tables use the class name as the name of the estimator.
"""

import flexaxis as fx
from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P


class Gentle:
    """Smooth the estimates of the recursive prediction-error method with a low-pass filter."""

    names, output = ("k_T", "1/J_a", "f_m"), "speed"

    def __init__(self, nominal, period, smooth=0.99):
        P0 = known_P(self.names, forgetting=0.99)
        self.inside = Rpem(three_mass(nominal), P0=P0, period=period, forgetting=0.99)
        self.smooth, self.theta = smooth, None

    def step(self, u, y):
        """Process the torque u[k] and the speed y[k], and return the estimates θ[k]."""
        new = self.inside.step(u, y)
        old = new if self.theta is None else self.theta
        self.theta = self.smooth * old + (1 - self.smooth) * new
        return self.theta


record = fx.simulate("fm_double-v1", seed=0)
axes = fx.estimate(record, "rpem-forgetting").plot("f_m", band=False)
fx.estimate(record, Gentle).plot("f_m", ax=axes, band=False)
axes.lines[-1].set(color="tab:red", linestyle="--")
axes.legend()
