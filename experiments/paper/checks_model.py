"""Claims of the paper's sections 2 to 4: model, gradient, excitation, off-line identification.

A check is a function of the evidence: to add a claim, write one more.
"""

# ruff: noqa: D401  (the first line of a docstring is the claim)

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, dlsim, find_peaks

from flexaxis.estimators import Rpem, literal_rpem
from flexaxis.estimators.offline.frequency import frequency_response, information, line_spectrum
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.paper.claims import Decided, Evidence, by_name, check
from flexaxis.experiments.paper.convergence import FORGETTING, steady
from flexaxis.experiments.paper.data import Data, signals
from flexaxis.experiments.paper.offline import (
    FAR,
    HIGH_ORDER,
    LOW_ORDER,
    NEAR,
    band,
    magnitude_error,
)
from flexaxis.experiments.scoring.theta import true_theta
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

PEAKS = (95.0, 125.0, 185.0)
"""Peaks of the torque spectrum that the paper reports [rad/s]."""


@check("section 2, eq. (1)–(4); section 3.2", "relative rms error ≤ 3e-4")
def model_predicts_the_plant(e: Evidence) -> Decided:
    """At the true parameters the sampled model gives the motor speed of the MuJoCo axis."""
    record, model = e.data.nominal[0], e.data.parametrization
    assert record.true_speed is not None  # simulated
    predicted, _ = predict(model, model.theta, record.torque, period=record.period)
    error = float(np.std(predicted - record.true_speed) / np.std(record.true_speed))
    return error, error <= 3e-4


@check("section 2, eq. (1)–(4)", "|samples late| ≤ 0.25 for a step of each parameter")
def faults_come_on_time(e: Evidence) -> Decided:
    """A step of a parameter acts on the motion from the very sample on at which the truth steps."""
    late = {name: _samples_late(e.data, name) for name in e.data.names}
    return late, max(map(abs, late.values())) <= 0.25


def _samples_late(data: Data, name: str) -> float:
    """Return how late a fault comes [samples].

    What a step on time leaves of the motion is held against what a step one sample later changes.
    """
    record, onset = data.faults[name][0], data.onset
    assert record.true_speed is not None and record.true_parameters is not None  # simulated
    truth = true_theta(data.names, record.true_parameters)
    on_time, later = (_speed(data, record, (truth[0], truth[-1]), onset + d) for d in (0, 1))
    along = (later - on_time)[onset:]
    left = (record.true_speed - on_time)[onset:]
    # the small error of the sampled model is the same before the step
    return float(along @ left / (along @ along))


def _speed(data: Data, record: Record, theta: tuple[Array, Array], step: int) -> Array:
    """Return the motor speed (N,) [rad/s] of eq. (1)–(4) with parameters that step once."""
    x, speed = np.zeros(data.parametrization.states), []
    for value, part in zip(theta, (slice(step), slice(step, None)), strict=True):
        A, B, C = data.parametrization.matrices(value)
        system = cont2discrete((A, B, C, np.zeros((1, 1))), record.period)
        _, y, states = dlsim(system, np.r_[record.torque[part], 0], x0=x)
        speed.append(y[:-1, 0])
        x = states[-1]
    return np.concatenate(speed)


@check("section 3.2, eq. (18), (20), (24)", "the entry (3,3) is −1/J_m, all others are 0")
def derivative_for_friction(e: Evidence) -> Decided:
    """The derivative of A for f_m has the one entry −1/J_m, those of B and C are zero."""
    model = e.data.model.parametrize(["f_m"])
    dA, dB, dC = model.derivatives(model.theta)
    expected = np.zeros((5, 5))
    expected[2, 2] = -1 / e.data.scenario.nominal.J_m
    error = max(np.abs(dA[0] - expected).max(), np.abs(dB).max(), np.abs(dC).max())
    return float(dA[0, 2, 2] * e.data.scenario.nominal.J_m), bool(error <= 1e-9)


@check("section 3.2, eq. (16)–(23)", "relative error ≤ 1e-5 for every parameter")
def gradient_is_the_derivative(e: Evidence) -> Decided:
    """ψ of the extended system is the derivative of ŷ, for each of the twelve parameters."""
    torque = e.data.nominal[0].torque[:1000]
    errors = {name: _gradient_error(e.data, name, torque) for name in e.data.model.parameters}
    return errors, max(errors.values()) <= 1e-5


def _gradient_error(data: Data, name: str, torque: Array) -> float:
    """Compare ψ with a central difference of ŷ."""
    model, period = data.model.parametrize([name]), data.scenario.period
    step = 1e-4 * model.theta
    above, below = (
        predict(model, model.theta + side * step, torque, period=period)[0] for side in (1, -1)
    )
    _, psi = predict(model, model.theta, torque, period=period)
    return float(np.linalg.norm((above - below) / (2 * step) - psi[:, 0]) / np.linalg.norm(psi))


@check("section 3.1, eq. (5)–(9), (15)–(23)", "largest difference of θ̂ over nominal ≤ 1e-9")
def compiled_filter_is_the_papers(e: Evidence) -> Decided:
    """The compiled filter gives the estimates of the equations taken word for word."""
    record, model = e.data.nominal[0], e.data.parametrization
    u, y = signals(record)
    runs = [
        method(
            e.data.model,
            identify=e.data.names,
            theta0=e.data.scenario.start * model.theta,
            P0=e.convergence.forgetting.P0,
            period=record.period,
            forgetting=FORGETTING,
        ).run(u[:1000], y[:1000])
        for method in (Rpem, literal_rpem)
    ]
    error = float(np.max(np.abs(runs[0] - runs[1]) / model.theta))
    return error, error <= 1e-9


def torque_lines(data: Data) -> tuple[Array, Array]:
    """Return frequency [rad/s] and amplitude [N m] of the lines of the torque, first run."""
    period = data.scenario.period
    omega, power = line_spectrum(steady(data, data.nominal[0].torque), period=period)
    excited = omega <= 2 * np.pi * data.excitation.high * 1.001
    lines = np.flatnonzero(excited)[2::2]  # of two periods every second DFT line is one
    return omega[lines], np.sqrt(2 * power[lines])


def torque_peaks(data: Data) -> Array:
    """Return the peaks of the torque's spectrum [rad/s]; the edge of the band can be one."""
    omega, amplitude = torque_lines(data)
    peaks, _ = find_peaks(np.r_[0, amplitude, 0])
    return omega[peaks - 1]


@check("section 4, Fig. 3", "three peaks, each within 8 rad/s of 95, 125 and 185 rad/s")
def peaks_of_the_torque(e: Evidence) -> Decided:
    """The spectrum of the torque in closed loop has peaks around 95, 125 and 185 rad/s."""
    peaks = torque_peaks(e.data)
    near = len(peaks) == len(PEAKS) and bool(np.all(np.abs(peaks - PEAKS) <= 8))
    return {f"peak {i}": float(w) for i, w in enumerate(peaks, 1)}, near


def low_energy(data: Data) -> float:
    """Return the share of the torque's energy below 70 rad/s [%]."""
    omega, amplitude = torque_lines(data)
    return 100 * float(np.sum(amplitude[omega < 70] ** 2) / np.sum(amplitude**2))


@check("section 4, Fig. 3", "< 5 % of the energy")
def little_torque_below_70(e: Evidence) -> Decided:
    """The energy of the torque is low below 70 rad/s."""
    share = low_energy(e.data)
    return share, share < 5


@check("section 5.1, Fig. 5, eq. (28)", "f_m over 1/J_a over k_T")
def order_of_the_gradients(e: Evidence) -> Decided:
    """The variance of ψ is highest for f_m, less for 1/J_a and lowest for k_T."""
    power = by_name(e.data.names, np.diag(e.convergence.Q))
    return power, power["f_m"] > power["1/J_a"] > power["k_T"]


@check("section 3.3, eq. (28), (31)", "ratio within 1 % of one in every run")
def spectrum_gives_the_variance(e: Evidence) -> Decided:
    """The integral of |G_θ|² over the spectrum of the torque is the mean of ψ² over time."""
    model, period = e.data.parametrization, e.data.scenario.period
    ratios = []
    for record in e.data.nominal:
        _, psi = predict(model, model.theta, record.torque, period=period)
        lines = line_spectrum(steady(e.data, record.torque), period=period)
        from_spectrum = np.diag(information(model, model.theta, *lines, period=period))
        ratios.append(np.mean(steady(e.data, psi) ** 2, axis=0) / from_spectrum)
    worst = np.max(np.abs(np.array(ratios) - 1))
    return by_name(e.data.names, np.mean(ratios, axis=0)), bool(worst <= 0.01)


@check("section 4", "≤ 0.3 % of each parameter in every run")
def offline_finds_the_parameters(e: Evidence) -> Decided:
    """Off-line output error over 60 s, started 20 % too high, finds the parameters."""
    errors = 100 * np.abs([run.theta / e.data.parametrization.theta - 1 for run in e.offline.runs])
    worst = by_name(e.data.names, errors.max(axis=0))
    return worst, max(worst.values()) <= 0.3


def _normalised(e: Evidence) -> Array:
    """Return the off-line errors (S, p) over the standard deviations claimed with them."""
    theta = e.data.parametrization.theta
    return np.array([(run.theta - theta) / run.standard_deviations for run in e.offline.runs])


@check("section 4", "≤ 3 of its own standard deviations in every run")
def offline_within_its_deviations(e: Evidence) -> Decided:
    """Each parameter identified off line lies within three of its standard deviations."""
    worst = by_name(e.data.names, np.abs(_normalised(e)).max(axis=0))
    return worst, max(worst.values()) <= 3


@check("section 4", "rms error between 0.5 and 1.5 of the standard deviation claimed")
def offline_deviations_are_right(e: Evidence) -> Decided:
    """The standard deviations of off-line identification are those that are seen."""
    ratio = float(np.sqrt(np.mean(_normalised(e) ** 2)))
    return ratio, 0.5 <= ratio <= 1.5


@check("section 4", "no warning, the same estimates to 1e-4")
def offline_near_starts_agree(e: Evidence) -> Decided:
    """Off-line identification finds the same from 1.2 and from 1.5 times nominal."""
    runs = [e.offline.starts[start] for start in NEAR]
    difference = float(np.max(np.abs(runs[0].theta / runs[1].theta - 1)))
    return difference, difference <= 1e-4 and not any(run.warnings for run in runs)


@check("section 4", "a warning for 0.5, 0.7 and 2 times nominal")
def offline_reports_local_minima(e: Evidence) -> Decided:
    """Started too far off, identification ends in a local minimum and says so."""
    correlations = {f"{s:g}×": e.offline.starts[s].correlation for s in FAR}
    said = all("local minimum" in " ".join(e.offline.starts[s].warnings) for s in FAR)
    return correlations, said and min(correlations.values()) > 0.5


@check("section 4", "condition > 1e10, and the warning names every parameter")
def offline_reports_the_free_scale(e: Evidence) -> Decided:
    """Torque and speed leave the scale of all parameters open: one of k_T and J_m must be known."""
    run = e.offline.everything
    named = all(name in " ".join(run.warnings) for name in run.names)
    return run.condition, named and run.condition > 1e10


@check("section 4, Fig. 4", "within 0.25 dB of the truth over 40–188 rad/s")
def identified_model_fits(e: Evidence) -> Decided:
    """The physical model identified from the data has the frequency response of the axis."""
    model = e.data.model.parametrize(e.offline.physical.names)
    response, _ = frequency_response(
        model, e.offline.physical.theta, band(), period=e.data.scenario.period
    )
    error = magnitude_error(e.data, response, band())
    return error, error <= 0.25


@check("section 4, Fig. 4", "within 1 dB of the truth over 40–188 rad/s from order 30 on")
def high_order_arx_agrees(e: Evidence) -> Decided:
    """A very high order ARX model agrees with the physical one."""
    errors = _arx_errors(e, (30, HIGH_ORDER))
    return errors, max(errors.values()) <= 1


@check("section 4, Fig. 4", "more than 3 dB off at order 10")
def low_order_arx_does_not(e: Evidence) -> Decided:
    """The order of the ARX model has to be very high: white output noise biases a low one."""
    errors = _arx_errors(e, (LOW_ORDER,))
    return errors, min(errors.values()) > 3


def _arx_errors(e: Evidence, orders: tuple[int, ...]) -> dict[str, float]:
    return {
        f"order {order}": magnitude_error(e.data, e.offline.arx[order].response(band()), band())
        for order in orders
    }
