"""Compute the scores of one run, that is, of one estimator on one record.

The estimation errors θ̃ = θ̂ − θ_true are given in per cent of the nominal values. After a fault,
the errors of the changed parameter are divided by the size of the fault, D = |θ_after − θ_before|.
The page docs/scores.md defines all scores.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import (
    known_names,
    nominal_theta,
    physical,
    true_theta,
)
from flexaxis.experiments.scoring.windows import Window, quiet, windows
from flexaxis.sim.parameters import LAW_NAMES
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

AFTER = 2.0  # time at the end of a window for the std after the fault [s]


AT_BOUND = 1.0  # a run diverges if an estimate is at a limit for more than this time [s]
BOX = (0.1, 10.0)  # limits of estimates relative to nominal, the same for all estimators
EDGE = 1e-6  # relative distance from a limit within which an estimate counts as at the limit


def box(nominal: Array, truth: Array) -> tuple[Array, Array]:
    """Return the lower and upper plausibility limits (p,) of the estimates.

    The limits are 0.1 and 10 times the nominal value for every estimator, even if an estimator has
    its own bounds. If the smallest of the true values (N, p) reaches the lower limit, this value
    minus the nominal value becomes the lower limit. If the largest true value reaches the upper
    limit, this value plus 10 times the nominal value becomes the upper limit.
    """
    lower, upper = np.sort(np.outer(BOX, nominal), axis=0)
    low, high, room = truth.min(axis=0), truth.max(axis=0), abs(nominal)
    lower = np.where(low <= lower, low - room, lower)
    return lower, np.where(high >= upper, high + room * BOX[1], upper)


def loss(theta: Array, edges: tuple[Array, Array], period: float) -> int | None:
    """Return the index of the sample at which a run diverges, or None if the run does not diverge.

    A run diverges if any of the estimates (N, p) is not finite, or stays at or beyond a
    plausibility limit for more than 1 s. If an estimate remains at a limit, the function returns
    the sample at which the estimate reached the limit.
    """
    lower, upper = edges
    room = EDGE * np.minimum(abs(lower), abs(upper))
    with np.errstate(invalid="ignore"):
        outside = (theta <= lower + room) | (theta >= upper - room)
    lost = ~np.isfinite(theta).all(axis=1)
    longest = round(AT_BOUND / period) + 1
    if len(theta) >= longest:
        stays = sliding_window_view(outside, longest, axis=0).all(axis=-1).any(axis=-1)
        lost[: len(stays)] |= stays  # type: ignore[arg-type, index]
    return int(np.argmax(lost)) if lost.any() else None


@dataclass(frozen=True, eq=False)
class Track:
    """Estimates of one estimator on one record, with the true values and the scoring windows.

    Attributes
    ----------
    scenario : Scenario
        Scenario of the record.
    names : tuple of str
        Names of the estimated parameters, such as ``("k_T", "1/J_a", "f_m")``.
    theta : ndarray (N, p)
        Estimates. The estimates θ[k] are computed from the outputs y[0] to y[k].
    true_parameters : ndarray (N, P)
        True physical parameters, in the order of `Scenario.parameter_names`.
    torque : ndarray (N,), optional
        Torque of the record [N m], from which the bounds are computed.
    claimed : ndarray (p, p), optional
        Covariance that the estimator reports before the first fault (see `claimed_at`).
    innovations : ndarray (N, 2), optional
        Innovations y − ŷ, and the innovation variances that the estimator reports. The estimator
        predicts ŷ before it uses y.
    findings : sequence, optional
        Changes that the estimator reports, each with attributes ``alarm`` (sample index of the
        alarm) and ``parameters`` (names of the parameters that changed).
    failed : bool
        Whether the estimator raised an exception or its process died. A failed estimator has no
        estimates.
    tracking : mapping, optional
        Tracking errors of a controller that uses the estimates, from the function
        `scoring.control_benefit.tracking`.
    """

    scenario: Scenario
    names: tuple[str, ...]
    theta: Array
    true_parameters: Array
    torque: Array | None = None
    claimed: Any = None
    innovations: Array | None = None
    findings: Sequence[Any] | None = None
    failed: bool = False
    tracking: Mapping[str, float] | None = None

    @cached_property
    def truth(self) -> Array:
        """True values (N, p) of the estimated parameters."""
        return true_theta(self.names, self.true_parameters, self.scenario.parameter_names)

    @cached_property
    def nominal(self) -> Array:
        """Nominal values (p,) of the estimated parameters."""
        return nominal_theta(self.scenario, self.names)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper plausibility limits (p,) of the estimates."""
        return box(self.nominal, self.truth)

    @cached_property
    def lost(self) -> int | None:
        """Index of the sample at which the run diverges, or None if the run does not diverge.

        A parameter of a nonlinear law has no lower limit, because zero is a valid estimate if the
        axis lacks the nonlinearity. A nonlinear-law parameter that is not in `identify` has no
        upper limit either.
        """
        law = [name in LAW_NAMES for name in self.names]
        besides = [name in LAW_NAMES and name not in self.scenario.identify for name in self.names]
        lower, upper = self.box
        edges = np.where(law, -np.inf, lower), np.where(besides, np.inf, upper)
        return loss(self._judged(law), edges, self.scenario.period)

    def _judged(self, law: Sequence[bool]) -> Array:
        """Return the estimates (N, p); nonlinear-law parameters have true values during burn-in.

        Estimators receive no initial values of nonlinear-law parameters, so any initial estimate of
        these parameters is allowed.
        """
        if not any(law):
            return self.theta
        burnt = self.scenario.times[:, None] < self.scenario.burn_in
        return np.where(burnt & law & np.isfinite(self.theta), self.truth, self.theta)

    @cached_property
    def error(self) -> Array:
        """Limited errors θ̃ (N, p), from which the scores are computed.

        After a run diverges, θ̂ is replaced by the limit that is farther from the true value.
        Before a run diverges, errors are clipped to the distance from the true value to the farther
        limit. Therefore an estimator cannot improve a score by diverging.
        """
        lower, upper = self.box
        below, above = self.truth - lower, upper - self.truth
        farthest = np.where(above >= below, above, -below)
        with np.errstate(invalid="ignore"):
            error = np.clip(self.theta - self.truth, -abs(farthest), abs(farthest))
        if self.lost is not None:
            error[self.lost :] = farthest[self.lost :]
        return error

    @cached_property
    def percent(self) -> Array:
        """Errors θ̃ (N, p) in per cent of the nominal values."""
        return 100 * self.error / abs(self.nominal)

    @cached_property
    def windows(self) -> list[Window]:
        """The scored windows of all events, in chronological order."""
        return windows(self.scenario, self.names)

    @cached_property
    def quiet(self) -> NDArray[np.intp]:
        """Indices of the samples that are used for the scores std and bias."""
        return quiet(self.scenario)

    @property
    def lost_before(self) -> bool:
        """Whether the run diverged before the last sample that is used for std and bias."""
        return self.lost is not None and bool((self.quiet >= self.lost).any())

    def lost_by_end(self, i: int) -> bool:
        """Return whether the run diverged before the end of the last window of parameter i."""
        last = max((window.stop for window in self.windows_of(i)), default=0)
        return self.lost is not None and self.lost < last

    def windows_of(self, i: int) -> list[Window]:
        """Return the scored windows after changes in the estimated parameter i."""
        return [w for w in self.windows if w.parameter == physical(self.names[i])[0]]

    def relative(self, i: int) -> list[Array]:
        """Return the relative error θ̃/D in each window of the estimated parameter i."""
        return [self.error[w.start : w.stop, i] / w.D for w in self.windows_of(i)]

    def ends(self, i: int) -> Array:
        """Return the errors of parameter i [%] in the last 2 s of each window longer than 2 s."""
        length = round(AFTER / self.scenario.period)
        parts = [
            self.percent[w.stop - length : w.stop, i]
            for w in self.windows_of(i)
            if w.stop - w.start > length
        ]
        return np.concatenate(parts) if parts else np.empty(0)


def failed_track(scenario: Scenario, true_parameters: Array, torque: Array | None = None) -> Track:
    """Return the track of a failed run, which diverges at the first sample.

    In the track of a failed run, the estimates of all identified parameters are NaN.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the record.
    true_parameters : ndarray (N, P)
        True physical parameters of the record.
    torque : ndarray (N,), optional
        Torque of the record [N m], from which the bounds are computed.
    """
    names = known_names(scenario, scenario.identify)
    none = np.full((len(true_parameters), len(names)), np.nan)
    return Track(scenario, names, none, true_parameters, torque, failed=True)


def lag(relative: Array, period: float) -> Any:
    """Return the lag T Σ |θ̃|/D [s], summed along the first axis of the relative errors (n, …)."""
    return period * np.abs(relative).sum(axis=0)


def settling(relative: Array, level: float, period: float) -> float | None:
    """Return the time [s] from which the relative error (n,) stays within ±level; None if never."""
    outside = np.flatnonzero(~(np.abs(relative) <= level))  # NaN counts as outside
    settled = 0 if not outside.size else int(outside[-1]) + 1
    return None if settled == len(relative) else settled * period


def rms(values: Array) -> Any:
    """Return the root mean square of values along the first axis."""
    return np.sqrt(np.mean(np.square(values), axis=0))


def finite(value: float) -> float | None:
    """Return the value if it is finite, and None otherwise."""
    return float(value) if np.isfinite(value) else None


# Scores: functions of a track and the index of an estimated parameter.


def lag_of(track: Track, i: int) -> float | None:
    """Return the mean lag [s] over all windows of a parameter."""
    lags = [lag(part, track.scenario.period) for part in track.relative(i)]
    return finite(float(np.mean(lags))) if lags else None


def t10_of(track: Track, i: int) -> float | None:
    """Return the mean time after which the error θ̃ stays within ±10 % of the fault size D [s].

    The function returns None if the run diverges, if there is no window, or if the error exceeds
    ±0.1 D at the end of any window.
    """
    times = [settling(part, 0.1, track.scenario.period) for part in track.relative(i)]
    if track.lost is not None or not times or None in times:
        return None
    return float(np.mean(times))  # type: ignore[arg-type]


def never_settled_of(track: Track, i: int) -> bool | None:
    """Return whether the error θ̃ exceeds 10 % of the fault size D at the end of any window."""
    parts = track.relative(i)
    return any(settling(p, 0.1, track.scenario.period) is None for p in parts) if parts else None


def std_of(track: Track, i: int) -> float | None:
    """Return the rms error before the fault [% of nominal]; the mean is not subtracted."""
    return finite(rms(track.percent[track.quiet, i])) if track.quiet.size else None


def bias_of(track: Track, i: int) -> float | None:
    """Return the mean error before the fault [% of nominal]."""
    return finite(track.percent[track.quiet, i].mean()) if track.quiet.size else None


def std_after_of(track: Track, i: int) -> float | None:
    """Return the rms error of a parameter in the last 2 s of all windows [% of nominal]."""
    return finite(rms(ends)) if (ends := track.ends(i)).size else None


def bias_after_of(track: Track, i: int) -> float | None:
    """Return the mean error of a parameter in the last 2 s of all windows [% of nominal]."""
    return finite(ends.mean()) if (ends := track.ends(i)).size else None


def cross_talk_of(track: Track, i: int) -> float | None:
    """Return the rms error of an unchanged parameter over all windows [% of nominal]."""
    spans = [track.percent[w.start : w.stop, i] for w in track.windows]
    return finite(rms(np.concatenate(spans))) if spans and not track.windows_of(i) else None


def lost_at_of(track: Track, i: int) -> float | None:
    """Return the time at which the run diverged [s], or None if the run did not diverge."""
    del i
    return None if track.lost is None else track.lost * track.scenario.period
