"""Wrong on purpose: given all samples at once, it looks at those that come."""

import numpy as np

from flexaxis.estimators.registry import REGISTRY

AHEAD = 150


class Ahead:
    """An honest filter, whose estimates of some time later are given now."""

    def __init__(
        self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed", torque=None
    ):
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque
        )
        self.names, self.output, self.step = tuple(identify), output, self._honest.step

    def run(self, u, y):
        theta = self._honest.run(u, y)
        return np.concatenate([theta[AHEAD:], theta[-AHEAD:]]) if len(theta) > AHEAD else theta
