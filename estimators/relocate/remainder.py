"""What a fit leaves of a stretch: its variance, and how much each sample of it tells."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import repetition
from flexaxis.estimators.relocate.follow import follow
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


def remainder(
    terms: Terms,
    theta: Array,
    x: Array,
    signals: tuple[Array, Array, NDArray[np.bool_]],
    parameters: int,
) -> Remainder:
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
    """
    left = _left(terms, theta, x, *signals)
    y, present = signals[1:]
    square, whole = float(left @ left), float(y[present] @ y[present])
    free = max(int(present.sum()) - parameters, 1)
    correlation = float(left[1:] @ left[:-1]) / square if square > 0 else 0.0
    share = square / whole if whole > 0 else 0.0
    return Remainder(square / free, float(repetition.function(correlation)), share)


@compiled
def _left(terms, theta, x, u, y, present):  # noqa: PLR0917
    """Return the residual (N,), zero in gaps."""
    n = terms.n
    prepared = prepare(terms, theta, np.zeros(0, np.int64))
    X = np.zeros((1, n + 1))
    for i in range(n):
        X[0, i] = x[i]
    moved, left = np.empty_like(X), np.zeros(len(u))
    for k in range(len(u)):
        follow(prepared, X, moved, u[k])
        X, moved = moved, X
        if present[k]:
            left[k] = y[k] - X[0, n]
    return left
