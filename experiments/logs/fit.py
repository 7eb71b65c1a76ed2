"""Two fits of a setup, and the one that is believed; what a simulation of held-out pieces leaves.

Whitened prediction errors are the most certain where the model is right, and what a simulation
leaves is noise. Where it leaves more, a rich model of the noise hides what the model lacks, and
reversals are fitted in place of motion: then white errors are believed. Deviations are the larger
of what white residuals claim and the spread over pieces of the log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.colour import colourless
from flexaxis.estimators.offline.prediction_error import Fitted, jackknife, pieces
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import noise_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HELD_OUT = (2, 5, 8)  # of ten pieces of a record
PARTS = 10  # of a held-out piece, over which errors are compared
AGAIN = 0.2  # share of what lies behind a gap, from which it is told how the axis goes on there
BEYOND_CHANCE = 2.0  # standard deviations of the difference of errors
LEAST_GAIN = 0.01  # part by which the error of a simulation is to fall, to be worth a word
SURE = 3.0  # standard deviations of a level of friction, below which it is none
RIGHT = 1.1  # times its noise, that a simulation leaves where the model is right
NOTHING = 1e-3  # of the motion, of which no more is said
EXACT = 1e-9  # of a parameter, to which arithmetic and a log of that many digits are exact
STEPS = 1e-3  # of a parameter of a law, that solving it in steps is off: 0.24 % at 50 Hz


@dataclass(frozen=True)
class Candidate:
    """A setup fitted to what is not held out, in white and in whitened errors.

    Attributes
    ----------
    setup : Setup
    white, whitened : Fitted
    held : ndarray (N,) of bool
        What was held out.
    """

    setup: Setup
    white: Fitted
    whitened: Fitted
    held: Flags

    @cached_property
    def best(self) -> Fitted:
        """The fit that simulates what was held out best."""
        return min((self.whitened, self.white), key=lambda fit: float(np.mean(self.errors(fit))))

    @property
    def error(self) -> float:
        """Standard deviation of the best simulation of what was held out."""
        return float(np.sqrt(np.mean(self.errors(self.best))))

    @cached_property
    def lacks(self) -> bool:
        """Whether it leaves more than noise: the model has not all that acts."""
        counted, log = self.setup.counted, self.setup.log
        noise = max(noise_of(self.best.residual[counted]), log.rounding)
        return bool(self.error > max(RIGHT * noise, NOTHING * float(np.std(log.y[counted]))))

    def errors(self, fitted: Fitted, highpass: float | None = None) -> Array:
        """Return mean squares of the errors of a simulation, in parts of what was held out.

        Above the corner of the setup, or another one [Hz].
        """
        ok, corner = self.setup.ok, self.setup.highpass if highpass is None else highpass
        colour = colourless(corner, self.setup.log.period)
        high = colour.high(colour.bridged(fitted.residual, ok))
        places = np.flatnonzero(self.held & ok)
        places = places[places >= colour.skip]
        number = len(HELD_OUT) * PARTS
        if len(places) < number or not np.isfinite(fitted.square):
            return np.full(1, np.inf)
        return np.array([np.mean(high[k] ** 2) for k in np.array_split(places, number)])

    def better(self, other: Candidate, highpass: float | None = None) -> bool:
        """Return whether another one simulates better, beyond chance and by what is worth it."""
        before, after = self.errors(self.best, highpass), other.errors(other.best, highpass)
        if not np.isfinite(before).all() or not np.isfinite(after).all():
            return bool(np.isfinite(after).all())
        gain = before - after
        worth = np.sqrt(after.mean() / before.mean()) < 1 - LEAST_GAIN
        # the variance of the difference from parts, as errors nearby are not independent
        return bool(worth and gain.mean() > BEYOND_CHANCE * gain.std() / np.sqrt(len(gain)))

    def sure(self, *names: str) -> bool:
        """Return whether some parameter or gain is one beyond its deviations; if fixed, it is."""
        own = (*self.setup.names, *self.setup.beside)
        places = [own.index(name) for name in names if name in own]
        sd = deviations_of(self.setup, self.best)[places]
        return not places or bool((abs(self.best.z[places]) > SURE * sd).any())


def candidate(setup: Setup, z: Array) -> Candidate:
    """Return a setup fitted to what is not held out, from unknowns z (q,) on."""
    held = held_out(setup)
    white, whitened = (
        replace(setup, whiten=whiten).solve(z, without=held, rounds=5, search=True)
        for whiten in (False, True)
    )
    return Candidate(setup, white, whitened, held)


def held_out(setup: Setup) -> Flags:
    """Return which samples (N,) are left out of a fit that is to be tried on them.

    The first samples of a stretch are fitted: from them it is told in which state it begins.
    """
    number, held = pieces(setup.log.ok), np.zeros(len(setup.log.ok), bool)
    edges = [*setup.begins, len(held)]
    first = [b + round(AGAIN * (e - b)) * (i > 0) for i, (b, e) in enumerate(pairwise(edges))]
    for piece in HELD_OUT:
        places = np.flatnonzero(number == piece)
        runs = [
            (max(b, places[0]), min(e, places[-1] + 1))
            for b, e in zip(first, edges[1:], strict=True)
        ]
        begin, end = max(runs, key=lambda run: run[1] - run[0])
        held[begin:end] = True
    return held


@dataclass(frozen=True)
class Answer:
    """The fit that is believed.

    Attributes
    ----------
    setup : Setup
    fitted : Fitted
        To the whole log.
    deviations : ndarray (q,)
        Of its unknowns.
    """

    setup: Setup
    fitted: Fitted
    deviations: Array

    @property
    def stuck(self) -> list[str]:
        """The parameters at the bound of the search."""
        problem, z = self.fitted.problem, self.fitted.z
        at = (z <= problem.lower * (1 + 1e-9)) | (z >= problem.upper * (1 - 1e-9))
        return [name for name, side in zip(self.setup.names, at, strict=False) if side]


def answer(best: Candidate) -> Answer:
    """Return the fit to the whole log that is believed.

    Where the model lacks something deviations have half of what the two fits differ by; where it
    lacks nothing, all of it if that is more than twice what both claim.
    """
    fits = []
    for whiten, part in ((True, best.whitened), (False, best.white)):
        setup = replace(best.setup, whiten=whiten)
        fitted = setup.solve(part.z)
        fits.append(Answer(setup, fitted, deviations_of(setup, fitted)))
    fits = [one for one in fits if np.isfinite(one.fitted.square)]
    inside = [one for one in fits if not one.stuck] or fits
    chosen = inside[-1 if best.lacks else 0]
    deviations = chosen.deviations
    for other in inside:
        off = abs(other.fitted.z - chosen.fitted.z)
        if best.lacks:
            deviations = np.hypot(deviations, off / 2)
        else:
            apart = off > 2 * np.hypot(chosen.deviations, other.deviations)
            deviations = np.where(apart, np.maximum(deviations, off), deviations)
    return replace(chosen, deviations=deviations)


def deviations_of(setup: Setup, fitted: Fitted) -> Array:
    """Return standard deviations (q,): for white residuals or over pieces, and of arithmetic."""
    free, spread = np.diag(fitted.covariance) > 0, np.zeros(len(fitted.z))
    spread[free] = jackknife(fitted.gradient[free], fitted.white, fitted.good)[1]
    off = np.maximum(abs(fitted.step()), EXACT * abs(fitted.z))
    lawful = [name in setup.model.law_parameters for name in setup.names]
    if fitted.problem.trajectory.in_steps:
        places = np.flatnonzero(lawful)
        off[places] = np.maximum(off[places], STEPS * abs(fitted.z[places]))
    return np.hypot(np.maximum(fitted.deviations, spread), off * free)
