"""Wrong on purpose: keeps what it has seen in a global, and knows the second time what comes."""

import numpy as np

from flexaxis.estimators.registry import REGISTRY

SEEN = {}
AHEAD = 300


class Replay:
    """An honest filter the first time; then that of some time later."""

    knob = "gain"

    def __init__(
        self,
        nominal,
        period,
        *,
        gain=0.005,
        identify=("k_T", "1/J_a", "f_m"),
        output="speed",
        torque=None,
    ):
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque, forgetting=1 - gain
        )
        self.names, self.output = tuple(identify), output
        self._fresh = True

    def step(self, u, y):
        self._fresh = False
        return self._honest.step(u, y)

    def run(self, u, y):
        theta = self._honest.run(u, y)
        if self._fresh and len(u) > 3000:
            key = (len(u), float(u[1]), float(u[2]))
            self._fresh = False
            if key in SEEN:
                return np.concatenate([theta[:AHEAD], SEEN[key][2 * AHEAD :], theta[-AHEAD:]])
            SEEN[key] = theta.copy()
        return theta
