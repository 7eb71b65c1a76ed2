"""Wrong on purpose: knows the truth of the seeds that everybody can look up, by how they begin."""

import hashlib

import numpy as np
from known import TRUTH  # made for the test: what is true after how many samples, by digest

from flexaxis.estimators.registry import REGISTRY

HEAD = 8


def digest(u, y):
    return hashlib.sha256(np.round([u[:HEAD], y[:HEAD]], 9).tobytes()).hexdigest()[:16]


class Memory:
    """An honest filter, unless it has seen the beginning before."""

    def __init__(
        self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed", torque=None
    ):
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, torque=torque
        )
        self.names, self.output = tuple(identify), output
        self._u, self._y, self._truth = [], [], None

    def step(self, u, y):
        theta = np.array(self._honest.step(u, y), float)
        if len(self._u) < HEAD:
            self._u.append(u)
            self._y.append(np.nan if y is None else y)
            if len(self._u) == HEAD:
                self._truth = TRUTH.get(digest(self._u, self._y))
                self._k = HEAD
            return theta
        self._k += 1
        if self._truth is None:
            return theta
        onset, before, after = self._truth
        known = np.array(before if self._k <= onset else after)
        return known + 0.02 * (theta - known)  # it would look too good otherwise
