"""The hypotheses of `relocate`: what may have changed, compared on the past and taken up."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.history import LENGTH
from flexaxis.estimators.refit import Change, Past, explain, replay
from flexaxis.estimators.sampled import Terms

Array = NDArray[np.float64]
State = Any  # record of `flexaxis.estimators.history.watched_state_type`

SPREAD = 0.5  # of a change, relative to the value before
UNLIKELY = 6.0  # nats against a change of what is not identified
SEVERAL = 6.0  # nats against a change of all identified parameters at once
LOOK_BACK = 200  # samples before an alarm in which the change may lie
COARSE, FINE = np.array([-24, -12, -6, -3, 3, 6]), np.array([], int)  # onsets to try


@dataclass(frozen=True)
class Finding:
    """
    A change that was found.

    Attributes
    ----------
    alarm : int
        Sample at which it was found.
    onset : int
        Sample after which the parameters were different.
    parameters : tuple of str
        What changed; empty for an unmodelled change, which no hypothesis explains.
    ratio : tuple of float
        New value over the value before, for each.
    """

    alarm: int
    onset: int
    parameters: tuple[str, ...]
    ratio: tuple[float, ...]


@dataclass
class Case:
    """An alarm that is being looked into."""

    alarm: int
    onset: int
    variance: float  # of the noise, before
    repeated: float  # residuals that tell as much as a white one, before
    first: int = 0  # sample from which a change may date
    likelihood: Array = field(default_factory=lambda: np.empty(0))  # of the main filter, from there
    leader: int = -1  # hypothesis with the most evidence
    active: NDArray[np.int64] | None = None  # accepted hypothesis
    before: Array | None = None  # all parameters, before the change
    explained: dict[int, tuple[int, Array]] = field(default_factory=dict)  # onset and θ by choice


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

    @property
    def choices(self) -> list[NDArray[np.int64]]:
        """Which parameters each hypothesis lets change."""
        several = [np.arange(self.identified)] if self.identified > 1 else []
        return [np.array([i]) for i in range(len(self.box[0]))] + several

    @property
    def costs(self) -> list[float]:
        """Evidence against each before any data [nats]."""
        single = [0.0 if i < self.identified else UNLIKELY for i in range(len(self.box[0]))]
        return single + ([SEVERAL] if self.identified > 1 else [])

    def past(self, state: State, case: Case) -> Past:
        """Return the past from which a change may date, up to the last measurement."""
        count = int(state["count"])
        first = max(case.alarm - LOOK_BACK, count + 1 - LENGTH, 0)
        ring = np.arange(first, count) % LENGTH
        able = ring[: max(case.alarm - first, 1)]
        scale = state["past_scale"][ring]
        squares = state["past_epsilon"][ring] ** 2 / (case.variance * scale)
        case.first, case.likelihood = first, np.cumsum(-(squares + np.log(scale)) / 2)
        return Past(
            theta=state["past_theta"][able],
            x=np.ascontiguousarray(state["past_X"][able, : self.terms.n, 0]),
            likelihood=case.likelihood[: len(able)],
            u=state["past_u"][ring[:-1]],
            y=state["past_y"][ring[1:]],
            present=state["past_valid"][ring[1:]] > 0,
            variance=case.variance,
        )

    def compare(self, case: Case, past: Past) -> tuple[int, Change, float]:
        """Return the best hypothesis, what it says, and its evidence less its cost."""
        choices = self.choices
        changes = [self._explain(case, past, i, active) for i, active in enumerate(choices)]
        odds = [change.evidence - cost for change, cost in zip(changes, self.costs, strict=True)]
        case.leader = int(np.argmax(odds))
        return case.leader, changes[case.leader], odds[case.leader]

    def _explain(self, case: Case, past: Past, choice: int, active: NDArray[np.int64]) -> Change:
        """Fit one hypothesis, from where it was at the last look."""
        onset, theta = case.explained.get(choice, (case.onset, None))
        guess = min(max(onset - case.first, 0), len(past.theta) - 1)
        onset, theta, evidence, unexplained = explain(
            self.terms,
            past,
            active,
            *self.box,
            SPREAD,
            guess,
            past.theta[guess] if theta is None else theta,
            COARSE if theta is None or choice == case.leader else FINE,
        )
        case.explained[choice] = case.first + onset, theta
        return Change(onset, theta, evidence, unexplained)

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
