"""Where to start a fit: frequency responses of a log, several, judged by the fit itself."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt, Log, explored
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.friction import friction, guessed_level, smooth_sign
from flexaxis.experiments.logs.spectrum import (
    STRONG,
    Response,
    fit_response,
    measured_response,
    rough_guess,
)

Array = NDArray[np.float64]

ENOUGH = 10_000  # samples, to tell which start is the best
SMOOTHER = 10.0  # of the logarithm of the likelihood, that another kind of torque has to gain


@dataclass(frozen=True)
class Starts:
    """What a log offers to start from.

    Attributes
    ----------
    attempt : Attempt
        As the axis was given.
    known : bool
        Whether its nominal values are somebody's, and not a rough guess of their size.
    whole : bool
        Whether the signals are as they were, so that friction can be looked for: no high-pass.
    """

    attempt: Attempt
    known: bool
    whole: bool = True

    @property
    def log(self) -> Log:
        """The log."""
        return self.attempt.log

    def level(self) -> float:
        """Return about how much dry friction there is, in units of the torque."""
        log = self.log
        return guessed_level(log.u[log.ok], log.y[log.ok], period=log.period)

    def response(self, level: float = 0.0, floor: float = STRONG) -> Response:
        """Return the frequency response from the torque less some dry friction."""
        log = self.log
        u, y = log.u[log.ok], log.y[log.ok]
        if level:
            u = u - friction(u, y, smooth_sign(y, log.period), level)
        return measured_response(u, y, period=log.period, floor=floor)

    def seen_by(self, attempt: Attempt, fitted: Fitted) -> Response | None:
        """Return the frequency response without the dry friction that was found."""
        values = {"k_T": 1.0} | dict(attempt.model.nominal) | attempt.values(fitted)
        level = values.get("f_c", 0.0) if attempt.model.laws else 0.0
        try:
            return self.response(level / values["k_T"])
        except LogError:
            return None

    def search(self, attempt: Attempt, level: float = 0.0) -> tuple[Attempt, Fitted]:
        """Fit from each start for two rounds, and on from the best."""
        short = replace(attempt, log=attempt.log.part(ENOUGH))
        first = explored(short, self.places(attempt, level))
        if not np.isfinite(first.square):
            raise LogError(
                "no start could be simulated over the log: give nominal values of the right size, "
                "with --start NAME=VALUE"
            )
        if short.log is attempt.log:
            return attempt, attempt.solve(first.z)
        # a part has an initial state of its own, so that no more than parameters are taken from it
        return attempt, attempt.solve(first.z[: len(attempt.names)], float(first.z[-1]))

    def places(self, attempt: Attempt, level: float) -> list[tuple[Array, float]]:
        """Return parameters and delays [s] to start from."""
        found, problems = [], []
        for floor in (STRONG, 0.0):
            try:
                seen = self.response(level, floor)
            except LogError as error:
                problems.append(error)
                continue
            found.append(self._place(attempt, seen))
        if self.known:
            theta = attempt.model.parametrize(attempt.names).theta
            found.append((theta, 0.0))
        if not found:
            raise problems[0]
        return found

    def _place(self, attempt: Attempt, seen: Response) -> tuple[Array, float]:
        names = attempt.names
        linear = replace(attempt.model, laws=())
        mine = tuple(name for name in names if name in linear.parameters)
        if not self.known and linear.name in MODELS:
            guess = rough_guess(linear, seen)
            values = {name: guess[name] for name in mine if name in guess}
            linear = replace(linear, nominal=dict(linear.nominal) | values)
        theta, lag = fit_response(
            linear,
            seen,
            identify=mine,
            period=self.log.period,
            output=self.log.output,
            delay=attempt.delay,
            earliest=attempt.earliest,
        )
        values = dict(attempt.model.nominal) | dict(zip(mine, theta.tolist(), strict=True))
        return np.array([values[name] for name in names]), lag


def linear_fit(starts: Starts) -> tuple[Attempt, Fitted]:
    """Fit the linear model; where its torque seems to act before it is set, as a smooth one too."""
    attempt, fitted = starts.search(starts.attempt)
    return smoother(attempt, fitted)


def smoother(attempt: Attempt, fitted: Fitted) -> tuple[Attempt, Fitted]:
    """Return the fit with a smooth torque where that predicts better, else as it is."""
    if attempt.log.smooth or attempt.delay is not None or fitted.z[-1] > 0.02 * attempt.log.period:
        return attempt, fitted
    other = replace(attempt, log=attempt.log.smoothed())
    p = len(attempt.names)
    tried = other.solve(fitted.z[:p], 0.0)
    gained = 0.5 * fitted.good.sum() * np.log(fitted.square / tried.square)
    return (other, tried) if gained > SMOOTHER else (attempt, fitted)
