"""Find steps and drifts of parameters in a sequence of estimates or in a record.

The estimates from n windows or logs are modelled as the sum of a level, the effects of covariates
(such as a temperature) and at most one change. The change is a drift (a cubic polynomial) or a
step. The step is placed where the likelihood ratio is greatest (M. Basseville and I. Nikiforov,
*Detection of Abrupt Changes*, 1993, section 2.4). The significance threshold comes from the F
distribution, with a Bonferroni correction for the number of step positions. The threshold keeps the
probability of a false alarm below the chosen limit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.stats import f, median_abs_deviation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Kind = Literal["constant", "step", "drift"]
Look = Callable[[Array], tuple[Array, Array]]

WINDOWS = 40  # number of windows into which a record is divided
FALSE_ALARMS = 0.002  # probability that a change is reported in a record without a change
SMALLEST = 0.02  # smallest relative change that is reported
STEPS, REACH = 5, 2.0  # steps of a fit; maximum factor by which a step changes a parameter
# a window is informative if its deviation is at most USUAL times the QUIET quantile of all windows
QUIET, USUAL = 0.25, 5.0
FEW = 0.25  # largest ratio of residual to error in a window whose error the parameters explain
FEWEST = 8  # minimum number of values from which a scatter is computed
SEEN = 0.25  # maximum standard deviation at which a relative step in mid-record is detectable
EDGE = 3  # minimum number of values on each side of a step
DEGREE = 3  # degree of the polynomial that describes a drift


@dataclass(frozen=True)
class Explained:
    """A sequence described by a level, the effects of covariates and at most one change.

    Attributes
    ----------
    kind : {"constant", "step", "drift"}
        Kind of the change.
    begin, end : int
        Indices of the smallest and the largest value of the change, in chronological order. For a
        step, `end` is the index of the first value after the step.
    size, deviation : float
        Size of the change from `begin` to `end`, relative to the level, and its standard deviation.
    level : float
        Estimated value before the change, with the covariates at their mean values.
    slopes, slope_deviations : ndarray (q,)
        Effect of each covariate (change in the value per unit of the covariate), and the standard
        deviation of this effect.
    fitted : ndarray (n,)
        Sum of the level, the effects of the covariates and the change.
    left : float
        Sum of the squared residuals, weighted by their inverse variances.
    chance : float
        Upper bound on the probability that noise alone produces such a change.
    """

    kind: Kind
    begin: int
    end: int
    size: float
    deviation: float
    level: float
    slopes: Array
    slope_deviations: Array
    fitted: Array
    left: float
    chance: float = 1.0


def explain(value: Array, deviation: Array, covariates: Array, *, false_alarms: float) -> Explained:
    """Fit the effects of covariates to a sequence, and also one change if it is significant.

    Parameters
    ----------
    value, deviation : ndarray (n,)
        Estimates in chronological order, and their reported standard deviations.
    covariates : ndarray (n, q)
        Values of the q covariates for each estimate.
    false_alarms : float
        Upper bound on the probability of reporting a change in a sequence without a change.
    """
    n = len(value)
    base: Array = np.column_stack([np.ones(n), covariates - np.sum(covariates, axis=0) / n])
    rest = value - base @ np.linalg.lstsq(base, value)[0]
    scatter = float(median_abs_deviation(np.diff(rest), scale="normal")) / np.sqrt(2)
    weight = 1 / np.maximum(np.hypot(deviation, scatter), 1e-300)
    constant = _fitted("constant", base[:, :0], base, value, weight)
    if n < FEWEST:
        return constant
    cubic = np.asarray(legvander(np.linspace(-1, 1, n), DEGREE)[:, 1:], float)
    steps = (np.arange(n) >= np.arange(EDGE, n - EDGE + 1)[:, None]).astype(float)
    every = (_fitted("step", step[:, None], base, value, weight) for step in steps)
    step = min(every, key=lambda one: one.left)
    drift = _fitted("drift", cubic, base, value, weight)
    chances = []
    for fit, size in ((step, 1), (drift, DEGREE)):
        freedom = n - base.shape[1] - size
        ratio = (constant.left / fit.left - 1) * freedom / size
        chances.append((len(steps) + 1) * float(f.sf(ratio, size, freedom)))  # Bonferroni's bound
    if min(chances) > false_alarms:
        return constant
    # Bayesian information criterion; the two parameters of a step are its position and its size
    slow = n * np.log(step.left / drift.left) > (DEGREE - 2) * np.log(n)
    return replace(drift if slow else step, chance=min(chances))


def _fitted(kind: Kind, shape: Array, base: Array, value: Array, weight: Array) -> Explained:
    """Fit the columns of `base` and the `shape` of a change to a sequence by least squares."""
    design, q = np.hstack([base, shape]), base.shape[1]
    inverse = np.linalg.pinv(design * weight[:, None])
    beta = inverse @ (value * weight)
    fitted, change = design @ beta, shape @ beta[q:]
    left = float(np.sum(((value - fitted) * weight) ** 2)) + 1e-300
    begin, end = sorted((int(np.argmin(change)), int(np.argmax(change))))
    spread = np.sqrt(max(left / len(value), 1.0)) * inverse
    level = float(beta[0] + change[begin])
    one = max(abs(level), 1e-300)
    return Explained(
        kind, begin, end, float(change[end] - change[begin]) / one,
        float(np.linalg.norm((shape[end] - shape[begin]) @ spread[q:])) / one, level, beta[1:q],
        np.linalg.norm(spread[1:q], axis=1), fitted, left,
    )  # fmt: skip


@dataclass(frozen=True)
class Change:
    """A step or a drift of a parameter within a record.

    Attributes
    ----------
    name : str
        Name of the parameter.
    kind : {"step", "drift"}
        Kind of the change.
    time, end : float
        Start and end of a drift [s]. For a step, both are the time of the step, which is accurate
        to about one window.
    relative, deviation : float
        Size of the change relative to the value before the change, and the standard deviation of
        this size.
    """

    name: str
    kind: str
    time: float
    end: float
    relative: float
    deviation: float

    @property
    def text(self) -> str:
        """A clause that states the parameter, the size and the time of the change."""
        return clause(self.name, self, self.relative, f"{self.time:.1f} s", f"{self.end:.1f} s")


def clause(name: str, one: Change | Explained, size: float, begin: str, end: str) -> str:
    """Return a clause that describes a step at `end`, or a drift from `begin` to `end`."""
    text = f"by {100 * size:+.1f} ± {100 * one.deviation:.2g} %"
    if one.kind == "step":
        return f"{name} changed {text} at {end}"
    return f"{name} drifts {text} from {begin} to {end}"


def changes_along(
    look: Look, time: Array, z: Array, names: Sequence[str]
) -> tuple[list[Change], list[str]]:
    """Find parameter changes in a record by least squares.

    The samples before and after a step are fitted separately, so that the size of a large step is
    accurate.

    Parameters
    ----------
    look : callable
        Function of the unknowns. ``look(z)`` returns the prediction errors ε (N,) of the usable
        samples, and the gradient (N, q) of the prediction with respect to relative parameter
        changes and to initial states.
    time : ndarray (N,)
        Times of the usable samples [s].
    z : ndarray (q,)
        Initial values of the unknowns: the p parameters, then the unknown initial states.
    names : sequence of str
        Names of the p parameters.

    Returns
    -------
    changes : list of Change
        If the most significant change is a drift, the list contains all drifts. If it is a step,
        the list contains this step and all other steps that occur at the same time.
    unseen : list of str
        Parameters whose changes cannot be detected in this record.
    """
    p = len(names)
    z = _fitted_to(look, np.ones(len(time), bool), z, p)
    changes, unseen = changes_in(time, *look(z), names)
    if changes and changes[0].kind == "step":
        at = changes[0].time
        before, after = (_fitted_to(look, side, z, p)[:p] for side in (time < at, time >= at))
        sizes = dict(zip(names, (after / before - 1).tolist(), strict=True))
        changes = [replace(one, relative=sizes[one.name]) for one in changes if one.time == at]
    else:
        changes = [one for one in changes if one.kind == "drift"]
    return [one for one in changes if abs(one.relative) >= SMALLEST], unseen


def changes_in(
    time: Array, error: Array, J: Array, names: Sequence[str]
) -> tuple[list[Change], list[str]]:
    """Return changes in order of significance, and the parameters whose changes are undetectable.

    A small change Δθ in the parameters causes the errors ε ≈ ψᵀ Δθ, where ψ is the gradient of the
    prediction. This approximation is the local approach of M. Basseville and I. Nikiforov,
    *Detection of Abrupt Changes* (1993), chapter 8. A least-squares fit in each of forty windows
    gives forty nearly independent estimates of Δθ. `explain` finds a step or a drift in these
    estimates. A window is ignored if it contains little information, or if no parameter values
    explain its errors.

    Parameters
    ----------
    time, error : ndarray (N,)
        Times [s] and prediction errors ε of the usable samples.
    J : ndarray (N, q)
        Gradient of the prediction with respect to relative changes of the parameters. The first
        columns belong to the parameters `names`.
    names : sequence of str
        Names of the parameters that may have changed.
    """
    edges, local, spread = _windows(time, error, J, len(names))
    if len(edges) < FEWEST:
        return [], list(names)
    changes, unseen = list[Change](), list[str]()
    for name, x, sd in zip(names, local.T, spread.T, strict=True):
        if np.median(sd) * 2 / np.sqrt(len(sd)) >= SEEN:
            unseen.append(name)
        one = explain(1 + x, sd, edges[:, :0], false_alarms=FALSE_ALARMS / len(names))
        if one.kind == "constant" or abs(one.size) < SMALLEST:
            continue
        begin, end = float(edges[one.begin, 0]), float(edges[one.end, 1])
        if one.kind == "step":
            begin = end = float(edges[one.end - 1, 1] + edges[one.end, 0]) / 2
        changes.append(Change(name, one.kind, begin, end, one.size, one.deviation))
    sure = lambda change: -abs(change.relative) / max(change.deviation, 1e-300)  # noqa: E731
    return sorted(changes, key=sure), unseen


def _windows(time: Array, error: Array, J: Array, p: int) -> tuple[Array, Array, Array]:
    """Return the limits, estimates and standard deviations of the m informative windows.

    The limits are an array (m, 2) in s. The other two results are arrays (m, p).
    """
    parts = [k for k in np.array_split(np.arange(len(time)), WINDOWS) if len(k) > 10 * J.shape[1]]
    inverses = [np.linalg.pinv(J[k], rcond=1e-8) for k in parts]
    every = [one @ error[k] for one, k in zip(inverses, parts, strict=True)]
    x = np.reshape(every, (-1, J.shape[1]))[:, :p]
    if not parts:
        return x, x, x
    total = np.array([np.std(error[k]) for k in parts])
    left = np.array([np.std(error[k] - J[k] @ x) for x, k in zip(every, parts, strict=True)])
    sd = np.array([np.linalg.norm(one[:p], axis=1) for one in inverses])
    sd[sd == 0] = np.inf  # a window without information
    seen = (sd <= USUAL * np.quantile(sd, QUIET, axis=0, method="lower")).all(axis=1)
    if seen.any():
        seen &= (left <= USUAL * np.median(left[seen])) | (left <= FEW * total)
    sd *= np.maximum(left[:, None], 1e-300)
    return time[np.array([k[[0, -1]] for k in parts])][seen], x[seen], sd[seen]


def _fitted_to(look: Look, inside: Flags, z: Array, p: int) -> Array:
    """Fit q unknowns to the samples `inside` by least squares; the first `p` are parameters."""
    for _ in range(STEPS):
        error, J = look(z)
        step = np.linalg.lstsq(J[inside], error[inside])[0]
        z = np.r_[z[:p] * np.clip(1 + step[:p], 1 / REACH, REACH), z[p:] + step[p:]]
    return z
