"""
Frequency responses of grey-box models, and fits of high-order ARX models.

The ARX model y[k] + a₁ y[k−1] + … + a_n y[k−n] = b₁ u[k−1] + … + b_n u[k−n] + e[k] is linear in its
coefficients, so linear least squares determines the coefficients. An ARX model of sufficiently high
order n can describe any linear system without physical assumptions. Sections 4.2 and 10.1 of
Ljung's *System Identification* (2nd edition) describe ARX models.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.discretisation import sampled_system
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]


def fit_arx(u: ArrayLike, y: ArrayLike, *, order: int) -> tuple[Array, Array]:
    """
    Fit an ARX model of order n by least squares, and return its coefficients.

    The function returns two vectors (n+1,) with the elements 1, a₁, …, a_n and 0, b₁, …, b_n. White
    noise in y acts as coloured noise in an ARX model, and this noise biases a model of low order. A
    model whose order is much higher than the order of the axis can represent the colour of the
    noise.

    Parameters
    ----------
    u, y : (N,) array_like
        Torque and measured output; the number N of samples must exceed 3n.
    order : int
        Order n, which is the number of unknown coefficients of each polynomial.

    Raises
    ------
    EstimatorError
        If the order is below one, or if the record is too short for the order.
    """
    u, y, _ = check_signals(u, y)
    if not 1 <= order < len(u) / 3:
        raise EstimatorError(
            f"order is {order}, but for {len(u)} samples the model order must lie between 1 and "
            f"{len(u) // 3}"
        )
    past_y, past_u = (sliding_window_view(x[:-1], order)[:, ::-1] for x in (y, u))
    regressors = np.hstack([-past_y, past_u])
    coefficients, *_ = np.linalg.lstsq(regressors, y[order:])
    a, b = np.split(coefficients, 2)
    return np.r_[1.0, a], np.r_[0.0, b]


ComplexArray = NDArray[np.complex128]


def frequency_response(
    model: Parametrization, theta: ArrayLike, omega: ArrayLike, *, period: float
) -> tuple[ComplexArray, ComplexArray]:
    """
    Return the frequency response G (M,) of the sampled model and its gradient G_θ (M, p).

    Equations (25)–(27) define G and G_θ, which are evaluated at z = e^{iωT}.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    omega : (M,) array_like
        Angular frequencies [rad/s].
    period : float
        Sampling period T [s].
    """
    transition, gain, output = sampled_system(model, theta, period)
    z, n = np.exp(1j * np.asarray(omega, float) * period), model.n
    resolvent = np.linalg.inv(z[:, None, None] * np.eye(n) - transition[-n:, -n:])
    state = resolvent @ gain[-n:]
    # the state drives the sensitivities, which all have the same resolvent as the state
    driven = (state @ transition[:-n, -n:].T + gain[:-n]).reshape(len(z), -1, n)
    states = np.concatenate([driven @ resolvent.swapaxes(1, 2), state[:, None]], axis=1)
    response = np.asarray(states.reshape(len(z), -1) @ output.T, np.complex128)
    return response[:, -1], response[:, :-1]


def line_spectrum(u: ArrayLike, *, period: float) -> tuple[Array, Array]:
    """
    Return the frequencies ω (M,) [rad/s] and mean squares (M,) of all DFT lines of a signal.

    The sum of the mean squares of all DFT lines is the mean square of the signal. If the signal is
    periodic, the record should contain a whole number of periods in steady state.

    Parameters
    ----------
    u : (N,) array_like
        Signal.
    period : float
        Sampling period T [s].
    """
    u = np.asarray(u, float)
    omega = np.asarray(2 * np.pi * np.fft.rfftfreq(len(u), period), np.float64)
    power = np.asarray(np.abs(np.fft.rfft(u) / len(u)) ** 2, np.float64)
    power[1 : (len(u) + 1) // 2] *= 2  # both signs of ω; zero and the Nyquist frequency occur once
    return omega, power


def information(
    model: Parametrization,
    theta: ArrayLike,
    omega: ArrayLike,
    power: ArrayLike,
    *,
    period: float,
) -> Array:
    """
    Return the information matrix Q = E ψψᵀ (p, p) of the gradient ψ for a torque spectrum.

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    omega, power : (M,) array_like
        Frequencies [rad/s] and mean squares of the spectral lines, as returned by `line_spectrum`.
        Each diagonal element of Q is an integral as in equation (28), computed as a sum over the
        spectral lines.
    period : float
        Sampling period T [s].
    """
    _, slopes = frequency_response(model, theta, omega, period=period)
    return ((slopes.conj().T * np.asarray(power, float)) @ slopes).real
