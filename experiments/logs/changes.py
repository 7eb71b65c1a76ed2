"""When a parameter changes: steps and drifts in a sequence of estimates, and within a record.

The estimates x of n windows or logs are a level, covariates and at most one change: a step at the
place of the greatest likelihood ratio (M. Basseville and I. Nikiforov, *Detection of Abrupt
Changes*, 1993, section 2.4), or a cubic. The chance of such a ratio in a sequence without a change
comes from permutations of the residuals, so that the rate of false alarms is the stated one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Kind = Literal["constant", "step", "drift"]
Look = Callable[[Array], tuple[Array, Array]]

WINDOWS = 40  # that a record is cut into
FALSE_ALARMS = 0.002  # probability of a change in a record without one
SMALLEST = 0.02  # relative change that is worth a word
STEPS, FARTHEST = 4, 0.5  # of Gauss and Newton, and how far one changes a parameter
QUIET, USUAL = 0.25, 5.0  # quantile of deviation and residual of windows, and times it that count
FEWEST = 8  # values, below which scatter cannot be told from a change
SEEN = 0.25  # deviation of a relative step in the middle, up to which it would be seen
EDGE = 3  # values that a step must have on each side
DRAWS = 4.0  # permutations, over the reciprocal of the rate of false alarms
DEGREE = 3  # of the polynomial of a drift


@dataclass(frozen=True)
class Explained:
    """What a sequence is made of.

    Attributes
    ----------
    kind : {"constant", "step", "drift"}
    begin, end : int
        Of a step, the first value behind it is `end`. A drift goes from one extreme to the other.
    size, deviation : float
        Of the step, or of the drift from `begin` to `end`, and its standard deviation.
    chance : float
        Probability that a sequence without a change shows one as large.
    level : float
        Before the change, at the mean of the covariates.
    slopes, slope_deviations : ndarray (q,)
        Of the value with each covariate.
    fitted : ndarray (n,)
    left : float
        Mean square of what is left, in units of the deviations.
    """

    kind: Kind
    begin: int
    end: int
    size: float
    deviation: float
    chance: float
    level: float
    slopes: Array
    slope_deviations: Array
    fitted: Array
    left: float


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
    beside = np.empty((n, 0)) if covariates is None else covariates - covariates.mean(axis=0)
    base: Array = np.column_stack([np.ones(n), beside])
    rest = value - base @ np.linalg.lstsq(base, value)[0]
    scatter = float(median_abs_deviation(np.diff(rest), scale="normal")) / np.sqrt(2)
    weight = 1 / np.maximum(np.hypot(deviation, scatter), 1e-300)
    if n < FEWEST:
        return _fitted("constant", base[:, :0], base, value, weight, 1.0)
    steps: Array = (np.arange(n)[:, None] >= np.arange(EDGE, n - EDGE + 1)).astype(float)
    known = np.linalg.qr(base * weight[:, None])[0]
    cubic = np.asarray(legvander(np.linspace(-1, 1, n), DEGREE)[:, 1:], float)
    H, D = (x - known @ (known.T @ x) for x in (steps * weight[:, None], cubic * weight[:, None]))
    H, D = H / np.maximum(np.linalg.norm(H, axis=0), 1e-300), np.linalg.qr(D)[0]
    copies = np.tile(rest * weight, (1 + round(DRAWS / false_alarms), 1))
    copies[1:] = np.random.default_rng(0).permuted(copies[1:], axis=1)
    r = copies.T - known @ (known.T @ copies.T)
    ratios, slow = (H.T @ r) ** 2, np.sum((D.T @ r) ** 2, axis=0)
    largest = np.maximum(ratios.max(axis=0), slow) / np.maximum(np.sum(r**2, axis=0), 1e-300)
    best, chance = int(np.argmax(ratios[:, 0])), float(np.mean(largest >= largest[0]))
    if chance > false_alarms:
        return _fitted("constant", base[:, :0], base, value, weight, chance)
    step = _fitted("step", steps[:, [best]], base, value, weight, chance)
    drift = _fitted("drift", cubic, base, value, weight, chance)
    # the Bayesian information criterion; a step has a place and a size
    return drift if n * np.log(step.left / drift.left) > (DEGREE - 2) * np.log(n) else step


def _fitted(  # noqa: PLR0917
    kind: Kind, shape: Array, base: Array, value: Array, weight: Array, chance: float
) -> Explained:
    """Return the weighted least squares of a sequence by a base and the shape of a change."""
    design, q = np.hstack([base, shape]), base.shape[1]
    inverse = np.linalg.pinv(design * weight[:, None])
    beta = inverse @ (value * weight)
    fitted, change = design @ beta, shape @ beta[q:]
    left = float(np.mean(((value - fitted) * weight) ** 2)) + 1e-300
    begin, end = sorted((int(np.argmin(change)), int(np.argmax(change))))
    spread = np.sqrt(max(left, 1.0)) * inverse
    return Explained(
        kind,
        begin,
        end,
        float(change[end] - change[begin]),
        float(np.linalg.norm((shape[end] - shape[begin]) @ spread[q:])),
        chance,
        float(beta[0] + change[begin]),
        beta[1:q],
        np.linalg.norm(spread[1:q], axis=1),
        fitted,
        left,
    )


@dataclass(frozen=True)
class Change:
    """A parameter that has another value from some time on, or that drifts.

    Attributes
    ----------
    name : str
    kind : {"step", "drift"}
    time, end : float
        Of the step [s], to about one window; or from where to where the parameter drifts.
    relative, deviation : float
        Change over the value before it, and its standard deviation.
    """

    name: str
    kind: str
    time: float
    end: float
    relative: float
    deviation: float

    @property
    def text(self) -> str:
        """The change in words."""
        size = f"{100 * self.relative:+.1f} ± {100 * self.deviation:.1f} %"
        if self.kind == "step":
            return f"{self.name} changed by {size} at {self.time:.1f} s"
        return f"{self.name} drifts by {size} from {self.time:.1f} s to {self.end:.1f} s"


def changes_along(
    look: Look, time: Array, theta: Array, names: Sequence[str]
) -> tuple[list[Change], list[str]]:
    """Find changes of parameters in a record, without any recursive estimator.

    ε ≈ ψᵀ Δθ for a small change of the parameters: the local approach of M. Basseville and
    I. Nikiforov, *Detection of Abrupt Changes* (1993), chapter 8. Least squares in each of forty
    windows gives forty nearly independent Δθ, in which `explain` finds a step or a drift. Both
    sides of a step are fitted from their own samples.

    Parameters
    ----------
    look : callable
        Returns ε (N,) and its gradient ψ (N, p) of the usable samples at any θ.
    time : ndarray (N,)
        [s], of usable samples only.
    theta : ndarray (p,)
        Where to begin.
    names : sequence of str

    Returns
    -------
    changes : list of Change
        The surest, and others of its kind at its time. Windows without information, or in which
        no value explains the motion, do not count.
    unseen : list of str
        Parameters of which the windows show too little to tell.
    """
    theta = fitted_to(look, np.ones(len(time), bool), theta)
    error, psi = look(theta)
    windows = _windows(time, error, psi * theta, len(names))
    least = np.median(windows[2], axis=0) * 2 / np.sqrt(len(windows[0])) if len(windows[0]) else []
    seen = [sd < SEEN for sd in least] if len(windows[0]) >= FEWEST else [False] * len(names)
    unseen = [name for name, known in zip(names, seen, strict=True) if not known]
    changes = _changes(*windows, names)
    if not changes or changes[0].kind == "drift":
        return [change for change in changes if change.kind == "drift"], unseen
    at = changes[0].time
    before, after = (fitted_to(look, side, theta) for side in (time < at, time >= at))
    sizes = dict(zip(names, (after / before - 1).tolist(), strict=True))
    here = [replace(change, relative=sizes[change.name]) for change in changes if change.time == at]
    return [change for change in here if abs(change.relative) >= SMALLEST], unseen


def changes_in(time: Array, error: Array, J: Array, names: Sequence[str]) -> list[Change]:
    """Return the step or drift of each parameter, the surest first.

    Parameters
    ----------
    time, error : ndarray (N,)
        [s], and ε, of usable samples only.
    J : ndarray (N, q)
        Its gradient by relative changes, of the named parameters first.
    names : sequence of str
    """
    return _changes(*_windows(time, error, J, len(names)), names)


def _changes(edges: Array, local: Array, spread: Array, names: Sequence[str]) -> list[Change]:
    changes = list[Change]()
    named = zip(names, local.T, spread.T, strict=False) if len(edges) >= FEWEST else ()
    for name, x, sd in named:
        one = explain(x, sd, false_alarms=FALSE_ALARMS / len(names))
        relative, deviation = one.size / (1 + one.level), one.deviation / (1 + one.level)
        if one.kind == "constant" or abs(relative) < SMALLEST:
            continue
        begin, end = float(edges[one.begin, 0]), float(edges[one.end, 1])
        if one.kind == "step":
            begin = end = float(edges[one.end - 1, 1] + edges[one.end, 0]) / 2
        changes.append(Change(name, one.kind, begin, end, relative, deviation))
    return sorted(changes, key=lambda change: -abs(change.relative) / max(change.deviation, 1e-300))


def _windows(time: Array, error: Array, J: Array, p: int) -> tuple[Array, Array, Array]:
    """Return ends (m, 2), estimate and deviation (m, p) of windows that show the parameters."""
    rows = []
    for k in np.array_split(np.arange(len(time)), WINDOWS):
        if len(k) <= 10 * J.shape[1]:
            continue
        x = np.linalg.lstsq(J[k], error[k], rcond=1e-12)[0]
        left = float(np.std(error[k] - J[k] @ x))
        known = np.abs(np.diag(np.linalg.pinv(J[k].T @ J[k], rcond=1e-14)))[:p]
        sd = np.where(known > 0, left * np.sqrt(known), np.inf)
        rows.append((time[k[[0, -1]]], x[:p], sd, left))
    if not rows:
        return np.empty((0, 2)), *np.empty((2, 0, p))
    edges, x, sd, left = (np.array(column) for column in zip(*rows, strict=True))  # type: ignore[assignment]
    seen = (sd <= USUAL * np.quantile(sd, QUIET, axis=0, method="lower")).all(axis=1)
    seen &= left <= USUAL * np.median(left[seen])  # type: ignore[index]
    return edges[seen], x[seen], sd[seen]


def fitted_to(look: Look, inside: Flags, theta: Array) -> Array:
    """Return the parameters (p,) of a stretch: as long as steps of Gauss and Newton help."""
    best, least, at = theta, np.inf, theta
    for _ in range(STEPS + 1):
        error, psi = (signal[inside] for signal in look(at))
        if not (square := float(error @ error)) < least:
            break
        best, least = at, square
        step = np.linalg.lstsq(psi * at, error, rcond=1e-10)[0]
        at = at * (1 + np.clip(step, -FARTHEST, FARTHEST))
    return best
