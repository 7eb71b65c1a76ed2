"""What claims on sections 2 to 4 are decided on: model, gradient, excitation, off-line fits."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, dlsim, find_peaks

from flexaxis.estimators.offline.frequency import frequency_response, information, line_spectrum
from flexaxis.estimators.offline.identification import Identified
from flexaxis.estimators.offline.predictor import predict
from flexaxis.experiments.paper.claim import Evidence, by_name
from flexaxis.experiments.paper.data import Data
from flexaxis.experiments.paper.experiments import (
    FAR,
    NEAR,
    band,
    magnitude_error,
    steady,
)
from flexaxis.experiments.scoring.parameter_names import true_theta
from flexaxis.sim.record import Record

Array = NDArray[np.float64]
ByName = dict[str, float]


def prediction_error(e: Evidence) -> float:
    """Return the error of ŷ at the true parameters, without noise, over the rms of the speed."""
    record, model = e.data.nominal[0], e.data.parametrization
    assert record.true_speed is not None  # simulated
    predicted, _ = predict(model, model.theta, record.torque, period=record.period)
    return float(np.std(predicted - record.true_speed) / np.std(record.true_speed))


def samples_late(e: Evidence) -> ByName:
    """Return how late a step of each parameter comes [samples].

    What a step on time leaves of the motion is held against what a step one sample later changes.
    """
    return {name: _late(e.data, e.data.faults[name][0], e.data.onset) for name in e.data.names}


def _late(data: Data, record: Record, onset: int) -> float:
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


def friction_derivative(e: Evidence) -> ByName:
    """Return the entry (3,3) of dA/df_m over −1/J_m, and the largest of all others."""
    model = e.data.model.parametrize(["f_m"])
    dA, dB, dC = model.derivatives(model.theta)
    entry, dA = dA[0, 2, 2] * -e.data.scenario.nominal.J_m, dA.copy()
    dA[0, 2, 2] = 0.0
    return {"entry": float(entry), "others": float(max(np.abs(d).max() for d in (dA, dB, dC)))}


def gradient_error(e: Evidence) -> ByName:
    """Return how far ψ is from a central difference of ŷ, relative, for every parameter."""
    return {name: _difference(e.data, name) for name in e.data.model.parameters}


def _difference(data: Data, name: str) -> float:
    model, torque = data.model.parametrize([name]), data.nominal[0].torque[:1000]
    step = 1e-4 * model.theta
    (above, _), (below, _), (_, psi) = (
        predict(model, model.theta + side * step, torque, period=data.scenario.period)
        for side in (1, -1, 0)
    )
    return float(np.linalg.norm((above - below) / (2 * step) - psi[:, 0]) / np.linalg.norm(psi))


def torque_lines(data: Data) -> tuple[Array, Array]:
    """Return frequency [rad/s] and amplitude [N m] of the lines of the torque, first run."""
    period = data.scenario.period
    omega, power = line_spectrum(steady(data, data.nominal[0].torque), period=period)
    excited = omega <= 2 * np.pi * data.excitation.high * 1.001
    lines = np.flatnonzero(excited)[2::2]  # of two periods every second DFT line is one
    return omega[lines], np.sqrt(2 * power[lines])


def torque_peaks(e: Evidence) -> ByName:
    """Return the peaks of the torque's spectrum [rad/s]; the edge of the band can be one."""
    omega, amplitude = torque_lines(e.data)
    peaks, _ = find_peaks(np.r_[0, amplitude, 0])
    return {f"peak {i}": float(w) for i, w in enumerate(omega[peaks - 1], 1)}


def low_energy(e: Evidence) -> float:
    """Return the share of the torque's energy below 70 rad/s [%]."""
    omega, amplitude = torque_lines(e.data)
    return 100 * float(np.sum(amplitude[omega < 70] ** 2) / np.sum(amplitude**2))


def gradient_power(e: Evidence) -> ByName:
    """Return the mean of ψ² of each parameter."""
    return by_name(e, np.diag(e.convergence.Q))


def power_over_spectrum(e: Evidence) -> Array:
    """Return the mean of ψ² over the integral of |G_θ|² over the spectrum, the worst run's."""
    model, period = e.data.parametrization, e.data.scenario.period
    ratios = []
    for record in e.data.nominal:
        _, psi = predict(model, model.theta, record.torque, period=period)
        lines = line_spectrum(steady(e.data, record.torque), period=period)
        from_spectrum = np.diag(information(model, model.theta, *lines, period=period))
        ratios.append(np.mean(steady(e.data, psi) ** 2, axis=0) / from_spectrum)
    return worst(np.array(ratios))


def worst(ratios: Array) -> Array:
    """Return of each column (S, p) the ratio that is farthest from one."""
    return ratios[np.argmax(np.abs(np.log(ratios)), axis=0), np.arange(ratios.shape[1])]


def offline_error(e: Evidence) -> Array:
    """Return the largest error of off-line identification in any run [% of nominal]."""
    ratios = np.array([run.theta / e.data.parametrization.theta for run in e.offline.runs])
    return 100 * np.abs(ratios - 1).max(axis=0)


def _normalised(e: Evidence) -> Array:
    """Return the off-line errors (S, p) over the standard deviations claimed with them."""
    theta = e.data.parametrization.theta
    return np.array([(run.theta - theta) / run.standard_deviations for run in e.offline.runs])


def offline_deviations(e: Evidence) -> Array:
    """Return the largest error in any run, in standard deviations claimed with it."""
    return np.abs(_normalised(e)).max(axis=0)


def offline_rms(e: Evidence) -> float:
    """Return the rms of the errors over the standard deviations claimed with them."""
    return float(np.sqrt(np.mean(_normalised(e) ** 2)))


def near_starts(e: Evidence) -> ByName:
    """Return the largest difference of what is found from 1.2 and from 1.5, and the warnings."""
    runs = [e.offline.starts[start] for start in NEAR]
    return {
        "difference": float(np.max(np.abs(runs[0].theta / runs[1].theta - 1))),
        "warnings": float(sum(len(run.warnings) for run in runs)),
    }


def far_starts(e: Evidence) -> ByName:
    """Return the correlation of the residual by the start, 0 where no local minimum is told."""
    runs = {start: e.offline.starts[start] for start in FAR}
    return {
        f"{start:g}×": run.correlation if not _untold(run, ["local minimum"]) else 0.0
        for start, run in runs.items()
    }


def _untold(run: Identified, words: Iterable[str]) -> list[str]:
    return [word for word in words if word not in " ".join(run.warnings)]


def free_scale(e: Evidence) -> ByName:
    """Return the condition with all parameters free, and how many of them no warning names."""
    run = e.offline.everything
    return {"condition": run.condition, "unnamed": float(len(_untold(run, run.names)))}


def physical_error(e: Evidence) -> float:
    """Return the largest error of the identified model's magnitude in the band [dB]."""
    run, period = e.offline.physical, e.data.scenario.period
    model = e.data.model.parametrize(run.names)
    response, _ = frequency_response(model, run.theta, band(), period=period)
    return magnitude_error(e.data, response, band())


def arx_error(e: Evidence, *orders: int) -> ByName:
    """Return the same of ARX models, by their order."""
    return {
        f"order {order}": magnitude_error(e.data, e.offline.arx[order].response(band()), band())
        for order in orders
    }
