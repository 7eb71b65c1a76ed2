"""When parameters change within a record: steps and drifts, without any recursive estimator."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.series import FEWEST, explain

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Look = Callable[[Array], tuple[Array, Array]]

WINDOWS = 40  # that a record is cut into
FALSE_ALARMS = 0.002  # probability of a change in a record without one
SMALLEST = 0.02  # relative change that is worth a word
STEPS, FARTHEST = 4, 0.5  # of Gauss and Newton, and how far one changes a parameter
BLIND, FOREIGN = 5.0, 5.0  # times the usual deviation and residual, of windows that do not count


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
        sd = left * np.sqrt(np.where(known > 0, known, np.inf))
        rows.append((time[k[0]], left, float(np.linalg.norm(J[k])), x[:p], sd))
    if not rows:
        return np.empty(0), *np.empty((2, 0, p))
    at, left, strength, x, sd = (np.array(column) for column in zip(*rows, strict=True))
    seen = (strength > np.median(strength) / BLIND) & (left < FOREIGN * np.median(left))
    seen &= (sd < BLIND * np.median(sd, axis=0)).all(axis=1)
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
