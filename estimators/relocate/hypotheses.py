"""The hypotheses of `relocate`: what may have changed, compared on the past and taken up."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.case import LOOK_BACK, Case, Comparison, State
from flexaxis.estimators.relocate.memory import LENGTH, ORDER
from flexaxis.estimators.relocate.refit import Change, Past, explain, replay
from flexaxis.estimators.relocate.screen import screen
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

SPREAD = 0.5  # of a change, relative to the value before
UNLIKELY = 2.0  # nats against a change of what is not identified
SEVERAL = 6.0  # nats against a change of all identified parameters at once
FAR, MOST = 20.0, 3  # nats behind the leader, and number, of hypotheses that are fitted at a look
AHEAD = 60  # samples before the first sign of a change in which it is looked for


class Screened(NamedTuple):
    """Time and value after it of a change of each parameter, and what it gains, (p,) arrays."""

    onset: NDArray[np.int64]
    theta: Array
    gain: Array


@dataclass(frozen=True)
class Hypotheses:
    """
    Each single parameter, and all identified ones at once.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    box : (lower, upper), each (p,)
        Where the parameters may be.
    identified : int
        How many of the parameters, the first, are identified.
    forgetting : float
        λ of the main filter.
    """

    terms: Terms
    box: tuple[Array, Array]
    identified: int
    forgetting: float

    @cached_property
    def choices(self) -> list[NDArray[np.int64]]:
        """Which parameters each hypothesis lets change."""
        several = [np.arange(self.identified)] if self.identified > 1 else []
        return [np.array([i]) for i in range(len(self.box[0]))] + several

    @cached_property
    def costs(self) -> list[float]:
        """Evidence against each before any data [nats]."""
        single = [0.0 if i < self.identified else UNLIKELY for i in range(len(self.box[0]))]
        return single + ([SEVERAL] if self.identified > 1 else [])

    def warm_up(self, theta: Array) -> None:
        """Let everything compile now rather than at the first alarm."""
        p, n = len(theta), self.terms.n
        one, present, rest = np.zeros(1), np.ones(1, bool), np.zeros((1, n))
        before, white = np.zeros(1 + ORDER), np.zeros(ORDER)
        past = Past(theta[None], rest, one, one, one, present, before, white, 1.0)
        self._fit(past, np.arange(1), 0, theta)
        screen(self.terms, theta, rest[0], one, one, present, 1.0, *self.box, SPREAD)
        X, P = np.zeros((1 + p, n + 1)), np.zeros((p, p))
        replay(self.terms, theta, X, P, one, one, present, 1.0)

    def past(self, state: State, case: Case) -> Past:
        """Return the past from which a change may date, up to the last measurement."""
        count = int(state["count"])
        first = max(case.alarm - LOOK_BACK, count + 1 - LENGTH, 0)
        ring = np.arange(first, count) % LENGTH
        able = ring[: max(case.alarm - first, 1)]
        scale = state["past_scale"][ring]
        weights, remains = case.colour[:-1], case.colour[-1]
        earlier = np.arange(first - ORDER, count)
        epsilon = np.where(earlier < 0, 0.0, state["past_epsilon"][earlier % LENGTH])
        relative = epsilon / np.sqrt(np.r_[np.ones(ORDER), scale])
        white = np.convolve(relative, np.r_[1.0, -weights])[ORDER : len(relative)]
        case.white = white / np.sqrt(remains * case.variance)
        case.first, case.likelihood = first, np.cumsum(-(case.white**2 + np.log(scale)) / 2)
        return Past(
            theta=state["past_theta"][able],
            x=np.ascontiguousarray(state["past_X"][able, : self.terms.n, 0]),
            likelihood=case.likelihood[: len(able)],
            u=state["past_u"][ring[:-1]],
            y=state["past_y"][ring[1:]],
            present=state["past_valid"][ring[1:]] > 0,
            epsilon=epsilon,
            colour=weights,
            variance=remains * case.variance,
        )

    def compare(self, case: Case, past: Past) -> Comparison:
        """Fit those hypotheses that may be true, and return the best."""
        seen = self._screen(case, past)
        odds = np.full(len(self.choices), -np.inf)
        changes = {}
        for i in self._contenders(case, seen.gain):
            changes[i] = self._explain(case, past, i, seen)
            odds[i] = changes[i].evidence - self.costs[i]
        best = int(np.argmax(odds))
        case.odds, case.leader = odds, best
        others = odds[: len(self.box[0])].copy()  # without "several", which is true of each single
        others[best : best + 1] = -np.inf
        return Comparison(self.choices[best], changes[best], odds[best], odds[best] - others.max())

    def _contenders(self, case: Case, gains: Array) -> NDArray[np.int64]:
        """Return the hypotheses that were, or to first order are, not far behind the leader."""
        screened = np.array([np.max(gains[active]) for active in self.choices]) - self.costs
        behind = screened.max() - screened
        if case.odds is not None:
            behind = np.minimum(behind, case.odds.max() - case.odds)
        return np.array([i for i in np.argsort(behind, kind="stable")[:MOST] if behind[i] < FAR])

    def _screen(self, case: Case, past: Past) -> Screened:
        """Return time, size and gain of a change of each parameter, to first order."""
        start = min(max(case.sign - AHEAD - case.first, 0), len(past.theta) - 1)
        onset, change, gain = screen(
            self.terms,
            past.theta[start],
            past.x[start],
            past.u[start:],
            past.y[start:],
            past.present[start:],
            case.variance,
            *self.box,
            SPREAD,
        )
        onset = np.minimum(onset + start, len(past.theta) - 1)
        return Screened(onset, np.clip(past.theta[start] + change, *self.box), gain)

    def _explain(self, case: Case, past: Past, choice: int, seen: Screened) -> Change:
        """Fit one hypothesis, from where it was at the last look and from where it is seen now."""
        active, found = self.choices[choice], []
        if choice in case.explained:
            onset, theta = case.explained[choice]
            onset = min(max(onset - case.first, 0), len(past.theta) - 1)
            found.append(self._fit(past, active, onset, theta))
        best = active[np.argmax(seen.gain[active])]
        onset = int(seen.onset[best])
        if not found or abs(onset - found[0].onset) > 1:
            theta = past.theta[onset].copy()
            if len(active) == 1:
                theta[best] = seen.theta[best]
            found.append(self._fit(past, active, onset, theta))
        change = max(found, key=lambda change: change.evidence)
        case.explained[choice] = case.first + change.onset, change.theta
        return change

    def _fit(self, past: Past, active: NDArray[np.int64], guess: int, theta: Array) -> Change:
        return Change(*explain(self.terms, past, active, *self.box, SPREAD, guess, theta))

    def rewind(
        self,
        state: State,
        case: Case,
        past: Past,
        change: Change,
        active: NDArray[np.int64],
    ) -> None:
        """Put the main filter back to the onset, and run it through the data again."""
        case.onset = case.first + change.onset
        p, n, now = len(self.box[0]), self.terms.n, int(state["count"]) - 1
        j = case.onset % LENGTH
        X = np.zeros((1 + p, n + 1))
        X[:, :n] = state["past_X"][j, :n, : 1 + p].T
        X[1 + active] = 0.0  # what changes now had no influence before
        P = state["past_P"][j].copy()
        P[active, :] = P[:, active] = 0.0
        P[active, active] = (SPREAD * past.theta[change.onset, active]) ** 2 / case.variance
        delta = replay(
            self.terms,
            change.theta,
            X,
            P,
            np.r_[past.u[change.onset :], state["past_u"][now % LENGTH]],
            np.r_[past.y[change.onset :], 0.0],
            np.r_[past.present[change.onset :], False],  # the next sample is only predicted
            self.forgetting,
        )
        theta = np.clip(change.theta + delta, *self.box)
        X[0] += (theta - change.theta) @ X[1:]
        state["theta"], state["P"], state["X"][:, : 1 + p] = theta, P, X.T
        state["noise"] = case.variance
