"""Candidates: fits of a setup that simulate what is held out. The answer: the fit to the whole log.

Candidates minimise the error of the simulation. Where that leaves only noise, the model is right,
and the answer minimises whitened prediction errors, which are the most certain. Where it leaves
more, a noise model would hide what the model lacks, and the answer minimises the error of the
simulation too.
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

HELD_OUT = (2, 5, 8)  # of ten pieces of a record
PARTS = 10  # of a held-out piece, over which errors are compared
AGAIN = 0.2  # share of a stretch behind a gap that shows in which state it begins
BEYOND_CHANCE = 2.0  # standard deviations of the difference of errors
LEAST_GAIN = 0.01  # least relative fall of the error of a simulation that counts
SURE = 3.0  # standard deviations from 0, below which a level of friction counts as 0
RIGHT = 1.1  # error of a simulation over its noise, above which the model lacks something
NOTHING = 1e-3  # share of the motion, below which an error does not count
EXACT = 1e-9  # relative error of arithmetic, and of a log of that many digits
STEPS = 1e-3  # relative error of a law that is solved in steps: 0.24 % at 50 Hz
SEARCHING: Mapping[str, Any] = {"most": 12, "near": 0.5}  # of a fit of which being near is enough


@dataclass(frozen=True)
class Candidate:
    """A setup fitted to what is not held out.

    Attributes
    ----------
    setup : Setup
    fitted : Fitted
    held : ndarray (N,) of bool
        Samples that are held out.
    """

    setup: Setup
    fitted: Fitted
    held: Flags

    @property
    def error(self) -> float:
        """Standard deviation of the error of a simulation of what is held out."""
        return float(np.sqrt(np.mean(self.errors)))

    @cached_property
    def errors(self) -> Array:
        """Mean squares of the errors of a simulation, in parts of what is held out."""
        places = np.flatnonzero(self.held & self.setup.ok)
        number = len(HELD_OUT) * PARTS
        if len(places) < number or not np.isfinite(self.fitted.square):
            return np.full(1, np.inf)
        parts = np.array_split(self.fitted.residual[places] ** 2, number)
        return np.array([np.mean(part) for part in parts])

    @cached_property
    def lacks(self) -> bool:
        """Whether a simulation leaves more than noise: the model lacks something."""
        ok, log = self.setup.ok, self.setup.log
        noise = max(noise_of(self.fitted.residual[ok]), log.rounding)
        return bool(self.error > max(RIGHT * noise, NOTHING * float(np.std(log.y[ok]))))

    def better(self, other: Candidate) -> bool:
        """Return whether another one simulates better, beyond chance and by a size that counts."""
        before, after = self.errors, other.errors
        if not np.isfinite(before).all() or not np.isfinite(after).all():
            return bool(np.isfinite(after).all())
        gain = before - after
        counts = np.sqrt(after.mean() / before.mean()) < 1 - LEAST_GAIN
        # the variance of the difference from parts, as errors nearby are not independent
        return bool(counts and gain.mean() > BEYOND_CHANCE * gain.std() / np.sqrt(len(gain)))

    def sure(self, *names: str) -> bool:
        """Return whether a parameter or gain differs from 0 beyond its deviations, or is fixed."""
        own = (*self.setup.names, *self.setup.beside)
        places = [own.index(name) for name in names if name in own]
        sd = deviations_of(self.setup, self.fitted)[places]
        return not places or bool((abs(self.fitted.z[places]) > SURE * sd).any())


def candidate(setup: Setup, theta: Array, lag: float) -> Candidate:
    """Return a setup fitted to what is not held out, from parameters and a delay [s]."""
    held = held_out(setup)
    return Candidate(setup, setup.solve(theta, lag, without=held, **SEARCHING), held)


def held_out(setup: Setup) -> Flags:
    """Return which samples (N,) are left out of a fit, to be simulated by it.

    The first samples of a stretch are fitted, as they show in which state it begins.
    """
    held = np.isin(pieces(setup.log.ok), HELD_OUT)
    for begin, end in pairwise([*setup.begins[1:], len(held)]):
        held[begin : begin + round(AGAIN * (end - begin))] = False
    return held


@dataclass(frozen=True)
class Answer:
    """The fit to the whole log.

    Attributes
    ----------
    setup : Setup
    fitted : Fitted
    deviations : ndarray (q,)
        Standard deviations of its unknowns.
    """

    setup: Setup
    fitted: Fitted
    deviations: Array

    @property
    def stuck(self) -> list[str]:
        """The parameters at a bound of the search."""
        problem, z = self.fitted.problem, self.fitted.z
        at = (z <= problem.lower * (1 + 1e-9)) | (z >= problem.upper * (1 - 1e-9))
        return [name for name, side in zip(self.setup.names, at, strict=False) if side]


def answer(best: Candidate) -> Answer:
    """Return the fit to the whole log, in whitened errors unless the model lacks something.

    If it does, deviations include half of a step towards the fit in whitened errors. That fit is
    the answer where the other one ends at a bound.
    """
    result = _answer(best, 0 if best.lacks else ROUNDS)
    if not best.lacks:
        return result
    if result.stuck:
        return _answer(best, ROUNDS)
    fitted = result.fitted
    whitened = replace(fitted, inverse=fitted.problem.noise(fitted.residual))
    return replace(result, deviations=np.hypot(result.deviations, whitened.step() / 2))


def _answer(best: Candidate, rounds: int) -> Answer:
    fitted = best.setup.solve(best.fitted.z, rounds=rounds)
    return Answer(best.setup, fitted, deviations_of(best.setup, fitted))


def deviations_of(setup: Setup, fitted: Fitted) -> Array:
    """Return standard deviations (q,).

    The larger of what white residuals claim and the spread over pieces of the log; with the errors
    of arithmetic, and of laws that are solved in steps.
    """
    free, spread = np.diag(fitted.covariance) > 0, np.zeros(len(fitted.z))
    spread[free] = jackknife(fitted.gradient[free], fitted.white, fitted.good)
    off = np.maximum(abs(fitted.step()), EXACT * abs(fitted.z))
    if fitted.problem.trajectory.in_steps:
        lawful = [i for i, n in enumerate(setup.names) if n in setup.model.law_parameters]
        off[lawful] = np.maximum(off[lawful], STEPS * abs(fitted.z[lawful]))
    return np.hypot(np.maximum(fitted.deviations, spread), off * free)
