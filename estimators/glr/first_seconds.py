"""
Initialisation: the structure of an axis is learnt from the first seconds of motion.

The filter processes them once like all other samples. Parameters that they hardly excite are then
fixed at their nominal values. The same samples are filtered again, each time from the latest
estimates, as long as the likelihood grows.

A pass starts near the latest estimates, with the information D, a tenth of theirs, in addition to
the prior P(0)⁻¹: from P(0) alone, the first samples throw a filter so far that it may end anywhere.
No sample counts twice. At the end D is subtracted from P⁻¹, and the estimate θ, which started at
θ₀ + δ for the prior θ₀, moves by P (D (θ − θ₀ − δ) − P(0)⁻¹ δ) with the new P.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.glr.workspace import Workspace
from flexaxis.estimators.offline.roles import seen

Array = NDArray[np.float64]

PASSES = 6  # largest number of passes
NEAR = 0.3  # standard deviations that another pass may still want
CLEAR = 3.0  # standard deviations above zero, from which on friction, play and stiffening are there
OPEN = 10.0  # times the variance of what is learnt, with which a pass begins: near enough for
# the model to be linear there, and far enough for the data to decide

LEAST = 0.9  # of the variance with which a pass begins; the walk of θ may leave as much of it


class FirstSeconds:
    """
    The progress of the passes over the initialisation data.

    Parameters
    ----------
    work : Workspace
    """

    def __init__(self, work: Workspace) -> None:
        self._work, self._left = work, PASSES
        self._best: tuple[Array, int] | None = None  # record, and the sample that it has come to
        self._cost = np.inf  # −2 ln of the likelihood of the best pass
        self._next: Array | None = None  # where a pass begins that is still to be set up

    def begin(self) -> dict[str, str]:
        """Fix parameters without excitation and return them with the reasons."""
        work, bank, p = self._work, self._work.bank, self._work.p
        theta, P = work.states["theta"][0], work.states["P"][0]
        variance, told = np.diag(P)[:p], work.told
        known, absent = seen(variance, np.diag(work.design.P0)), theta**2 < CLEAR**2 * variance
        fixed = [i for i in work.fixable if not known[i] or (told[i] == 0.0 and absent[i])]
        self._shapeless = [  # what friction that is not there would be shaped by
            i for levels, of in work.shapes if absent[levels].all() for i in of
        ]
        self._fixed = [*fixed, *self._shapeless]
        P[:, self._fixed] = P[self._fixed] = 0.0
        for i in self._fixed:
            theta[i] = told.get(i, work.begin["theta"][0, i])
        bank["variance"][np.isin(bank["which"], fixed)] = 0.0
        self._free = np.flatnonzero(np.diag(P)[:p] > 0)
        block = np.ix_(self._free, self._free)
        self._start = work.begin["P"][0].copy()
        self._start[:, self._fixed] = self._start[self._fixed] = 0.0
        self._prior = np.linalg.inv(self._start[block])
        self._open = np.linalg.inv(OPEN * P[block])
        self._start[block] = np.linalg.inv(self._prior + self._open)
        self._next = theta.copy()
        bank["mark"], bank["busy"], bank["end"] = bank["taken"], 1, bank["at"]
        return {work.names[i]: work.fixable[i] for i in fixed}

    def _pass(self, theta: Array) -> None:
        """Filter the samples again from θ (p,)."""
        work, begin = self._work, self._work.begin["X"][0]
        xi = np.r_[theta, begin[: len(self._start) - work.p, 0]]
        work.go_through(xi, self._start, int(work.bank["born"]), first=False, end=None)
        work.states["X"][1], self._from = begin, theta

    def go_on(self) -> None:
        """
        Go on from where a pass has come to.

        A pass is judged after one sample and the next one set up after another, as either takes as
        long as many samples.
        """
        work, states = self._work, self._work.states
        if self._next is not None:
            self._pass(self._next)
            self._next = None
            return
        if self._left:
            self._judge(states["theta"][1], states["P"][1])
        if self._left or not work.caught_up:
            return
        if np.isfinite(states["theta"][1]).all() and np.isfinite(states["P"][1]).all():
            P0 = np.diag(work.design.P0)
            states["P"][1][self._shapeless, self._shapeless] = P0[self._shapeless]
            work.adopt()
        work.empty()
        work.bank["awake"] = 1

    def _judge(self, theta: Array, P: Array) -> None:
        """Begin another pass from θ (p,) if it is worth it, or return to the best pass."""
        bank, block = self._work.bank, self._work.states.block
        self._left -= 1
        if np.isfinite(P).all() and bank["cost_first"] < self._cost:
            self._count_once(theta, P)
            self._best = block[1].copy(), int(bank["at"])
            self._cost, variance = float(bank["cost_first"]), np.diag(P)[: len(theta)]
            steps = (theta - self._from)[variance > 0] ** 2 / variance[variance > 0]
            if self._left and steps.max(initial=0.0) > NEAR**2:
                self._next = theta.copy()
                return
        if self._best is not None:
            block[1], bank["at"] = self._best
        bank["end"], self._left = bank["taken"], 0

    def _count_once(self, theta: Array, P: Array) -> None:
        """Take back what the start of a pass has added to θ (p,) and P (m, w)."""
        work, free = self._work, self._free
        columns, root = P[:, free].copy(), np.linalg.cholesky(self._open)
        left, ways = np.linalg.eigh(root.T @ columns[free] @ root)  # of P D, which is below one
        ways = columns @ root @ ways / np.sqrt(1.0 - np.minimum(left, LEAST))
        P[:, : len(P)] += ways @ ways.T
        gained = self._open @ (theta - self._from)[free]
        gained -= self._prior @ (self._from - work.begin["theta"][0])[free]
        work.move(P[:, free] @ gained)
