"""Compute averaged spectra of torque and motion, and fit a model to a frequency response."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import csd

from flexaxis.estimators.models.axis_models import MODELS, Traits
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.fit import Setup
from flexaxis.experiments.logs.signals import Array, Log

SEGMENT = 4.0  # length of the segments over which spectra are averaged [s]
SEGMENTS = 6  # minimum number of segments of a short log
COHERENT = 0.8  # minimum coherence at a frequency that is used
SUREST = 0.95  # coherence above which model errors exceed the noise
LATEST = 4.0  # maximum delay in the search [samples]
STRONG = 0.01  # minimum power in the excited band, relative to the median power of the torque
SPREAD = (0.0, *[0.6] * 3)  # standard deviations of the logarithms of the initial values


class Spectra(NamedTuple):
    """Averaged spectra of a torque u and a motion y.

    Attributes
    ----------
    omega : ndarray (M,)
        Angular frequency [rad/s].
    torque : ndarray (M,)
        Power spectral density of the torque.
    gain : ndarray (M,) of complex
        Frequency response from torque to motion.
    coherence : ndarray (M,)
        Fraction of the motion power that the torque explains.
    """

    omega: Array
    torque: Array
    gain: NDArray[np.complex128]
    coherence: Array


def spectra(u: Array, y: Array, period: float) -> Spectra:
    """Compute averaged spectra of torque u (N,) and motion y (N,) by Welch's method.

    A linear trend is removed from each segment. Each segment lasts four seconds, or less if a short
    record would otherwise have fewer than six segments.
    """
    length = min(len(u) // SEGMENTS, round(SEGMENT / period))
    frequency, power = csd([u, y, u], [u, y, y], fs=1 / period, nperseg=length, detrend="linear")
    torque, motion, cross = power[:, 1:]  # without the mean
    coherence = abs(cross) ** 2 / abs(torque * motion)
    return Spectra(2 * np.pi * frequency[1:], torque.real, cross / torque.real, coherence)


def measured_response(log: Log, level: float = 0.0, floor: float = STRONG) -> Spectra:
    """Compute averaged spectra at the frequencies at which the coherence exceeds 0.8.

    Parameters
    ----------
    log : Log
        Log with the torque and the output.
    level : float
        Dry friction torque, in the unit of the logged torque. It is subtracted from the torque.
    floor : float
        Minimum torque power at a frequency, relative to the power-weighted median of the torque
        power. At frequencies with less power, drift and disturbances can be coherent with the
        torque.

    Raises
    ------
    LogError
        If the coherence exceeds 0.8 at fewer than ten frequencies.
    """
    u = log.u - level * np.sign(log.y)
    s = spectra(u[log.ok], log.y[log.ok], log.period)
    power = np.sort(s.torque)[::-1]
    middle = power[np.searchsorted(np.cumsum(power), 0.5 * power.sum())]
    seen = (s.coherence > COHERENT) & (s.torque >= floor * middle)
    if seen.sum() < 10:
        raise LogError(
            f"the torque explains the output at only {int(seen.sum())} frequencies. Either columns "
            "are swapped or shifted, or the excitation is too small or too slow. Log a multisine, "
            "or try --model one_mass"
        )
    return Spectra(*(values[seen] for values in s))


def fit_response(setup: Setup, response: Spectra) -> Setup:
    """Fit a linear model and the torque delay to a frequency response, to obtain initial values.

    The fit minimises the error of the logarithmic response, so that resonances and
    antiresonances have equal weight. The search starts from several values near the nominal
    values, to avoid local minima.

    Parameters
    ----------
    setup : Setup
        Model with nominal values, and names of the identified parameters. Laws of the model are
        ignored. The estimates keep the signs of the nominal values.
    response : Spectra
        Measured frequency response.

    Returns
    -------
    Setup
        Copy of the setup that starts at the estimates. A known delay is not changed.
    """
    period, linear = setup.log.period, replace(setup.model, laws=())
    names = [name for name in setup.names if name in linear.parameters]
    chosen = SIGNALS[setup.log.output].predicted(linear, period).parametrize(names)
    # a hundred frequencies, logarithmically spaced, are enough
    grid = np.geomspace(response.omega[0], response.omega[-1], 100)
    lines = np.unique(np.searchsorted(response.omega, grid * 0.9999))
    omega, _, gain, coherence = (values[lines] for values in response)
    share = np.minimum(coherence, SUREST)
    weight = np.sqrt(share / (1 - share))  # inverse standard deviation of the logarithm, scaled
    p, turn = len(chosen.names), -1j * omega * period

    def compared(x: Array) -> tuple[Array, Array]:
        """Return the misfit (2M,) and its gradient.

        The unknowns x are the logarithms of θ/nominal θ, and a delay in samples.
        """
        theta = chosen.theta * np.exp(x[:p])
        fitted, slopes = frequency_response(chosen, theta, omega, period=period)
        error = weight * np.log(fitted / gain * np.exp(turn * x[p]) + 1e-300)
        rows = weight[:, None] * np.column_stack([slopes * theta / fitted[:, None], turn])
        return np.r_[error.real, error.imag], np.r_[rows.real, rows.imag]

    box = np.r_[np.full(p, -7.0), setup.earliest / period - 1e-6], np.r_[np.full(p, 7.0), LATEST]
    random = np.random.default_rng(0)
    starts = (np.clip(spread * random.standard_normal(p), -2, 2) for spread in SPREAD)
    fits = [
        least_squares(
            lambda x: compared(x)[0], np.r_[start, 0.1], jac=lambda x: compared(x)[1],
            bounds=box, loss="soft_l1", f_scale=0.6, max_nfev=60,
        )
        for start in starts
    ]  # fmt: skip
    best = min(fits, key=lambda fit: float(fit.cost)).x
    theta = chosen.theta * np.exp(best[:p])
    started = setup.having(dict(zip(names, theta.tolist(), strict=True)))
    delay = max(float(best[p] * period), setup.earliest)
    return started if setup.timed else replace(started, delay=delay)


def rough_guess(model: Model, response: Spectra, resonance: float | None) -> dict[str, float]:
    """Return rough parameters of a built-in model, or an empty dict if the model provides none.

    The initial values depend on the total inertia J and the resonance frequency [rad/s]. The
    inertia is computed from the response |G| ≈ 1/(ω J) at low frequencies. If `resonance` is None,
    the resonance is assumed to be at the highest peak of ω |G|.
    """
    guess = MODELS[model.name].guess
    if guess is None:
        return {}
    omega, slope = response.omega, response.omega * abs(response.gain)
    inertia = 1 / float(np.median(slope[: len(slope) // 5]))
    peak = float(omega[np.argmax(slope)])
    return guess(Traits(inertia, 0.1 * inertia * float(omega[0]), resonance or peak))
