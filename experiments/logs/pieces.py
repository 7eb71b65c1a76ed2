"""Pieces of a record: how much estimates differ between them, and what is held out of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.descent import damped_step
from flexaxis.estimators.offline.prediction_error import Fitted

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

PIECES = 10  # of a record
HELD_OUT = (2, 5, 8)  # of these


def pieces(ok: Flags) -> NDArray[np.int64]:
    """Return the number of the piece (N,) that each sample is in; all have as many usable ones."""
    count = np.cumsum(ok)
    return np.minimum(count * PIECES // max(int(count[-1]), 1), PIECES - 1)


def held_out(ok: Flags) -> Flags:
    """Return which samples (N,) are left out of a fit that is to be tried on them."""
    return np.isin(pieces(ok), HELD_OUT)


def spread(fitted: Fitted) -> Array:
    """Return the standard deviation (q,) of estimates from their spread over pieces.

    The jackknife with a piece of the record left out at a time (B. Efron and C. Stein, *The
    jackknife estimate of variance*, Ann. Statist. 9, 1981): each of the estimates without a piece
    is one step of Gauss and Newton from that with all. Where noise is all that there is, it is what
    the covariance says; what the model leaves out comes on top.
    """
    free, found = np.diag(fitted.covariance) > 0, np.zeros(len(fitted.z))
    found[free] = jackknife(fitted.slopes[free], fitted.white, fitted.good)[1]
    return found


def jackknife(J: Array, e: Array, good: Flags) -> tuple[Array, Array]:
    """Return the regression (q,) of e (N,) on rows of J (q, N), and its deviation from pieces."""
    number = pieces(good)
    kept = [good & (number != i) for i in range(PIECES)]
    whole, *left = [damped_step(J[:, k] @ J[:, k].T, J[:, k] @ e[k], 0.0) for k in (good, *kept)]
    off = np.array(left) - np.mean(left, axis=0)
    return whole, np.sqrt((PIECES - 1) / PIECES * np.sum(off**2, axis=0))


@dataclass(frozen=True)
class Comparison:
    """What one model predicts better than another of what neither was fitted to.

    Attributes
    ----------
    before, after : float
        Standard deviation of the error of a prediction over one sample, in the unit of the output.
    gain, deviation : float
        Mean gain of the logarithm of the likelihood of a sample, and its standard deviation from
        that over pieces of a tenth of what was held out.
    """

    before: float
    after: float
    gain: float
    deviation: float

    @property
    def better(self) -> bool:
        """Whether the second is the better one beyond chance."""
        return self.gain > BEYOND_CHANCE * self.deviation and self.gain > 0

    @property
    def worth_it(self) -> bool:
        """Whether it is better by so much that parameters of a richer law are worth having."""
        return self.better and self.gain > LEAST_GAIN


BEYOND_CHANCE = 3.0  # standard deviations
LEAST_GAIN = 0.01  # nats a sample: an error of prediction that is smaller by a per cent


def compare(first: Fitted, second: Fitted, without: Flags, used: Flags) -> Comparison:
    """Compare fits by what they predict of samples that were held out of both.

    The test of Q. H. Vuong, *Likelihood ratio tests for model selection and non-nested hypotheses*
    (Econometrica 57, 1989), with the variance from pieces as errors are not independent.
    """
    both = without & used & first.colour.settled(used) & second.colour.settled(used)
    e, f = first.white[both], second.white[both]
    gain = 0.5 * (np.log(first.square / second.square) + e**2 / first.square - f**2 / second.square)
    means = np.array([part.mean() for part in np.array_split(gain, 3 * PIECES)])
    return Comparison(
        before=float(np.sqrt(np.mean(e**2))),
        after=float(np.sqrt(np.mean(f**2))),
        gain=float(gain.mean()),
        deviation=float(np.std(means, ddof=1) / np.sqrt(len(means))),
    )
