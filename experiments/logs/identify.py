"""Nominal values of an axis from its log: frequency response, then output error in white noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexaxis.estimators.models.model import Model, increment
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.offline.delay import delay_slope, delayed
from flexaxis.estimators.offline.identification import Identified, output_error
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.logs.axis_file import Axis, is_smooth, output_of, usable
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.spectrum import (
    Response,
    fit_response,
    measured_response,
    rough_guess,
)
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HIGHEST_ORDER = 60  # of the model of the noise
ROUNDS = 8
BLIND = 0.5  # relative standard deviation from which on a parameter counts as not seen
GIVEN = ("k_T", "r")  # scale of the torque and gear ratio: no log of one axis determines them


@dataclass(frozen=True)
class Identification:
    """What was identified from a record, and how far it can be trusted.

    Attributes
    ----------
    axis : Axis
        With the new nominal values, delay, whitening filter and noise.
    names : tuple of str
        The identified parameters.
    theta, deviations : ndarray (p,)
        Estimates and standard deviations. These are for white residuals; an error of the model
        itself comes on top.
    delay, delay_deviation : float
        By which the torque acts late [s]; the deviation is zero if it was given.
    fit : float
        100 (1 − |y − ŷ|/|y − mean y|): how well a simulation from the torque alone does.
    result : Identified
        Of the last round of output error, on whitened signals.
    response : Response
        What the log shows without a model.
    output : str
        What was fitted, ``"speed"`` or ``"increment"``.
    residual : ndarray (N,)
        y − ŷ of the simulation.
    warnings : tuple of str
    """

    axis: Axis
    names: tuple[str, ...]
    theta: Array
    deviations: Array
    delay: float
    delay_deviation: float
    fit: float
    result: Identified
    response: Response
    output: str
    residual: Array
    warnings: tuple[str, ...]


def identify(
    record: Record,
    axis: Axis,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    delay: float | None = None,
    whiten: bool = True,
) -> Identification:
    """Identify the nominal values of an axis.

    Disturbances of a real axis (friction, ripple, what the model leaves out) are not white: they
    are strongest where the axis resonates, and plain output error then fits those frequencies at
    the cost of all others. So residuals are modelled as an autoregression, all signals are
    filtered by its inverse, and the fit is repeated until it stays: the prediction-error method
    for a model of the noise, in the way of D. W. Clarke, *Generalized least squares estimation of
    the parameters of a dynamic model* (IFAC 1967).

    Parameters
    ----------
    record : Record
    axis : Axis
        Its nominal values are where the search starts.
    free : sequence of str
        Parameters to identify; by default all but k_T and r.
    fix : sequence of str
        Parameters to leave at their nominal values.
    delay : float, optional
        Known delay of the torque [s]; it is identified too if not given.
    whiten : bool
        Whether to model the noise; without, this is plain output error.

    Raises
    ------
    LogError
        If a name is unknown, or the record cannot determine such a model.
    """
    output, period = output_of(record), record.period
    u, y = record.torque, np.asarray(getattr(record, output))
    ok, smooth = usable(record), is_smooth(record)
    response = measured_response(u[ok], y[ok], period=period)
    names = _free(axis, free, fix)
    if not axis.known:
        guess = rough_guess(axis.model, response)
        axis = axis.having({name: guess[name] for name in names if name in guess})
    elif axis.known:
        _check_rate(axis.model, period)
    start, lag = fit_response(
        axis.model,
        response,
        identify=names,
        period=period,
        output=output,
        delay=delay,
        earliest=-2 * period if smooth else 0.0,
    )
    model = axis.having(dict(zip(names, start.tolist(), strict=True))).model
    _check_rate(model, period)
    problem = _Problem(model, names, u, y, ok, period, output, smooth, whiten, delay is not None)
    return problem.solve(axis, start, lag, response)


def _free(axis: Axis, free: Sequence[str], fix: Sequence[str]) -> tuple[str, ...]:
    known = axis.model.parameters
    axis.having(dict.fromkeys((*free, *fix), 1.0))  # raises for unknown names
    chosen = tuple(free) or tuple(name for name in known if name not in GIVEN)
    chosen = tuple(name for name in chosen if name not in fix)
    if not chosen:
        raise LogError("all parameters are fixed; leave one free, with --free NAME")
    return chosen


def _check_rate(model: Model, period: float) -> None:
    """Refuse a rate that cannot show the fastest mode."""
    every = model.parametrize(model.parameters)
    modes = np.linalg.eigvals(every.matrices(every.theta)[0])
    fastest = float(np.max(abs(modes.imag)))
    if fastest * period > np.pi:
        raise LogError(
            f"the log's rate of {1 / period:.4g} Hz is below twice the fastest mode of "
            f"{model.name}, {fastest / (2 * np.pi):.4g} Hz: log faster, or use a model without it"
        )


@dataclass(frozen=True)
class _Problem:
    model: Model
    names: tuple[str, ...]
    u: Array
    y: Array
    ok: Flags
    period: float
    output: str
    smooth: bool
    whiten: bool
    delay_known: bool

    def solve(self, axis: Axis, start: Array, lag: float, response: Response) -> Identification:
        """Fit and model the noise in turn."""
        theta, noise_filter = start, np.ones(1)
        lower, upper = np.sort([start * 1e-3, start * 1e3], axis=0)
        for _ in range(ROUNDS if self.whiten else 3):
            before = np.append(theta, lag)
            result = self._fit(theta, lag, noise_filter, (lower, upper))
            theta = result.theta
            residual = self.y - self._simulate(theta, lag)
            if self.whiten:
                noise_filter = noise_model(residual[self.ok], HIGHEST_ORDER)
            step, covariance, spread = self._joint(theta, lag, noise_filter)
            lag += step
            deviations = np.sqrt(np.diag(covariance))
            if np.all(abs(np.append(theta, lag) - before) <= 0.2 * deviations):
                break
        y = self.y[self.ok]
        values = dict(zip(self.names, theta.tolist(), strict=True))
        found = replace(
            axis.having(values),
            known=True,
            delay=lag,
            whitening=tuple(noise_filter.tolist()),
            noise=spread,
        )
        return Identification(
            axis=found,
            names=self.names,
            theta=theta,
            deviations=deviations[:-1],
            delay=lag,
            delay_deviation=0.0 if self.delay_known else float(deviations[-1]),
            fit=100 * float(1 - np.std(residual[self.ok]) / np.std(y)),
            result=result,
            response=response,
            output=self.output,
            residual=residual,
            warnings=(*_blind(self.names, theta, deviations[:-1], response), *result.warnings),
        )

    def _torque(self, lag: float) -> Array:
        return delayed(self.u, lag / self.period, smooth=self.smooth)

    def _parametrization(self) -> Parametrization:
        chosen = self.model if self.output == "speed" else increment(self.model, self.period)
        return chosen.parametrize(self.names)

    def _simulate(self, theta: Array, lag: float) -> Array:
        return predict(self._parametrization(), theta, self._torque(lag), period=self.period)[0]

    def _fit(
        self, start: Array, lag: float, noise_filter: Array, box: tuple[Array, Array]
    ) -> Identified:
        margin = 1e-5 * (box[1] - box[0])
        return output_error(
            self.model,
            lfilter(noise_filter, 1.0, self._torque(lag)),
            lfilter(noise_filter, 1.0, self.y),
            identify=self.names,
            start=np.clip(start, box[0] + margin, box[1] - margin),
            period=self.period,
            output=self.output,
            valid=settled(self.ok, len(noise_filter)),
            bounds=box,
        )

    def _joint(self, theta: Array, lag: float, noise_filter: Array) -> tuple[float, Array, float]:
        """Return a step of the delay, the covariance of all, and the whitened residual's spread."""
        model, samples = self._parametrization(), lag / self.period
        u = lfilter(noise_filter, 1.0, self._torque(lag))
        simulated, psi = predict(model, theta, u, period=self.period)
        slope = delay_slope(self.u, samples, smooth=self.smooth) / self.period
        slope, _ = predict(model, theta, lfilter(noise_filter, 1.0, slope), period=self.period)
        ok = settled(self.ok, len(noise_filter))
        gradient = np.column_stack([psi, slope])[ok]
        error = (lfilter(noise_filter, 1.0, self.y) - simulated)[ok]
        spread = float(np.std(error))
        if self.delay_known:
            gradient = gradient[:, :-1]
        scale = np.linalg.norm(gradient, axis=0)
        step, *_ = np.linalg.lstsq(gradient / scale, error)
        inverse = np.linalg.pinv((gradient / scale).T @ (gradient / scale), hermitian=True)
        covariance = spread**2 * inverse / np.outer(scale, scale)
        if self.delay_known:
            return 0.0, np.pad(covariance, (0, 1)), spread
        wanted = float(np.clip(step[-1] / scale[-1], -0.3 * self.period, 0.3 * self.period))
        return (wanted if self.smooth else max(wanted, -lag)), covariance, spread


def settled(ok: Flags, length: int) -> Flags:
    """Return where a filter of some length has seen usable samples only."""
    return np.convolve(~ok, np.ones(length))[: len(ok)] < 0.5


def noise_model(residual: Array, highest: int) -> Array:
    """Return the coefficients (n+1,) of an autoregression, 1, a₁, …, a_n, of the best order.

    By the recursion of Levinson and Durbin; the order is the one of the least Bayesian information
    criterion, N log σ² + n log N.
    """
    e = residual - residual.mean()
    N, highest = len(e), min(highest, len(e) // 20)
    r = np.array([e[: N - k] @ e[k:] for k in range(highest + 1)]) / N
    a, variance = np.ones(1), r[0]
    best, least = a, N * np.log(variance)
    for n in range(1, highest + 1):
        reflection = -(a @ r[n:0:-1]) / variance
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        variance *= 1 - reflection**2
        criterion = N * np.log(variance) + n * np.log(N)
        if criterion < least:
            best, least = a, criterion
    return best


def _blind(names: Sequence[str], theta: Array, deviations: Array, response: Response) -> list[str]:
    low, high = response.omega[[0, -1]] / (2 * np.pi)
    return [
        f"the excitation ({low:.3g} … {high:.3g} Hz) cannot see {name}: known to "
        f"±{100 * s / abs(value):.0f} %; fix it with --fix {name}=VALUE, or excite what it acts on"
        for name, value, s in zip(names, theta, deviations, strict=True)
        if not s < BLIND * abs(value)
    ]
