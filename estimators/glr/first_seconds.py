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

NEAR = 0.3  # standard deviations that another pass may still want
CLEAR = 3.0  # standard deviations above zero, from which on friction, play and stiffening are there
OPEN = 10.0  # times the variance of what is learnt, with which it begins a pass: near enough for
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
        self._work = work
        self._fixed: list[int] = []
        self._shapeless: list[int] = []  # what friction that is not there would be shaped by
        self._free = np.arange(work.p)
        self._open = np.zeros((work.p, work.p))  # what a start knows besides the prior
        self._from = np.empty(0)
        self._next: Array | None = None  # where a pass begins that is still to be set up
        self._best: tuple | None = None  # cost, record, and the sample that it has come to
        self._left = work.timing.passes
        self._catches_up = False

    def begin(self) -> dict[str, str]:
        """Fix parameters without excitation and return them with the reasons."""
        work, bank, P = self._work, self._work.bank, self._work.states["P"][0]
        theta, variance = work.states["theta"][0], np.diag(P)[: work.p]
        known, absent = seen(variance, np.diag(work.design.P0)), theta**2 < CLEAR**2 * variance
        fixable = [work.names.index(n) for n in work.fixable if n in work.names[work.tracked :]]
        fixed = [i for i in fixable if not known[i] or (work.told[i] == 0.0 and absent[i])]
        self._shapeless = [
            i for levels, of in work.shapes.items() if absent[list(levels)].all() for i in of
        ]
        held = np.flatnonzero(np.diag(work.begin["P"][0])[: work.p] == 0).tolist()
        self._fixed = [*fixed, *self._shapeless, *held]
        P[:, self._fixed] = P[self._fixed] = 0.0
        for i in (*fixed, *self._shapeless):
            theta[i] = work.told.get(i, work.begin["theta"][0, i])
        if fixed:
            bank["variance"][np.isin(work.jumps.which, fixed)] = 0.0
        bank["mark"] = bank["taken"]
        free = np.flatnonzero(np.diag(P)[: work.p] > 0)
        self._free, learnt = free, P[np.ix_(free, free)]
        self._open = np.linalg.inv(OPEN * learnt)
        self._next, bank["busy"], bank["end"] = theta.copy(), 1, bank["at"]
        return {work.names[i]: work.fixable[work.names[i]] for i in fixed}

    def _pass(self, theta: Array) -> None:
        work, begin = self._work, self._work.begin
        P, n, free = begin["P"][0].copy(), begin["gain"].shape[1] - work.p, self._free
        P[:, self._fixed] = P[self._fixed] = 0.0
        told = np.linalg.inv(P[np.ix_(free, free)])
        P[np.ix_(free, free)] = np.linalg.inv(told + self._open)
        start = np.r_[theta, begin["X"][0, :n, 0]]
        work.go_through(start, P, int(work.bank["born"]), first=False, follow=True)
        work.states["X"][1] = begin["X"][0]
        self._from = theta

    def go_on(self) -> bool:
        """
        Go on from where a pass has come to; return whether it was the last.

        A pass is judged after one sample and the next one set up after another, as either takes as
        long as many samples.
        """
        work, bank = self._work, self._work.bank
        if self._next is not None:
            self._pass(self._next)
            self._next = None
            return False
        if not self._catches_up:
            theta, deviation = self._weigh_once()
            cost = float(bank["cost_first"]) if np.isfinite(theta).all() else np.inf
            better = self._best is None or cost < self._best[0]
            if better:
                self._best = cost, work.states.block[1].copy(), int(bank["at"])
            free = deviation > 0
            step = np.abs((theta - self._from)[free] / deviation[free]).max(initial=0.0)
            self._left -= 1
            if better and step > NEAR and self._left:
                self._next = theta
                return False
            assert self._best is not None
            work.states.block[1], bank["at"] = self._best[1:]
            bank["end"], self._catches_up = bank["taken"], True
        if work.caught_up:
            if np.isfinite(work.states["theta"][1]).all():
                P = work.states["P"][1]
                P[self._shapeless, self._shapeless] = np.diag(work.design.P0)[self._shapeless]
                work.adopt()
            work.empty()
            bank["awake"] = 1
        return not work.busy

    def _weigh_once(self) -> tuple[Array, Array]:
        """Take back what the start of a pass has added; return θ and its deviations (p,)."""
        work, p = self._work, self._work.p
        theta, whole = work.states["theta"][1], work.states["P"][1]
        free, m = self._free, len(whole)
        P = whole[:, free].copy()
        if not np.isfinite(P).all():  # the pass has come to nothing, and is left
            theta[:] = np.nan
            return np.full(p, np.nan), np.zeros(p)
        root = np.linalg.cholesky(self._open)
        told, ways = np.linalg.eigh(root.T @ P[free] @ root)  # of P D, which is below one
        ways = root @ ways / np.sqrt(1.0 - np.minimum(told, LEAST))
        whole[:, :m] += P @ ways @ (P @ ways).T
        apart = self._from - work.begin["theta"][0]
        apart[self._fixed] = 0.0
        gained = self._open @ (theta - self._from)[free]
        gained -= np.linalg.solve(work.design.P0, apart)[free]
        work.move(whole[:, free] @ gained)
        return theta.copy(), np.sqrt(np.maximum(np.diag(whole)[:p], 0.0))
