"""Three fits of a log and one answer, by how they simulate pieces they were not fitted to.

Whitened prediction errors are the most certain where the model is right, and what a simulation
leaves is noise. Where it leaves more, a rich model of the noise hides that, and reversals are
fitted in place of motion: then white errors are believed, and for a rigid axis its inverse
dynamics, which ask for no motion to be simulated and leave out the slow one, in which friction has
its hump. Deviations are widened to what fits differ by.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.colour import HIGHEST_ORDER, colourless
from flexaxis.estimators.offline.inverse import (
    Inverse,
    Motion,
    inverse_dynamics,
    jackknife,
    motion_of,
    pieces,
)
from flexaxis.estimators.offline.prediction_error import Fitted, discretisation
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.identification.log import Log, noise_of
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.identification.validate import correlations

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

WHITENED, WHITE, INVERSE = "whitened prediction errors", "white errors", "inverse dynamics"
HELD_OUT = (2, 5, 8)  # of ten pieces of a record
PARTS = 10  # of a held-out piece, over which errors are compared
AGAIN = 0.2  # share of what lies behind a gap, from which it is told how the axis goes on there
BEYOND_NOISE = 6.0  # times 1/√N, the correlations of white noise
BEYOND_CHANCE = 2.0  # standard deviations of their difference
LEAST_GAIN = 0.01  # part by which the error of a simulation is to fall, to be worth a word
CLAIMED = 2.0  # standard deviations by which fits may differ
RIGHT = 1.1  # times its noise, that a simulation leaves where the model is right
NOTHING = 1e-3  # of the motion, of which no more is said
SURE = 3.0  # standard deviations of a delay, below which it is none
ALIKE, SIMILAR = 1.02, 1.5  # times the least error: as good, where it is right, and where not
LINEAR = ("inertia", "viscous", "dry", "constant")
RIGID = {"J_m": "inertia", "f_m": "viscous", "f_c": "dry"}
BESIDE = {"g_sin": "sine", "g_cos": "cosine", "f_sided": "sided"}


@dataclass(frozen=True)
class Candidate:
    """A fit, and how it simulates what it was not fitted to.

    Attributes
    ----------
    name : str
    setup : Setup
    fitted : Fitted
        To the whole log.
    deviations : ndarray (q,)
        Of its unknowns: the larger of that for white residuals and that over pieces.
    errors : ndarray (m,)
        Mean squares of its simulation in parts of the held-out pieces, by a fit to the others.
    """

    name: str
    setup: Setup
    fitted: Fitted
    deviations: Array
    errors: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Parameters, then the gains of what acts beside the torque."""
        return (*self.setup.names, *self.setup.beside)

    @property
    def lacks(self) -> bool:
        """Whether it leaves more than noise: the model has not all that acts."""
        there = self.setup.counted
        noise, size = noise_of(self.fitted.residual[there]), float(np.std(self.setup.log.y[there]))
        return bool(self.error > max(RIGHT * noise, NOTHING * size))

    @property
    def error(self) -> float:
        """Standard deviation of a simulation of what was held out."""
        return float(np.sqrt(np.mean(self.errors)))

    @property
    def stuck(self) -> list[str]:
        """Parameters at the bound of the search."""
        problem, z = self.setup.problem(), self.fitted.z
        at = (z <= problem.lower * (1 + 1e-9)) | (z >= problem.upper * (1 - 1e-9))
        names = self.setup.names
        return [name for name, side in zip(names, at[: len(names)], strict=True) if side]


def held_out(setup: Setup) -> Flags:
    """Return which samples (N,) are left out of a fit that is to be tried on them.

    The first samples of a stretch are fitted: from them it is told in which state it begins.
    """
    number, held = pieces(setup.log.ok), np.zeros(len(setup.log.ok), bool)
    edges = [*setup.begins, len(held)]
    first = [b + round(AGAIN * (e - b)) * (i > 0) for i, (b, e) in enumerate(pairwise(edges))]
    for piece in HELD_OUT:
        there = np.flatnonzero(number == piece)
        if len(there):
            runs = [
                (max(b, there[0]), min(e, there[-1] + 1))
                for b, e in zip(first, edges[1:], strict=True)
            ]
            begin, end = max(runs, key=lambda run: run[1] - run[0])
            held[begin:end] = True
    return held


def errors_of(setup: Setup, fitted: Fitted, held: Flags, highpass: float | None = None) -> Array:
    """Return mean squares of the errors of a simulation, in parts of what was held out.

    Above the corner of the setup, or another one [Hz].
    """
    ok, corner = setup.ok, setup.highpass if highpass is None else highpass
    colour = colourless(corner, setup.log.period)
    high = colour.high(colour.bridged(fitted.residual, ok))
    there = np.flatnonzero(held & ok)
    there = there[there >= colour.skip]
    if len(there) < len(HELD_OUT) * PARTS or not np.isfinite(fitted.square):
        return np.full(1, np.inf)
    return np.array([np.mean(high[k] ** 2) for k in np.array_split(there, len(HELD_OUT) * PARTS)])


def better(before: Array, after: Array) -> bool:
    """Return whether errors of simulations fell, beyond chance and by as much as is worth it.

    The variance of the difference from parts, as errors nearby are not independent.
    """
    if not np.isfinite(before).all() or not np.isfinite(after).all():
        return bool(np.isfinite(after).all())
    gain = before - after
    worth = np.sqrt(after.mean() / before.mean()) < 1 - LEAST_GAIN
    return bool(worth and gain.mean() > BEYOND_CHANCE * gain.std() / np.sqrt(len(gain)))


def tried(setup: Setup, z: Array, held: Flags) -> dict[str, Fitted]:
    """Return fits to what is not held out, from unknowns z (q,) on, by their names."""
    found = {
        name: replace(setup, whiten=name == WHITENED).solve(z, without=held, rounds=5, fine=False)
        for name in (WHITE, WHITENED)
    }
    rigid = by_inverse(setup, z, held)
    return found if rigid is None else found | {INVERSE: rigid[0]}


def candidates_of(setup: Setup, parts: Mapping[str, Fitted], held: Flags) -> list[Candidate]:
    """Return each candidate's fit to the whole log, the one that simulates best first."""
    found: list[Candidate] = []
    for name, part in parts.items():
        own = replace(setup, whiten=name == WHITENED)
        errors = errors_of(setup, part, held)
        if name == INVERSE:
            rigid = by_inverse(own, _timed(own, part.z, found), None)
            if rigid is not None:
                fitted, deviations = rigid
                deviations[-1] = found[0].deviations[-1]
                found.append(Candidate(name, own, fitted, deviations, errors))
            continue
        fitted = own.solve(part.z)
        found.append(Candidate(name, own, fitted, deviations_of(own, fitted), errors))
    return sorted(found, key=lambda candidate: candidate.error)


def _timed(setup: Setup, z: Array, found: Sequence[Candidate]) -> Array:
    """Return unknowns (q,) with the delay of a fit that has one, if it is sure of that."""
    lag, sd = found[0].fitted.z[-1], found[0].deviations[-1]
    sure = setup.delay is not None or lag - setup.earliest > SURE * sd
    return np.append(z[:-1], lag if sure else setup.earliest)


def deviations_of(setup: Setup, fitted: Fitted) -> Array:
    """Return standard deviations (q,): for white residuals or over pieces, and of solving laws."""
    steps = discretisation(setup.problem(), fitted)
    claimed = np.maximum(fitted.deviations, over_pieces(fitted)) * repeats(fitted)
    return np.hypot(claimed, steps)


def repeats(fitted: Fitted) -> float:
    """Return by which factor deviations are greater as errors repeat, beside the motion.

    A motion that is periodic meets the same steps of an encoder, and the same ripple, in each of
    its periods, so that later ones tell nothing new of them: the variance of a sum of N terms that
    correlate by r over a lag is 1 + 2 Σ r times what it is of independent ones.
    """
    past = correlations(np.where(fitted.good, fitted.white, 0.0))
    lag = HIGHEST_ORDER + 1 + int(np.argmax(past[HIGHEST_ORDER + 1 :]))
    sure = past[lag] > BEYOND_NOISE / np.sqrt(np.sum(fitted.good))
    return float(np.sqrt(1 + 2 * max(past[lag::lag].sum(), 0.0))) if sure else 1.0


def over_pieces(fitted: Fitted) -> Array:
    """Return the standard deviations (q,) of unknowns from their spread over pieces of a log."""
    free, spread = np.diag(fitted.covariance) > 0, np.zeros(len(fitted.z))
    spread[free] = jackknife(fitted.slopes[free], fitted.white, fitted.good)[1]
    return spread


def motion(log: Log, delay: float = 0.0) -> Motion:
    """Return torque and motion of a log as the inverse dynamics take them."""
    after = np.append(log.y[1:], log.y[-1])
    later, earlier = SIGNALS[log.output].mean_speed(log.period)
    speed = later * after + earlier * log.y
    angle = (log.angle + np.append(log.angle[1:], log.angle[-1])) / 2
    k = np.arange(len(log.u))
    torque = np.interp(k - delay / log.period, k, log.u)
    ok = log.ok & np.append(log.ok[1:], False)
    return motion_of(torque, speed, angle, ok, log.period, held=not log.smooth)


def is_rigid(setup: Setup) -> bool:
    """Return whether a model is a mass with friction, whose torque is a sum."""
    model = setup.model
    laws = {role for law in model.laws for role in law.parameters if law.kind == "bristle"}
    return (
        tuple(model.states) == ("speed_motor",)
        and set(setup.names) <= set(RIGID)
        and "J_m" in setup.names
        and all(law.kind == "bristle" for law in model.laws)
        and laws <= {"coulomb", "stiffness"}
    )


def by_inverse(setup: Setup, z: Array, held: Flags | None) -> tuple[Fitted, Array] | None:
    """Return the simulation at what the inverse dynamics find, and deviations; None if they cannot.

    The delay is that of z, as a sum has none.
    """
    found = _inverse(setup, float(z[-1]), held)
    if found is None:
        return None
    k_T = float(setup.model.nominal.get("k_T", 1.0))
    p, m = len(setup.names), len(setup.beside)
    at, deviations = z.copy(), np.zeros(len(z))
    for i, name in enumerate([*found.value][: p + m]):
        unit = 1.0 if i < p else 1.0 / k_T
        at[i], deviations[i] = unit * found.value[name], abs(unit) * found.deviation[name]
    at[-2], deviations[-2] = -found.value["constant"] / k_T, found.deviation["constant"] / abs(k_T)
    problem = setup.problem(held)
    if np.any(at < problem.lower) or np.any(at > problem.upper):
        return None
    return setup.at(at, held, fixed=p + m), deviations


def _inverse(setup: Setup, delay: float, held: Flags | None) -> Inverse | None:
    if not is_rigid(setup):
        return None
    known = {
        RIGID[name]: float(value)
        for name, value in setup.model.nominal.items()
        if name in RIGID and name not in setup.names
    }
    names = [RIGID[n] for n in setup.names] + [BESIDE[n] for n in setup.beside] + ["constant"]
    moved = motion(setup.log, delay)
    moved = replace(moved, torque=float(setup.model.nominal.get("k_T", 1.0)) * moved.torque)
    try:
        return inverse_dynamics(moved, names, known=known, without=held)
    except EstimatorError:
        return None


def inverse_values(setup: Setup) -> Array | None:
    """Return the parameters (p,) that the inverse dynamics find; None if they cannot."""
    found = _inverse(setup, setup.delay or 0.0, None)
    return None if found is None else np.array([found.value[RIGID[n]] for n in setup.names])


def answer(candidates: Sequence[Candidate]) -> tuple[Candidate, Array]:
    """Return the candidate that is taken, and its deviations (q,).

    Of those that simulate alike the most certain one is taken. Where the model lacks something no
    simulation tells which of them is right, and what whitened errors claim is not believed: then
    deviations have half of what the others differ by, less for those that simulate worse. Where it
    lacks nothing, they have all of it if that is more than both claim; but inverse dynamics, a sum
    that is rougher than a simulation, say nothing against it.
    """
    candidates = [c for c in candidates if np.isfinite(c.fitted.square)]
    inside = [c for c in candidates if not c.stuck] or candidates  # at a bound is no answer
    lacks, unbelieved = inside[0].lacks, WHITENED if inside[0].lacks else INVERSE
    believed = [c for c in inside if not lacks or c.name != WHITENED] or inside
    most = (SIMILAR if lacks else ALIKE) * believed[0].error
    best = min((c for c in believed if c.error <= most), key=_claim)
    deviations = best.deviations
    for other in candidates:
        if other.name == unbelieved and len(candidates) > 2:
            continue
        off = abs(other.fitted.z - best.fitted.z)
        off *= min(1.0, best.error / other.error) ** 2 * (0.5 if other.stuck else 1.0)
        if lacks:
            deviations = np.hypot(deviations, off / 2)
        else:
            apart = off > CLAIMED * np.hypot(best.deviations, other.deviations)
            deviations = np.where(apart, np.maximum(deviations, off), deviations)
    return best, deviations


def _claim(candidate: Candidate) -> float:
    """Return the mean logarithm of what a candidate claims of its parameters, relative to them."""
    p = len(candidate.setup.names)
    tiny = np.finfo(float).tiny
    share = candidate.deviations[:p] / np.maximum(abs(candidate.fitted.z[:p]), tiny)
    return float(np.mean(np.log(np.maximum(share, tiny))))


def explain(log: Log, delay: float, names: Sequence[str]) -> Inverse | None:
    """Return the inverse dynamics of a log by some regressors; None where too little moves."""
    try:
        return inverse_dynamics(motion(log, delay), names)
    except EstimatorError:
        return None
