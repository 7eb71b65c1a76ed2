"""
Detect, rewind, refit: a recursive filter that finds out what has changed, and when.

The main filter is the prediction-error method with forgetting, its state corrected. A CUSUM on
its whitened residual raises an alarm. Then hypotheses, "parameter i changed at sample k₀", with i
any physical parameter of the model, identified or not, are screened to first order, and the likely
ones fitted to the data since. The one with the most evidence wins, if it explains enough and leads
clearly. The filter goes back to k₀, takes the fitted value, and runs through the data again.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import make_design
from flexaxis.estimators.recursion.kernel import filter_records
from flexaxis.estimators.relocate.case import RECENT, Case, Finding, open_case
from flexaxis.estimators.relocate.hypotheses import Hypotheses
from flexaxis.estimators.relocate.memory import (
    LENGTH,
    ORDER,
    watched_loop,
    watched_state_type,
    watched_tuning_type,
    widened,
)
from flexaxis.estimators.relocate.refit import Change, Past
from flexaxis.estimators.relocate.suspects import with_suspects
from flexaxis.estimators.sampling.pattern import split
from flexaxis.estimators.sampling.sampled import terms
from flexaxis.estimators.signals import check_sample, check_signals

Array = NDArray[np.float64]

GROWTH = (4.0, 1.6)  # of the residual's variance, that raise an alarm
WARM_UP = 200  # samples before the first alarm
LOOKS = (0, 1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 50, 64, 80, 100)  # after an alarm
SETTLED = 400  # samples after which a change of an unidentified parameter is taken as known


class Relocate:
    """
    Prediction-error method that rewinds and refits after an abrupt change.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    identify : sequence of str
        Parameters to estimate, or their inverses.
    suspects : sequence of str
        Parameters that are not estimated but may change; a change of one is found, named and
        put into the model.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        P(0), for a noise variance of one.
    period : float
        Sampling period T [s].
    forgetting : float
        λ of the main filter.
    alarm : float
        Evidence at which the residual is looked into [nats].
    gain : float
        Evidence that a change needs to be accepted [nats].
    bounds : (lower, upper), optional
        Box of θ; 0.1 to 10 times θ(0) by default.
    output : {"speed", "increment"}
        What y is.

    Attributes
    ----------
    names, output, bounds
        As given.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        Its claimed covariance, R̂ P/2.
    alarm : bool
        Whether a change was found in the last sample.
    findings : tuple of Finding
        All that was found, the latest with its present value.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] = ("k_T", "1/J_a", "f_m"),
        suspects: Sequence[str] = (),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float = 0.005,
        forgetting: float = 0.995,
        alarm: float = 10.0,
        gain: float = 14.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
    ) -> None:
        narrow = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting,
            drift=None,
            regularization=0.0,
            bounds=bounds,
            output=output,
        )
        self.names, self.output = narrow.model.names, output
        self.bounds = narrow.bounds
        self._scale = narrow.scale
        self._p, self._gain = len(self.names), gain
        design = with_suspects(narrow, model, suspects)
        pattern, coefficients = split(design.model)
        tuning, start = filter_records(design, pattern, coefficients)
        self._tuning = widened(tuning, watched_tuning_type(pattern))
        self._tuning["threshold"], self._tuning["growth"] = alarm, GROWTH
        self._start = widened(start, watched_state_type(pattern))
        self._start["stop"] = WARM_UP
        self._start["learning"], self._start["colour"][0, ORDER] = 1, 1.0
        order, substeps = int(tuning["order"][0]), int(tuning["substeps"][0])
        self._hypotheses = Hypotheses(
            terms=terms(design.model, order, substeps, period),
            box=(design.lower, design.upper),
            identified=self._p,
            forgetting=narrow.forgetting,
        )
        self._wide_names = design.model.names
        self._loop = watched_loop(pattern)
        self._hypotheses.warm_up(design.theta0)
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self._state = self._start.copy()
        self._case: Case | None = None
        self._found: list[Finding] = []
        self._free: list[tuple[int, int]] = []  # unidentified parameter, count to freeze it at
        self.alarm = False

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._state["theta"][0, : self._p] * self._scale

    @property
    def covariance(self) -> Array:  # noqa: D102
        claim = self._state["noise"][0] * self._state["P"][0, : self._p, : self._p] / 2
        return claim * np.outer(self._scale, self._scale)

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return tuple(self._found)

    def step(self, u: float, y: float | None) -> Array:
        """
        Take one sample and return θ[k] (p,); y is None in a gap.

        Parameters
        ----------
        u : float
            Torque held from t_k on.
        y : float or None
            Output measured at t_k.
        """
        check_sample(u, y)
        return self.run([u], [0.0 if y is None else y], [y is not None])[0]

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Take N samples, from the current state on, and return θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
        valid : (N,) array_like of bool, optional
            False where y is missing.
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), self._p))
        state = self._state[0]
        done = 0
        while done < len(u):
            before = int(state["count"])
            self.alarm = False
            self._loop(
                self._tuning, self._state, u[done:], y[done:], present[done:], estimates[done:]
            )
            done += int(state["count"]) - before
            self._attend()
            estimates[done - 1] = state["theta"][: self._p]
        return estimates * self._scale

    def _attend(self) -> None:
        """Do what is due after a sample: open a case, look into it, or close it."""
        state = self._state[0]
        ringing = state["armed"] and state["evidence"].max() > self._tuning["threshold"][0]
        if not ringing and state["count"] != state["stop"]:
            return
        if ringing:
            self._case = open_case(state)
        if self._case is not None:
            self._look(self._case)
        elif state["count"] == WARM_UP:
            self._arm()
        self._freeze()
        self._set_stop()

    def _look(self, case: Case) -> None:
        state = self._state[0]
        age = int(state["count"]) - 1 - case.alarm
        if age in LOOKS:
            self._judge(case)
        if age >= LOOKS[-1]:
            self._close(case)

    def _arm(self) -> None:
        state = self._state[0]
        state["armed"] = state["learning"] = 1
        state["evidence"], state["quiet"] = 0.0, state["count"]

    def _set_stop(self) -> None:
        count = int(self._state["count"][0])
        due = [when for _, when in self._free]
        if self._case is not None:
            due += [self._case.alarm + 1 + age for age in LOOKS]
        if count < WARM_UP:
            due.append(WARM_UP)
        self._state["stop"] = min((when for when in due if when > count), default=-1)

    def _judge(self, case: Case) -> None:
        """Compare the hypotheses on the data so far, and take up the best if it is good enough."""
        past = self._hypotheses.past(self._state[0], case)
        if len(past.u) < 2:
            return
        found = self._hypotheses.compare(case, past)
        age = int(self._state["count"][0]) - 1 - case.alarm
        if not case.borne_out(found, len(past.u)):
            self._retract(case, past)
        elif case.convinced(found, age, self._gain):
            self._take_up(case, past, found.change, found.active)

    def _retract(self, case: Case, past: Past) -> None:
        """Take back a change that later data do not bear out."""
        if case.active is not None:
            onset = min(case.onset - case.first, len(past.theta) - 1)
            same = Change(onset, past.theta[onset], 0.0, 0.0)
            self._take_up(case, past, same, np.arange(0))

    def _take_up(self, case: Case, past: Past, change: Change, active: NDArray[np.int64]) -> None:
        """Rewind to a change, and write down what changed, or how that is seen now."""
        self._hypotheses.rewind(self._state[0], case, past, change, active)
        if case.active is None:
            self.alarm = True
            self._found.append(Finding(int(self._state["count"][0]) - 1, case.onset, (), ()))
        case.active, case.before = active, past.theta[change.onset]
        self._update_finding(case)

    def _update_finding(self, case: Case) -> None:
        assert case.active is not None and case.before is not None  # a change was accepted
        ratio = self._state["theta"][0, case.active] / case.before[case.active]
        self._found[-1] = replace(
            self._found[-1],
            onset=case.onset,
            parameters=tuple(self._wide_names[i] for i in case.active),
            ratio=tuple(ratio.tolist()),
        )

    def _close(self, case: Case) -> None:
        """End a case; where the residual stays large, say so and take it as the new noise."""
        state = self._state[0]
        count = int(state["count"])
        if case.unsettled():
            recent = np.arange(count - RECENT, count) % LENGTH
            squares = state["past_epsilon"][recent] ** 2 / state["past_scale"][recent]
            state["noise"] = np.mean(squares)
            if case.active is None:
                self.alarm = True
                self._found.append(Finding(count - 1, case.onset, (), ()))
        if case.active is not None:
            self._update_finding(case)
            self._free += [(int(i), count + SETTLED) for i in case.active if i >= self._p]
        self._case = None
        self._arm()

    def _freeze(self) -> None:
        """Fix unidentified parameters at what they have been found to be."""
        state = self._state[0]
        for i, when in self._free:
            if when == state["count"]:
                state["P"][i, :] = state["P"][:, i] = 0.0
        self._free = [(i, when) for i, when in self._free if when > state["count"]]
