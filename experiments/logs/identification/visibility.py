"""What the excitation of a record can tell of each parameter, before any estimator runs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexaxis.estimators.models.axes import MODELS
from flexaxis.experiments.logs.axis_file import Axis, output_of, usable
from flexaxis.experiments.logs.doubts.evidence import Evidence
from flexaxis.experiments.logs.doubts.moved import reversals_of
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.identify import GIVEN
from flexaxis.experiments.logs.identification.setup import Setup, log_of
from flexaxis.experiments.logs.spectra import measured_response, rough_guess
from flexaxis.sim.record import Record

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

    By the sensitivities of a simulation of its linear part. σ is what the torque does not explain
    of the output, so what only a law explains counts as noise: where an axis has one, identify may
    tell far more. Laws are seen by reversals, which are counted.

    Parameters
    ----------
    record : Record
    axis : Axis
        Its nominal values are where the gradient is taken; for a shipped model without
        values they are guessed from the log, where it has a way to.
    """
    ok, evidence = usable(record), Evidence(record)
    y = np.asarray(getattr(record, output_of(record)))[ok]
    if not axis.known and MODELS[axis.model.name].guess:
        guess = rough_guess(
            axis.model, measured_response(record.torque[ok], y, period=record.period)
        )
        axis = axis.having(guess)
    linear = replace(axis.model, laws=())
    names = tuple(n for n in linear.parameters if linear.nominal[n] and n not in GIVEN)
    setup = Setup(log_of(record, axis), linear, names, delay=axis.delay, whiten=False)
    setup, theta = replace(setup, highpass=axis.highpass), linear.parametrize(names).theta
    with np.errstate(all="ignore"):  # whether it is a number is seen below
        z = setup.problem().start(theta, axis.delay, setup.first())
        fitted = setup.at(z, fixed=len(names))
    if not np.isfinite(fitted.square):
        raise LogError(
            f"model {axis.model.name!r}: its response to the torque of this log is no number at "
            f"its nominal values; is one of them, or an entry of {', '.join('ABC')}, wrong?"
        )
    noise, p = _noise(evidence), len(names)
    length = np.linalg.norm(fitted.slopes[:p, fitted.good], axis=1) * abs(theta)
    alone = np.sqrt(noise) / np.maximum(length, np.sqrt(noise) / NOTHING)
    covariance = fitted.covariance[:p, :p] * noise / fitted.square
    deviations = np.sqrt(np.diag(covariance))
    tied = abs(covariance / np.maximum(np.outer(deviations, deviations), 1e-300)) - 2 * np.eye(p)
    best, found = DRY if axis.model.laws else BEST, {}
    for i, name in enumerate(names):
        together = float(np.clip(deviations[i] / abs(theta[i]), alone[i], NOTHING))
        partner = names[int(np.argmax(tied[i]))] if p > 1 else ""
        words = _words(float(alone[i]), together, partner, best)
        found[name] = Seen(float(alone[i]), together, partner, words)
    held = {n: Seen(None, None, "", HELD) for n in linear.parameters if n in GIVEN}
    others = (name for name in axis.model.parameters if name not in linear.parameters)
    return held | found | {name: _of_law(evidence) for name in others}


def _words(alone: float, together: float, partner: str, best: str) -> str:
    if not alone < ENOUGH:
        return "NOT seen by this excitation: fix it, or shake where it acts"
    if together < ENOUGH:
        return f"seen, to about ±{100 * together:.2g} % {best}"
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
