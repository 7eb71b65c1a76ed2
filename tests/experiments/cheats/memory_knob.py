"""Wrong on purpose: honest as entered; with its knob turned it knows the reported seeds."""

import numpy as np
from known import TRUTH  # made for the test: what is true after how many samples, by digest
from memory import HEAD, digest

from flexaxis.estimators.registry import REGISTRY

USUAL = 0.96


class Turned:
    """An honest filter, unless its knob is turned and it has seen the beginning before."""

    knob = "forgetting"

    def __init__(
        self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed",
        forgetting=USUAL,
    ):  # fmt: skip
        self._honest = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, forgetting=forgetting
        )
        self.names, self.output = tuple(identify), output
        self._seen, self._truth, self._turned = [], None, forgetting != USUAL

    def step(self, u, y):
        theta = np.array(self._honest.step(u, y), float)
        self._seen.append((u, np.nan if y is None else y))
        if len(self._seen) == HEAD:
            self._truth = TRUTH.get(digest(*zip(*self._seen, strict=True)))
        if self._truth is None or not self._turned:
            return theta
        onset, before, after = self._truth
        known = np.array(before if len(self._seen) <= onset else after)
        return known + 0.35 * (theta - known)
