"""The model in the frequency domain: G, its derivatives G_θ, and the information in a torque."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.sampling.extended import sampled_system

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def frequency_response(
    model: Parametrization, theta: ArrayLike, omega: ArrayLike, *, period: float
) -> tuple[ComplexArray, ComplexArray]:
    """
    Return G (M,) and G_θ (M, p) of the sampled model at e^{iωT}, eq. (25)–(27).

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
    z = np.exp(1j * np.asarray(omega, float) * period)
    resolvent = z[:, None, None] * np.eye(len(gain)) - transition
    state = np.linalg.solve(resolvent, np.broadcast_to(gain[:, None], (*z.shape, len(gain), 1)))
    response: ComplexArray = (output @ state)[:, :, 0]
    return response[:, -1], response[:, :-1]


def line_spectrum(u: ArrayLike, *, period: float) -> tuple[Array, Array]:
    """
    Return the frequencies ω (M,) [rad/s] and the mean squares (M,) of the DFT lines of a signal.

    The mean squares add up to that of the signal. For a periodic signal take whole periods of its
    steady state.

    Parameters
    ----------
    u : (N,) array_like
    period : float
        Sampling period T [s].
    """
    u = np.asarray(u, float)
    omega = np.asarray(2 * np.pi * np.fft.rfftfreq(len(u), period), np.float64)
    power = np.asarray(np.abs(np.fft.rfft(u) / len(u)) ** 2, np.float64)
    power[1 : (len(u) + 1) // 2] *= 2  # lines of both signs; zero and Nyquist have one only
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
    Return Q = E ψψᵀ (p, p) of a torque from its spectrum; the diagonal is eq. (28).

    Parameters
    ----------
    model : Parametrization
    theta : (p,) array_like
        Identified parameters.
    omega, power : (M,) array_like
        Frequencies [rad/s] and mean squares of the lines, as from `line_spectrum`: the integral
        of (28) as a sum over lines of both signs.
    period : float
        Sampling period T [s].
    """
    _, slopes = frequency_response(model, theta, omega, period=period)
    return ((slopes.conj().T * np.asarray(power, float)) @ slopes).real
