"""Give the main filter another past: the only place where one goes back."""

from collections.abc import Container
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.explain import SPREAD
from flexaxis.estimators.relocate.fit import Past
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.opened import Opened
from flexaxis.estimators.relocate.prior import Fitted, Prior
from flexaxis.estimators.relocate.replay import replaying
from flexaxis.estimators.relocate.search import Evaluated
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.relocate.work import CALL, PAST, Work
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rewind:
    """
    How to go back.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    box : (lower, upper), each (p,)
    roles : Roles
        What the main filter does with each parameter.
    fading : (p, p) array
        By what each element of its P is divided in a sample.
    grain : float
        Operations of a piece of the work.
    """

    terms: Terms
    box: tuple[Array, Array]
    roles: Roles
    fading: Array
    grain: float = np.inf

    def to_change(
        self, memory: Memory, case: Opened, past: Past, theta: Array, free: Container[int]
    ) -> Work[None]:
        """
        Go back to a change, and run through the data again as if it had been known.

        Parameters
        ----------
        memory : Memory
            What is rewritten.
        case : Opened
            With time and parameters of the change.
        past : Past
        theta : (p,) array
            All parameters after it.
        free : container of int
            Suspects that are estimated now; all others are taken as known.
        """
        yield 2 * CALL
        row, active = case.before.at(case.onset), case.active
        P, claim = row["P"].copy(), row["claim"].copy()
        n = self.terms.n
        X = np.zeros((1 + len(theta), n + 1))
        X[:, :n] = row["X"][:n, : len(X)].T
        X[1 + active] = 0.0  # what changes now had no influence before
        known = [i for i in range(self.roles.known, len(theta)) if i not in free]
        for M in (P, claim):
            M[known, :] = M[:, known] = M[active, :] = M[:, active] = 0.0
            M[active, active] = (SPREAD * row["theta"][active]) ** 2 / case.normal.variance
        since = case.onset - case.before.first
        signals = past.y[since:], past.present[since:]
        yield from self._run(memory, row, theta, (X, P, claim), signals)

    def to_start(self, memory: Memory, first: int, found: Evaluated, expected: Array) -> Work[None]:
        """Go back to a sample, and begin anew there with parameters that a search has found."""
        yield 2 * PAST
        row, n, mine = memory.beginning(first + 1), self.terms.n, np.arange(self.roles.tracked)
        X, P = np.zeros((1 + len(found.theta), n + 1)), np.zeros_like(row["P"])
        X[0, :n] = memory.state_at(first)
        P[mine, mine] = (SPREAD * expected[mine]) ** 2 / found.square
        yield from self._run(memory, row, found.theta, (X, P, P), memory.signals(first)[1:])

    def to_fit(self, memory: Memory, prior: Prior, fitted: Fitted) -> Work[None]:
        """Go back as far as is remembered, and begin anew near parameters that explain it all."""
        yield 2 * PAST
        (theta, active), first, n = fitted[:2], memory.first, self.terms.n
        X, P, before = np.zeros((1 + len(theta), n + 1)), np.zeros((len(theta),) * 2), theta.copy()
        X[0, :n] = memory.state_at(first)
        P[active, active] = prior.deviation[active] ** 2 / prior.noise
        before[active] = prior.theta[active]
        row, signals = memory.beginning(first + 1), memory.signals(first)[1:]
        yield from self._run(memory, row, theta, (X, P, P), signals, before=before)

    def to_told(self, memory: Memory, theta: Array, noise: float) -> Work[None]:
        """Go back as far as is remembered, and begin anew near what was told, all else fixed."""
        yield 2 * PAST
        first, n, mine = memory.first, self.terms.n, np.arange(self.roles.given)
        X, P = np.zeros((1 + len(theta), n + 1)), np.zeros((len(theta),) * 2)
        P[mine, mine] = SPREAD**2 / noise
        row = memory.beginning(first + 1)
        yield from self._run(memory, row, theta, (X, P, P), memory.signals(first)[1:])

    def _run(
        self,
        memory: Memory,
        row: np.void,
        theta: Array,
        start: tuple[Array, Array, Array],
        signals: tuple[Array, NDArray[np.bool_]],
        *,
        before: Array | None = None,
    ) -> Work[None]:
        u = memory.read("u", int(row["count"]) - 1)
        replayed = yield from replaying(
            self.terms,
            theta,
            *start,
            (u, *signals),
            forgetting=self.fading,
            drift=memory.drift,
            box=self.box,
            before=before,
            grain=self.grain,
        )
        yield from memory.rewriting(row, replayed, grain=self.grain)
