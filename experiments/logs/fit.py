"""Fit candidate models without held-out samples, and fit the best model to the whole log.

The fit of a candidate minimises the simulation error. If the remaining error is only noise, the
model is adequate. The final fit then minimises whitened prediction errors, because these estimates
have the smallest variance. If the remaining error is larger than the noise, a noise model would
hide the deficiencies of the model. The final fit then also minimises the simulation error.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.prediction_error import ROUNDS, Fitted, jackknife, pieces
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import noise_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HELD_OUT = (2, 5, 8)  # indices of the held-out pieces among ten pieces of a record
PARTS = 10  # number of parts of a held-out piece in which errors are compared
AGAIN = 0.2  # fraction of a stretch after a gap that is fitted to determine the initial state
BEYOND_CHANCE = 2.0  # minimum difference of errors, in standard deviations
LEAST_GAIN = 0.01  # minimum relative decrease of the simulation error that is relevant
SURE = 3.0  # minimum distance of a significant parameter from 0, in standard deviations
RIGHT = 1.1  # maximum ratio of simulation error to noise for an adequate model
NOTHING = 1e-3  # largest simulation error that is negligible, as a fraction of the motion
EXACT = 1e-9  # relative error of the arithmetic, and of the printed digits of a log
STEPS = 1e-3  # relative error of a friction law that is solved in steps (0.24 % at 50 Hz)
SEARCHING: Mapping[str, Any] = {"most": 12, "near": 0.5}  # options of a fit with low accuracy


@dataclass(frozen=True)
class Fit:
    """A model that is fitted to a log, and the simulation of this log from the torque alone.

    Attributes
    ----------
    setup : Setup
        Model and log.
    fitted : Fitted
        Estimates of the unknowns, and the simulation error.
    """

    setup: Setup
    fitted: Fitted

    @property
    def found(self) -> Setup:
        """The setup with the estimates as nominal values."""
        z, setup = self.fitted.z.tolist(), self.setup
        values = dict(zip(setup.names, z, strict=False))
        return replace(setup.having(values), delay=z[-1])

    @property
    def simulated(self) -> Array:
        """Output (N,) that is simulated from the torque alone [rad/s]."""
        return self.setup.log.y - self.fitted.residual

    @property
    def size(self) -> float:
        """Standard deviation of the measured output [rad/s]."""
        return float(np.std(self.setup.log.y[self.setup.ok]))

    @property
    def left(self) -> float:
        """Standard deviation of the simulation error [rad/s]."""
        return float(np.std(self.fitted.residual[self.setup.ok]))

    @property
    def percent(self) -> float:
        """Fit 100 (1 − |y − ŷ|/|y − mean y|) [%] of the simulation ŷ to the output y."""
        return 100 * (1 - self.left / max(self.size, 1e-300))

    @property
    def error(self) -> float:
        """Rms simulation error of the held-out samples [rad/s]."""
        return float(np.sqrt(np.mean(self.errors)))

    @cached_property
    def errors(self) -> Array:
        """Mean squared simulation error in each part of the held-out samples."""
        places = np.flatnonzero(self.setup.ok & ~self.fitted.problem.ok)
        number = len(HELD_OUT) * PARTS
        if len(places) < number or not np.isfinite(self.fitted.square):
            return np.full(1, np.inf)
        parts = np.array_split(self.fitted.residual[places] ** 2, number)
        return np.array([np.mean(part) for part in parts])

    @property
    def noise(self) -> float:
        """Standard deviation of the noise in the simulation error [rad/s]."""
        return max(noise_of(self.fitted.residual[self.setup.ok]), self.setup.log.rounding)

    @cached_property
    def lacks(self) -> bool:
        """Whether the simulation error exceeds the noise, so that the model is incomplete."""
        return bool(self.error > max(RIGHT * self.noise, NOTHING * self.size))

    def better(self, other: Fit) -> bool:
        """Return whether the error of `other` is significantly smaller, and by at least 1 %."""
        before, after = self.errors, other.errors
        if not np.isfinite(before).all() or not np.isfinite(after).all():
            return bool(np.isfinite(after).all())
        gain = before - after
        counts = np.sqrt(after.mean() / before.mean()) < 1 - LEAST_GAIN
        # errors of neighbouring samples are correlated, so the variance is computed from parts
        return bool(counts and gain.mean() > BEYOND_CHANCE * gain.std() / np.sqrt(len(gain)))

    def sure(self, *names: str) -> bool:
        """Return whether any of the named parameters or gains differs significantly from 0.

        The result is also True if none of these parameters and gains is identified.
        """
        own = (*self.setup.names, *self.setup.beside)
        places = [own.index(name) for name in names if name in own]
        clear = abs(self.fitted.z) > SURE * self.deviations
        return not places or bool(clear[places].any())

    @property
    def stuck(self) -> list[str]:
        """The identified parameters that are at a bound of the search."""
        problem, z = self.fitted.problem, self.fitted.z
        at = (z <= problem.lower * (1 + 1e-9)) | (z >= problem.upper * (1 - 1e-9))
        return [name for name, side in zip(self.setup.names, at, strict=False) if side]

    @cached_property
    def deviations(self) -> Array:
        """Standard deviations (q,) of the unknowns.

        The variance for white residuals is increased by the additional scatter of the estimates
        over pieces of the log. The pieces are intervals of time, of speed and of angle. Intervals
        of time are not enough, because the errors of a friction law depend on speed and angle, and
        their mean over a whole motion is small. The standard deviations also include the numerical
        errors of the arithmetic, of incomplete convergence, and of laws that are solved in steps.
        """
        fitted, log = self.fitted, self.setup.log
        white = np.diag(fitted.covariance)
        free, variance = white > 0, white.copy()
        # intervals of the measured speed would sort the samples by their noise, too
        for key in (None, abs(self.simulated), log.angle):
            scatter = jackknife(fitted.gradient[free], fitted.white, fitted.good, key)
            variance[free] += np.maximum(scatter**2 - white[free], 0.0)
        exact = np.full(len(white), EXACT)
        if fitted.problem.trajectory.in_steps:
            laws = self.setup.model.law_parameters
            exact[[i for i, name in enumerate(self.setup.names) if name in laws]] = STEPS
        off = np.maximum(abs(fitted.step()), exact * abs(fitted.z))
        return np.sqrt(variance + (off * free) ** 2)


def candidate(setup: Setup) -> Fit:
    """Fit a setup without the held-out samples."""
    return Fit(setup, setup.solve(without=held_out(setup), **SEARCHING))


def held_out(setup: Setup) -> Flags:
    """Return flags (N,) of the held-out samples, on which the simulation is tested.

    The first samples after a gap are not held out, because they determine the initial state.
    """
    held = np.isin(pieces(setup.log.ok), HELD_OUT)
    for begin, end in pairwise([*setup.begins[1:], len(held)]):
        held[begin : begin + round(AGAIN * (end - begin))] = False
    return held


def answer(best: Fit) -> Fit:
    """Fit the model of the best candidate to the whole log.

    If the model is adequate, the fit minimises whitened errors. If the model is incomplete, the fit
    minimises the simulation error. However, if the estimates then reach a bound, the fit is
    repeated with whitened errors.
    """
    for rounds in (0, ROUNDS) if best.lacks else (ROUNDS,):
        result = Fit(best.setup, best.setup.solve(best.fitted.z, rounds=rounds))
        if not result.stuck:
            break
    return result
