"""When a parameter changes: steps and drifts in a sequence of estimates, and within a record.

The estimates x of n windows or logs are a level, covariates and at most one change. The change is
the step or ramp of the greatest likelihood ratio over all places (M. Basseville and I. Nikiforov,
*Detection of Abrupt Changes*, 1993, section 2.4). Its chance in a sequence without a change comes
from permutations of the residuals, so that the rate of false alarms is the stated one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import median_abs_deviation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Look = Callable[[Array], tuple[Array, Array]]

WINDOWS = 40  # that a record is cut into
FALSE_ALARMS = 0.002  # probability of a change in a record without one
SMALLEST = 0.02  # relative change that is worth a word
STEPS, FARTHEST = 4, 0.5  # of Gauss and Newton, and how far one changes a parameter
BLIND, FOREIGN = 5.0, 5.0  # times the usual deviation and residual, of windows that do not count
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
    best = options[int(np.argmin(costs))]
    if best.kind == "step":
        return best
    shape = np.hstack([ramps[:, [ramp]], waves])  # a ramp alone tells less than the whole drift
    whole = fit.result("drift", best.place, base, shape, float(chance))
    return replace(whole, deviation=best.deviation)


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


@dataclass(frozen=True)
class Change:
    """A parameter that has another value from some time on, or that drifts.

    Attributes
    ----------
    name : str
    kind : {"step", "drift"}
    time : float
        Of the step, or where the drift begins [s], to about one window.
    relative : float
        Change over the value before it; of a drift, up to the end of the log.
    scatters : float
        Change in units of its standard deviation, from the scatter between windows.
    """

    name: str
    kind: str
    time: float
    relative: float
    scatters: float

    @property
    def text(self) -> str:
        """The change in words."""
        verb = "changed" if self.kind == "step" else "drifts"
        when = f"at {self.time:.2f} s" if self.kind == "step" else f"from {self.time:.2f} s on"
        size = f"{100 * self.relative:+.1f} %"
        return f"{self.name} {verb} by {size} {when} ({self.scatters:.0f} times its scatter)"


def changes_along(look: Look, time: Array, theta: Array, names: Sequence[str]) -> list[Change]:
    """Find changes of parameters in a record, without any recursive estimator.

    ε ≈ ψᵀ Δθ for a small change of the parameters: the local approach of M. Basseville and
    I. Nikiforov, *Detection of Abrupt Changes* (1993), chapter 8. Least squares in each of forty
    windows gives forty nearly independent Δθ, in which `series.explain` finds a step or a drift.
    Both sides of a step are fitted from their own values and searched again.

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
    list of Change
        In the order of time. Windows without information, or in which no value explains the
        motion, do not count.
    """

    def along(inside: Flags, theta: Array) -> list[Change]:
        theta = _fitted(look, inside, theta)
        error, psi = (signal[inside] for signal in look(theta))
        told = changes_in(time[inside], error, psi * theta, names, share=float(np.mean(inside)))
        if not told or told[0].kind == "drift":
            return [one for one in told if one.kind == "drift"]
        at = told[0].time
        sides = inside & (time < at), inside & (time >= at)
        before, after = (_fitted(look, side, theta) for side in sides)
        sizes = dict(zip(names, (after / before - 1).tolist(), strict=True))
        here = [
            replace(one, relative=sizes[one.name])
            for one in told
            if one.kind == "step" and one.time == at and abs(sizes[one.name]) >= SMALLEST
        ]
        return [*along(sides[0], before), *here, *along(sides[1], after)] if here else []

    return along(np.ones(len(time), bool), theta)


def changes_in(
    time: Array, error: Array, J: Array, names: Sequence[str], *, share: float = 1.0
) -> list[Change]:
    """Return the step or drift of each parameter, the surest first.

    Parameters
    ----------
    time, error : ndarray (N,)
        [s], and ε, of usable samples only.
    J : ndarray (N, q)
        Its gradient by relative changes, of the named parameters first.
    names : sequence of str
    share : float
        Of the record, that these samples are.
    """
    at, local, spread = _windows(time, error, J, len(names), share)
    result = list[Change]()
    if len(at) < FEWEST:
        return result
    for name, x, sd in zip(names, local.T, spread.T, strict=False):
        one = explain(x, sd, false_alarms=FALSE_ALARMS / len(names))
        relative = one.size / (1 + one.level)
        if one.kind != "constant" and abs(relative) >= SMALLEST:
            sureness = abs(one.size) / max(one.deviation, 1e-300)
            result.append(Change(name, one.kind, float(at[one.place]), relative, sureness))
    return sorted(result, key=lambda one: -one.scatters)


def _windows(
    time: Array, error: Array, J: Array, p: int, share: float
) -> tuple[Array, Array, Array]:
    """Return begin (m,), estimate and deviation (m, p) of windows that show the parameters."""
    pieces = np.array_split(np.arange(len(time)), max(round(WINDOWS * share), 1))
    rows = []
    for k in (piece for piece in pieces if len(piece) > 10 * J.shape[1]):
        x = np.linalg.lstsq(J[k], error[k], rcond=1e-12)[0]
        left = float(np.std(error[k] - J[k] @ x))
        known = np.abs(np.diag(np.linalg.pinv(J[k].T @ J[k], rcond=1e-14)))[:p]
        sd = np.where(known > 0, left * np.sqrt(known), np.inf)
        rows.append((time[k[0]], left, float(np.linalg.norm(J[k])), x[:p], sd))
    if not any(row[2] for row in rows):
        return np.empty(0), *np.empty((2, 0, p))
    at, left, strength, x, sd = (np.array(column) for column in zip(*rows, strict=True))  # type: ignore[assignment]
    seen = strength > np.median(strength[strength > 0]) / BLIND
    seen &= left < FOREIGN * np.median(left[seen])  # type: ignore[index]
    seen &= (sd < BLIND * np.median(sd[seen], axis=0)).all(axis=1)
    return at[seen], x[seen], sd[seen]


def _fitted(look: Look, inside: Flags, theta: Array) -> Array:
    """Return the parameters (p,) of a stretch: as long as steps of Gauss and Newton help."""
    best, least, at = theta, np.inf, theta
    for _ in range(STEPS + 1):
        error, psi = (signal[inside] for signal in look(at))
        square = float(error @ error)
        if not square < least:
            break
        best, least = at, square
        step = np.linalg.lstsq(psi * at, error, rcond=1e-10)[0]
        at = at * (1 + np.clip(step, -FARTHEST, FARTHEST))
    return best
