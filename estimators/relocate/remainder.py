"""What a fit leaves of a stretch: its variance, and how much each sample of it tells."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import repetition
from flexaxis.estimators.relocate.follow import follow
from flexaxis.estimators.relocate.work import CALL, Work, finished, of_sample, samples_of, to_begin
from flexaxis.estimators.sampling.compiler import compiled
from flexaxis.estimators.sampling.prepared import prepare
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]


# Friction that depends on the angle or an unknown torque limit leaves up to 0.02 of the mean square
# of y; told inertias and springs that are off by more than half leave 0.04 to 0.6, and of that many
# samples tell as little as one.
POOR = 0.03, 2.0


class Remainder(NamedTuple):
    """
    What a model leaves of y.

    Attributes
    ----------
    variance : float
        Mean square, of as many samples as parameters leave free.
    repeated : float
        How many samples tell as much as a single one of white noise.
    share : float
        The mean square over that of y.
    """

    variance: float
    repeated: float
    share: float

    @property
    def explained(self) -> bool:
        """Whether this may be noise, and friction of another kind."""
        return self.share < POOR[0] or self.repeated < POOR[1]


def remaining(
    terms: Terms,
    theta: Array,
    x: Array,
    signals: tuple[Array, Array, NDArray[np.bool_]],
    parameters: int,
    *,
    grain: float = np.inf,
) -> Work[Remainder]:
    """
    Return what a model leaves of a stretch, with ρ the correlation of a residual with the next.

    Parameters
    ----------
    terms : Terms
        The model with all parameters.
    theta : (p,) array
    x : (n,) array
        State before the stretch.
    signals : u (N, 2), y (N,), present (N,)
        As of `flexaxis.estimators.relocate.fit.Past`.
    parameters : int
        That were fitted.
    grain : float
        Operations of a piece of the work.
    """
    u, y, present = signals
    cost = of_sample(terms, 1)
    samples = samples_of(grain, cost)
    yield to_begin(terms, 1)
    prepared = prepare(terms, theta, np.zeros(0, np.int64))
    X, left = np.r_[x, 0.0][None], np.zeros(len(u))
    for first in range(0, len(u), samples):
        last = min(first + samples, len(u))
        yield CALL + cost * (last - first)
        X = _left(prepared, X, *signals, left, first, last)
    square, whole = float(left @ left), float(y[present] @ y[present])
    free = max(int(present.sum()) - parameters, 1)
    correlation = float(left[1:] @ left[:-1]) / square if square > 0 else 0.0
    share = square / whole if whole > 0 else 0.0
    return Remainder(square / free, float(repetition.function(correlation)), share)


def remainder(
    terms: Terms,
    theta: Array,
    x: Array,
    signals: tuple[Array, Array, NDArray[np.bool_]],
    parameters: int,
) -> Remainder:
    """Do as `remaining`, at once."""
    return finished(remaining(terms, theta, x, signals, parameters))


@compiled
def _left(prepared, X, u, y, present, left, first, last):  # noqa: PLR0917
    """Write the residual (N,), zero in gaps, of some samples; return the state (1, n+1) then."""
    n, moved = X.shape[1] - 1, np.empty_like(X)
    for k in range(first, last):
        follow(prepared, X, moved, u[k])
        X, moved = moved, X
        if present[k]:
            left[k] = y[k] - X[0, n]
    return X
