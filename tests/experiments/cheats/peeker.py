"""Wrong on purpose: looks for the truth among the objects of the process that it runs in."""

import gc

import numpy as np

from flexaxis.estimators.registry import REGISTRY


class Peeker:
    """An honest filter, unless the record it is run on lies about in memory."""

    def __init__(
        self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed", torque=None
    ):
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque
        )
        self.names, self.output = tuple(identify), output

    def step(self, u, y):
        return self._honest.step(u, y)

    def run(self, u, y):
        theta = self._honest.run(u, y)
        for found in gc.get_objects():
            if type(found).__name__ != "Record" or not hasattr(found, "true_parameters"):
                continue
            if np.array_equal(found.torque, u):
                names = list(found.parameter_names)
                for column, name in enumerate(self.names):
                    truth = found.true_parameters[:, names.index(name.removeprefix("1/"))]
                    truth = 1 / truth if name.startswith("1/") else truth
                    theta[:, column] = truth + 0.02 * (theta[:, column] - truth)
        return theta
