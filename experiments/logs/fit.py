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
class Candidate:
    """A model of a log, and its fit to the samples that are not held out.

    Attributes
    ----------
    setup : Setup
        Model and log.
    fitted : Fitted
        Fit to the samples that are not held out.
    held : ndarray (N,) of bool
        Samples that are held out.
    """

    setup: Setup
    fitted: Fitted
    held: Flags

    @property
    def error(self) -> float:
        """Rms simulation error of the held-out samples [rad/s]."""
        return float(np.sqrt(np.mean(self.errors)))

    @cached_property
    def errors(self) -> Array:
        """Mean squared simulation error in each part of the held-out samples."""
        places = np.flatnonzero(self.held & self.setup.ok)
        number = len(HELD_OUT) * PARTS
        if len(places) < number or not np.isfinite(self.fitted.square):
            return np.full(1, np.inf)
        parts = np.array_split(self.fitted.residual[places] ** 2, number)
        return np.array([np.mean(part) for part in parts])

    @cached_property
    def lacks(self) -> bool:
        """Whether the simulation error exceeds the noise, so that the model is incomplete."""
        ok, log = self.setup.ok, self.setup.log
        noise = max(noise_of(self.fitted.residual[ok]), log.rounding)
        return bool(self.error > max(RIGHT * noise, NOTHING * float(np.std(log.y[ok]))))

    def better(self, other: Candidate) -> bool:
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
        """Standard deviations (q,) of the unknowns."""
        return deviations_of(self.setup, self.fitted)


def candidate(setup: Setup, theta: Array, lag: float) -> Candidate:
    """Fit a setup without the held-out samples, starting at `theta` and the delay `lag` [s]."""
    held = held_out(setup)
    return Candidate(setup, setup.solve(theta, lag, without=held, **SEARCHING), held)


def held_out(setup: Setup) -> Flags:
    """Return flags (N,) of the held-out samples, on which the simulation is tested.

    The first samples after a gap are not held out, because they determine the initial state.
    """
    held = np.isin(pieces(setup.log.ok), HELD_OUT)
    for begin, end in pairwise([*setup.begins[1:], len(held)]):
        held[begin : begin + round(AGAIN * (end - begin))] = False
    return held


def answer(best: Candidate) -> Candidate:
    """Fit the model of the best candidate to the whole log.

    If the model is adequate, the fit minimises whitened errors. If the model is incomplete, the fit
    minimises the simulation error. However, if the estimates then reach a bound, the fit is
    repeated with whitened errors.
    """
    for rounds in (0, ROUNDS) if best.lacks else (ROUNDS,):
        result = replace(best, fitted=best.setup.solve(best.fitted.z, rounds=rounds))
        if not result.stuck:
            break
    return result


def deviations_of(setup: Setup, fitted: Fitted) -> Array:
    """Return the standard deviations (q,) of the unknowns of a fit.

    The variance for white residuals is increased by the additional scatter of the estimates over
    pieces of the log. The pieces are intervals of time, of speed and of angle. Intervals of time
    are not enough, because the errors of a friction law depend on speed and angle, and their mean
    over a whole motion is small. Finally, the function adds the numerical errors of the arithmetic,
    of incomplete convergence, and of laws that are solved in steps.
    """
    white = np.diag(fitted.covariance)
    free, log, variance = white > 0, setup.log, white.copy()
    # intervals of the measured speed would sort the samples by their noise, too
    speed = abs(log.y - fitted.residual)
    for key in (None, speed, log.angle):
        scatter = jackknife(fitted.gradient[free], fitted.white, fitted.good, key)
        variance[free] += np.maximum(scatter**2 - white[free], 0.0)
    off = np.maximum(abs(fitted.step()), EXACT * abs(fitted.z))
    if fitted.problem.trajectory.in_steps:
        lawful = [i for i, n in enumerate(setup.names) if n in setup.model.law_parameters]
        off[lawful] = np.maximum(off[lawful], STEPS * abs(fitted.z[lawful]))
    return np.sqrt(variance + (off * free) ** 2)
