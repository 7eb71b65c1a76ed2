"""
Detect, rewind, refit: a recursive filter that finds out what has changed, and when.

The main filter is the prediction-error method with forgetting, its state corrected. A CUSUM on
its whitened residual raises an alarm. Then hypotheses, "parameter i changed at sample k₀", with i
any physical parameter of the model, identified or not, are judged to first order, and the likely
ones fitted to the data since. The one with the most evidence wins, if it explains enough and leads
clearly. The filter goes back to k₀, takes the fitted value, and runs through the data again.
"""

import math
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import above_zero, make_design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.relocate.finding import Finding
from flexaxis.estimators.relocate.front import Present
from flexaxis.estimators.relocate.judge import Judge
from flexaxis.estimators.relocate.pace import Pace
from flexaxis.estimators.relocate.parts import parts_of
from flexaxis.estimators.relocate.suspects import widened
from flexaxis.estimators.relocate.work import CALL, PAST, PIECES, finished, operations, seconds

Array = NDArray[np.float64]

WAITING = 30.0  # s of samples that may wait; a beginning within 1 ms makes 20 s of them


class Relocate(RecursiveEstimator):
    """
    Prediction-error method that rewinds and refits after an abrupt change.

    Parameters
    ----------
    model : Model
        Grey-box model, such as ``three_mass(nominal)``, with nonlinear laws or without.
    identify : sequence of str, optional
        Parameters to estimate, or their inverses; the model's own choice by default.
    suspects : sequence of str
        Parameters that are not estimated but may change; a change of one is found, named and
        put into the model.
    track, learn : sequence of str
        Parameters that are tracked besides, and that are learnt once and never forgotten, from a
        prior of `flexaxis.estimators.offline.structure`.
    told : sequence of str
        Parameters whose values were given; those of laws that were not get theirs from how the
        axis moves.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        P(0), for a noise variance of one.
    period : float
        Sampling period T [s].
    noise : float, optional
        Standard deviation of y, in its unit; estimated from the residual by default.
    forgetting : float, optional
        λ of the main filter, for a sample; that of a time constant of 1 s by default.
    walk : float, optional
        Standard deviation by which a tracked parameter may have changed after a second, relative to
        θ(0), in the place of forgetting.
    alarm : float
        Evidence at which the residual is looked into [nats].
    gain : float
        Evidence that a change needs to be accepted [nats].
    bounds : (lower, upper), optional
        Box of θ; 0.1 to 10 times θ(0) by default.
    output : {"speed", "increment"}
        What y is.
    x0 : (n,) array_like, optional
        State at the first sample; at rest, zero, by default.
    deadline : float, optional
        Time that a sample may take [s], by operations that are counted; work of an alarm that takes
        longer is spread over the following samples. All at once by default.

    Attributes
    ----------
    names, output, bounds
        As given.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        Its claimed covariance R̂ Σ; of what has just changed, from that of the change.
    alarm : bool
        Whether something was found in the last sample.
    findings : tuple of Finding
        All that was found, the latest with its present value.
    fixed_because : dict of str to str
        What is as it was told, or taken as absent, and why.
    prediction, innovation, innovation_variance, innovations
        As of every `flexaxis.estimators.recursion.filter.RecursiveEstimator`.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    _shared = (*RecursiveEstimator._shared, "_design", "_roles")

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        suspects: Sequence[str] = (),
        track: Sequence[str] = (),
        learn: Sequence[str] = (),
        told: Sequence[str] = (),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float,
        noise: float | None = None,
        forgetting: float | None = None,
        walk: float | None = None,
        alarm: float = 10.0,
        gain: float = 14.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
        x0: ArrayLike | None = None,
        deadline: float | None = None,
    ) -> None:
        narrow = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting if walk is None else 1.0,
            bounds=bounds,
            output=output,
            noise=noise,
            x0=x0,
        )
        above_zero("alarm", alarm, "evidence in nats, such as 10")
        above_zero("gain", gain, "evidence in nats, such as 14")
        self._design, self._roles = widened(
            narrow, model, track=track, learn=learn, told=told, suspects=suspects
        )
        self._p = p = self._roles.tracked
        lower, upper = self._design.bounds
        super().__init__(self._design.model.names[:p], output, (lower[:p], upper[:p]))
        budget = math.inf if deadline is None else operations(deadline)
        parts = parts_of(
            self._design,
            self._roles,
            model=model,
            told=told,
            walk=0.0 if walk is None else above_zero("walk", walk, "a relative deviation in 1 s"),
            alarm=alarm,
            gain=gain,
            grain=budget / PIECES,
        )
        pieces = parts.memory.longest, parts.commission.longest
        least = max(2 * PAST, *pieces, CALL + 2 * parts.sample)  # it has to catch up
        if budget < least:
            raise EstimatorError(
                f"deadline = {deadline} s is too short: the longest piece of work that cannot be "
                f"cut takes {seconds(least):.2g} s; give more, or none"
            )
        self._judge = Judge(parts, self._design, self._roles, grain=budget / PIECES)
        self._pace = None
        if deadline is not None:
            self._pace = Pace(self._judge, budget, parts.sample, round(WAITING / period))
        self._warm_up()

    def _warm_up(self) -> None:
        """Let everything compile now rather than at the first alarm."""
        self.reset()
        self.run(np.zeros(3), np.zeros(3))
        finished(self._judge.warm_up())
        self.reset()

    def _start(self) -> None:
        self._judge.reset()
        if self._pace is not None:
            self._pace.reset()
        self.alarm = False

    def copy(self) -> Self:  # noqa: D102
        other = super().copy()
        if other._pace is not None:
            other._pace.judge = other._judge
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to copy; what there is to be done is done before."""
        if self._pace is not None:
            self._pace.hasten()
        return dict(vars(self))

    @property
    def _now(self) -> Present:
        if self._pace is not None and self._pace.front is not None:
            return self._pace.front.state
        return self._judge.memory.state

    @property
    def theta(self) -> Array:  # noqa: D102
        return (self._now["theta"] * self._design.scale)[: self._p]

    @property
    def covariance(self) -> Array:  # noqa: D102
        state, scale = self._now, self._design.scale[: self._p]
        return state["noise"] * state["claim"][: self._p, : self._p] * np.outer(scale, scale)

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return tuple(self._judge.found) if self._pace is None else self._pace.told

    @property
    def fixed_because(self) -> dict[str, str]:
        """What is not learnt once as it might be, and why."""
        return dict(self._judge.commission.fixed_because)

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done = 0
        while done < len(u):
            samples = u[done:], y[done:], valid[done:], estimates[done:], trace[done:]
            if self._pace is None:
                done += self._judge.memory.run(*samples)
                self.alarm = self._attend()
            else:
                done += self._pace.run(*samples)
                self.alarm = self._pace.go_on()
            estimates[done - 1] = self._now["theta"][: self._p]
        estimates *= self._design.scale[: self._p]

    def _attend(self) -> bool:
        """Do what is due after a sample, at once; return whether something has been found."""
        known = len(self._judge.found)
        with np.errstate(all="ignore"):  # a filter that diverges is a result
            finished(self._judge.attend(present=True))
        return len(self._judge.found) > known
