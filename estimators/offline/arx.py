"""
High-order ARX models: what the data say about the frequency response, without any physics.

y[k] + a₁ y[k−1] + … + a_n y[k−n] = b₁ u[k−1] + … + b_n u[k−n] + e[k] is linear in its
coefficients, so least squares finds them at once, and it describes any linear system as n grows:
L. Ljung, *System Identification: Theory for the User*, 2nd ed., sections 4.2 and 10.1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.signal import freqz

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Arx:
    """
    A(q) y = B(q) u + e.

    Attributes
    ----------
    a : (n+1,) array
        1, a₁, …, a_n.
    b : (n+1,) array
        0, b₁, …, b_n: a torque acts from the next sample on.
    residual_std : float
        Standard deviation of e, in the unit of y.
    period : float
        Sampling period T [s].
    """

    a: Array
    b: Array
    residual_std: float
    period: float

    def response(self, omega: ArrayLike) -> NDArray[np.complex128]:
        """Return B/A at angular frequencies ω (M,) [rad/s]."""
        return freqz(self.b, self.a, worN=np.asarray(omega, float) * self.period)[1]


def fit_arx(u: ArrayLike, y: ArrayLike, *, order: int, period: float) -> Arx:
    """
    Fit an ARX model of some order n by least squares.

    White noise on y is coloured noise on an ARX model, which biases a low order; an order well
    above that of the axis has room for it.

    Parameters
    ----------
    u, y : (N,) array_like
        Torque and output; more than 3n samples.
    order : int
        n, the number of coefficients of each polynomial.
    period : float
        Sampling period T [s].

    Raises
    ------
    EstimatorError
        If the order is below one, or the record too short for it.
    """
    u, y, _ = check_signals(u, y)
    if not 1 <= order < len(u) / 3:
        raise EstimatorError(
            f"order is {order}; with {len(u)} samples it must lie between 1 and {len(u) // 3}"
        )
    past_y, past_u = (sliding_window_view(x[:-1], order)[:, ::-1] for x in (y, u))
    regressors = np.hstack([-past_y, past_u])
    coefficients, *_ = np.linalg.lstsq(regressors, y[order:])
    residual = y[order:] - regressors @ coefficients
    a, b = np.split(coefficients, 2)
    return Arx(np.r_[1.0, a], np.r_[0.0, b], float(np.std(residual)), period)
