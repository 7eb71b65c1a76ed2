"""What the excitation of a record can tell of each parameter, before any estimator runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import information
from flexaxis.experiments.logs.axis_file import Axis, output_of, usable
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.moved import reversals_of
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.identify import GIVEN
from flexaxis.experiments.logs.spectra import measured_response, rough_guess
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


ENOUGH = 0.5  # relative standard deviation from which on a parameter counts as not seen
NOTHING = 1e9  # relative standard deviation of what is not seen at all
QUIETEST = 1e-12  # of the power of the output: less noise than that is rounding
HELD = "stays as it is: a log shows ratios to it, so identify holds it unless it is freed"
BEST = "by a linear model"
DRY = "by a linear model, to which dry friction is noise"
CROSSINGS = 10  # reversals that a law of friction needs, at the least


@dataclass(frozen=True)
class Seen:
    """What the excitation can tell of a parameter, by a linear model in white noise.

    Attributes
    ----------
    alone : float or None
        Relative standard deviation were all others known; None of a law.
    together : float or None
        The same with all of them unknown, but for torque constant and gear ratio.
    partner : str
        The parameter with which it is confused most.
    words : str
    """

    alone: float | None
    together: float | None
    partner: str
    words: str


def visible(record: Record, axis: Axis) -> dict[str, Seen]:
    """Return what the excitation can tell of each parameter of an axis, before any estimator runs.

    σ/(θ √(N E ψ²)), with E ψψᵀ from the spectrum of the torque by eq. (28). σ is what
    the torque does not explain of the output, so what only a law explains counts as noise: where
    an axis has one, identify may tell far more. Laws are seen by reversals, which are counted.

    Parameters
    ----------
    record : Record
    axis : Axis
        Its nominal values are where the gradient is taken; for a shipped model without
        values they are guessed from the log, where it has a way to.
    """
    output, period, ok = output_of(record), record.period, usable(record)
    y = np.asarray(getattr(record, output))[ok]
    if not axis.known and MODELS[axis.model.name].guess:
        guess = rough_guess(axis.model, measured_response(record.torque[ok], y, period=period))
        axis = axis.having(guess)
    linear = replace(axis.model, laws=())
    names = [name for name in linear.parameters if linear.nominal[name]]
    model = increment(linear, period) if output == "increment" else linear
    chosen = model.parametrize(names)
    evidence = Evidence(record)
    spectra = evidence.spectra
    lines = (spectra.torque > 1e-9 * spectra.torque.max()) & (spectra.frequency > 0)
    omega = 2 * np.pi * spectra.frequency[lines]
    power = spectra.torque[lines] * spectra.frequency[1] / _noise(evidence)
    with np.errstate(all="ignore"):  # whether it is a number is seen below
        Q = information(chosen, chosen.theta, omega, power, period=period)
        Q = Q * np.outer(chosen.theta, chosen.theta) * ok.sum()
    if not np.isfinite(Q).all():
        raise LogError(
            f"model {axis.model.name!r}: its response to the torque of this log is no number at "
            f"its nominal values; is one of them, or an entry of {', '.join('ABC')}, wrong?"
        )
    found = _deviations(Q, names)
    if axis.model.laws:  # what they do is not in the response, and so in σ
        found = {n: replace(s, words=s.words.replace(BEST, DRY)) for n, s in found.items()}
    others = (name for name in axis.model.parameters if name not in linear.parameters)
    return found | {name: _of_law(evidence) for name in others}


def _deviations(Q: Array, names: Sequence[str]) -> dict[str, Seen]:
    """Return what an information matrix (p, p) of relative parameters says of each."""
    diagonal = np.diag(Q)
    alone = np.divide(1, np.sqrt(diagonal), out=np.full(len(names), np.inf), where=diagonal > 0)
    free = [i for i, name in enumerate(names) if name not in GIVEN and diagonal[i] > 0]
    scaled = Q[np.ix_(free, free)] * np.outer(alone[free], alone[free])
    # a direction without any information is as uncertain as rounding lets it be
    values, vectors = np.linalg.eigh(scaled)
    spread = vectors / np.sqrt(np.maximum(values, len(values) * np.finfo(float).eps))
    cover = spread @ spread.T
    found = {}
    for i, name in enumerate(names):
        together, partner = float(alone[i]), ""
        if i in free:
            j = free.index(i)
            together *= float(np.sqrt(cover[j, j]))
            tied = np.abs(cover[j]) / np.sqrt(np.diag(cover))
            tied[j] = 0
            partner = names[free[int(np.argmax(tied))]] if len(free) > 1 else ""
        words = HELD if name in GIVEN else _words(float(alone[i]), together, partner)
        found[name] = Seen(min(float(alone[i]), NOTHING), min(together, NOTHING), partner, words)
    return found


def _words(alone: float, together: float, partner: str) -> str:
    if not alone < ENOUGH:
        return "NOT seen by this excitation: fix it, or shake where it acts"
    if together < ENOUGH:
        return f"seen, to about ±{100 * together:.2g} % {BEST}"
    text = f"seen only if others are known (then to about ±{100 * alone:.2g} %)"
    return f"{text}: confused with {partner}, fix one of them" if partner else text


def _of_law(evidence: Evidence) -> Seen:
    """Return what reversals say of the parameters of a law."""
    count, span = reversals_of(evidence)
    words = f"to be seen at {count} reversals, over speeds of 1 : {span:.2g}"
    if count < CROSSINGS:
        words = f"hardly seen: {count} reversals; log motions to and fro"
    return Seen(None, None, "", words)


def _noise(e: Evidence) -> float:
    """Return the variance of white noise as strong as what the torque does not explain.

    The median over the band: at single frequencies the averages of spectra explain less of a
    steep response than there is.
    """
    s, (low, high) = e.spectra, e.spectra.band
    band = (s.frequency >= low) & (s.frequency <= high)
    rest = s.motion * (1 - s.coherence)
    least = QUIETEST * float(s.motion[band].mean())
    return max(float(np.median(rest[band])), least) / (2 * e.period)
