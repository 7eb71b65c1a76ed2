"""What a sequence of estimates shows: a covariate's effect, one step or drift, or no change.

The estimates x of n windows or logs are a level, covariates and at most one change. The change is
the step or ramp of the greatest likelihood ratio over all places (M. Basseville and I. Nikiforov,
*Detection of Abrupt Changes*, 1993, section 2.4). Its chance in a sequence without a change comes
from permutations of the residuals, so that the rate of false alarms is the stated one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

Array = NDArray[np.float64]

FEWEST = 8  # values, below which scatter cannot be told from a change
EDGE = 3  # values that a step or a ramp must have on each side
DRAWS = 4.0  # permutations, over the reciprocal of the rate of false alarms
WAVES = 3  # cosines of a smooth drift


@dataclass(frozen=True)
class Explained:
    """What a sequence is made of.

    Attributes
    ----------
    kind : {"constant", "step", "drift"}
    place : int
        First value after a step, or at which a drift begins.
    size, deviation : float
        Of the step, or of the drift over the sequence, and the standard deviation of the scatter
        about it, for one such difference.
    chance : float
        Probability that a sequence without a change shows one as large.
    level : float
        At the mean of the covariates, before the change.
    slopes, slope_deviations : ndarray (q,)
        Of the value with each covariate.
    fitted : ndarray (n,)
    """

    kind: Literal["constant", "step", "drift"]
    place: int
    size: float
    deviation: float
    chance: float
    level: float
    slopes: Array
    slope_deviations: Array
    fitted: Array


def explain(
    value: Array, deviation: Array, covariates: Array | None = None, *, false_alarms: float
) -> Explained:
    """Explain a sequence by covariates and one change, if a change is significant.

    Parameters
    ----------
    value, deviation : ndarray (n,)
        Estimates in the order of time, and their claimed standard deviations.
    covariates : ndarray (n, q), optional
    false_alarms : float
        Probability of a change in a sequence without one.
    """
    n = len(value)
    more = np.empty((n, 0)) if covariates is None else covariates - covariates.mean(axis=0)
    base = np.column_stack([np.ones(n), more])
    rest = value - base @ np.linalg.lstsq(base, value)[0]
    scatter = float(median_abs_deviation(np.diff(rest), scale="normal")) / np.sqrt(2)
    weight = 1 / np.maximum(np.hypot(deviation, scatter), 1e-300)
    fit = _Fit(value * weight, weight)
    if n < FEWEST:
        return fit.result("constant", 0, base, None, 1.0)
    k = np.arange(n)[:, None]
    places = np.arange(EDGE, n - EDGE + 1)
    steps = (k >= places).astype(float)
    begins = np.r_[0, places[:-EDGE]]
    ramps = np.maximum(k - begins, 0) / (n - 1 - begins)
    shapes = np.hstack([steps, ramps])
    outside = fit.outside(base)
    H, r = outside(shapes * weight[:, None]), outside(fit.y)
    H /= np.maximum(np.linalg.norm(H, axis=0), 1e-300)
    ratio = (H.T @ r) ** 2 / max(r @ r, 1e-300)
    random = np.random.default_rng(0)
    drawn = outside(random.permuted(np.tile(r, (round(DRAWS / false_alarms), 1)), axis=1).T)
    largest = np.max((H.T @ drawn) ** 2, axis=0) / np.sum(drawn**2, axis=0)
    chance = (1 + np.sum(largest >= ratio.max())) / (1 + len(largest))
    if chance > false_alarms:
        return fit.result("constant", 0, base, None, float(chance))
    step, ramp = int(np.argmax(ratio[: len(places)])), int(np.argmax(ratio[len(places) :]))
    waves = np.cos(np.pi * (k + 0.5) / n * np.arange(1, WAVES + 1))
    options = [
        fit.result("step", int(places[step]), base, steps[:, [step]], float(chance)),
        fit.result("drift", int(begins[ramp]), base, ramps[:, [ramp]], float(chance)),
        fit.result("drift", 0, base, waves, float(chance)),
    ]
    costs = [n * np.log(fit.left(one.fitted)) + 2 * np.log(n) for one in options]
    costs[-1] += (WAVES - 2) * np.log(n)
    return options[int(np.argmin(costs))]


class _Fit:
    """Weighted least squares of one sequence by several designs."""

    def __init__(self, y: Array, weight: Array) -> None:
        self.y, self.weight = y, weight

    def outside(self, design: Array):  # type: ignore[no-untyped-def]
        """Return the projection on what a design does not explain."""
        Q = np.linalg.qr(design * self.weight[:, None])[0]
        return lambda x: x - Q @ (Q.T @ x)

    def left(self, fitted: Array) -> float:
        """Return the mean square that a fit leaves, in units of the deviations."""
        return float(np.mean((self.y - fitted * self.weight) ** 2)) + 1e-300

    def result(
        self,
        kind: Literal["constant", "step", "drift"],
        place: int,
        base: Array,
        shape: Array | None,
        chance: float,
    ) -> Explained:
        """Return what comes of a design."""
        design = base if shape is None else np.hstack([base, shape])
        Z = design * self.weight[:, None]
        inverse = np.linalg.pinv(Z)
        beta, q = inverse @ self.y, base.shape[1]
        fitted = design @ beta
        sd = np.linalg.norm(inverse, axis=1) * np.sqrt(max(self.left(fitted), 1.0))
        change = design[:, q:] @ beta[q:] if shape is not None else np.zeros(len(design))
        first, last = sorted((int(np.argmin(change)), int(np.argmax(change))))
        return Explained(
            kind,
            place,
            float(change[last] - change[first]),
            float(sd[q:].max(initial=0.0)),
            chance,
            float(beta[0] + change[0]),
            beta[1:q],
            sd[1:q],
            fitted,
        )
