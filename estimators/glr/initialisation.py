"""
The initialisation, which learns the structure of an axis from the first seconds of motion.

The filter first processes the initialisation samples in the same way as all other samples.
Parameters that the initialisation samples hardly excite are then fixed at their nominal values.
After that, the filter processes the initialisation samples repeatedly, as long as the likelihood
increases.

Each pass over the initialisation samples starts from the latest estimates. The initial information
matrix of a pass is P(0)⁻¹ + D. The additional information D is one tenth of the information matrix
after the samples have been processed for the first time. If a pass started with the prior
information P(0)⁻¹ alone, the first samples would cause large updates, and the estimates of the pass
would be unreliable. At the end of each pass, the additional information D is subtracted from the
information matrix P⁻¹, so no sample is counted twice. Let θ₀ be the prior mean, and let θ₀ + δ be
the initial estimate of a pass. After D has been subtracted, the correction P (D (θ − θ₀ − δ) −
P(0)⁻¹ δ) is added to the final estimate θ of the pass.
"""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.glr.workspace import Workspace
from flexaxis.estimators.offline.roles import seen

Array = NDArray[np.float64]

PASSES = 6  # largest number of passes
NEAR = 0.3  # standard deviations, largest change of θ in the last pass
CLEAR = 3.0  # standard deviations above zero at which friction, backlash or stiffening is present
OPEN = 10.0  # ratio of the initial variance of a pass to the variance after the first processing:
# small enough for an almost linear model, and large enough for the data to determine the result

LEAST = 0.9  # limit of the eigenvalues of P D, which the random walk of θ can bring close to one


class FirstSeconds:
    """
    The sequence of filter passes over the initialisation data.

    Parameters
    ----------
    work : Workspace
        Memory of the glr estimator.
    """

    def __init__(self, work: Workspace) -> None:
        self._work, self._left = work, PASSES
        self._best: tuple[Array, int] | None = None  # memory of the best pass, and its next sample
        self._cost = np.inf  # −2 ln of the likelihood of the best pass
        self._next: Array | None = None  # initial θ of the next pass, if one is due

    def begin(self) -> dict[str, str]:
        """Fix the parameters that the data hardly excite; return the reason for each fixed one."""
        work, bank, p = self._work, self._work.bank, self._work.p
        theta, P = work.states["theta"][0], work.states["P"][0]
        variance, told = np.diag(P)[:p], work.told
        known, absent = seen(variance, np.diag(work.design.P0)), theta**2 < CLEAR**2 * variance
        fixed = [i for i in work.fixable if not known[i] or (told[i] == 0.0 and absent[i])]
        self._shapeless = [  # shape parameters of friction that is absent
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
        """Start another pass over the initialisation data from the estimate θ (p,)."""
        work, begin = self._work, self._work.begin["X"][0]
        xi = np.r_[theta, begin[: len(self._start) - work.p, 0]]
        work.go_through(xi, self._start, int(work.bank["born"]), first=False, end=None)
        work.states["X"][1], self._from = begin, theta

    def go_on(self) -> None:
        """
        Evaluate a pass over the initialisation data, and set up the next pass if necessary.

        The evaluation of a pass requires the computing time of many samples, and so does the setup
        of the next pass. The two steps therefore take place after different samples.
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
        """Schedule a further pass from θ (p,), or restore the result of the best pass so far."""
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
        """Remove the additional information D from the estimate θ (p,) and covariance P (m, w)."""
        work, free = self._work, self._free
        columns, root = P[:, free].copy(), np.linalg.cholesky(self._open)
        left, ways = np.linalg.eigh(root.T @ columns[free] @ root)  # eigenvalues of P D, below one
        ways = columns @ root @ ways / np.sqrt(1.0 - np.minimum(left, LEAST))
        P[:, : len(P)] += ways @ ways.T
        gained = self._open @ (theta - self._from)[free]
        gained -= self._prior @ (self._from - work.begin["theta"][0])[free]
        work.move(P[:, free] @ gained)
