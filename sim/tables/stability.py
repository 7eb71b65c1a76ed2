"""Whether the loop is stable on the nominal linear axis, before anything is simulated.

From the equations of motion, M q̈ + D q̇ + K q = k_T u for the angles q of the masses, with
controller, period and delays of a scenario.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.parameters import AxisParameters
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.timing import TICK

Array = NDArray[np.float64]

GROWTH = 1e-6  # of a mode in a sample: less than e-fold in a million samples is rounding
HALVINGS = 20  # of Kv, in search of one with which the loop is stable
_ERROR, _SPEED, _INTEGRAL, _HELD, _ANGLE = range(5)  # what follows are the other angles, and speeds


def loop_problem(
    parameters: AxisParameters,
    config: ControllerConfig,
    period: float,
    *,
    torque_ticks: int = 0,
    late: int = 0,
) -> str | None:
    """Return that the loop is unstable, and which Kv would do, or None for a stable one.

    Parameters
    ----------
    parameters : AxisParameters
        Of the nominal axis.
    config : ControllerConfig
    period : float
        Sampling period T [s].
    torque_ticks : int
        Delay of the torque [ms].
    late : int
        Samples by which the angle comes late to the controller.
    """
    radius = _radius(parameters, config, period, torque_ticks, late)
    if radius <= 1 + GROWTH:
        return None
    limit = _stable_Kv(parameters, config, period, torque_ticks, late)
    advice = (
        f"controller.Kv up to {0.99 * limit:.3g} is stable, {limit / 2:.2g} with a gain margin of 2"
        if limit
        else "look at controller.Kp, controller.Ki and the delays, for no smaller Kv would do"
    )
    return (
        f"the loop is unstable on the nominal axis with Kv = {config.Kv:g} and samples of "
        f"{1000 * period:g} ms (its fastest mode grows {radius:.6g}-fold in a sample): {advice}"
    )


def _stable_Kv(
    parameters: AxisParameters, config: ControllerConfig, period: float, ticks: int, late: int
) -> float | None:
    """Return about the largest Kv below the given one with a stable loop, or None."""

    def stable(Kv: float) -> bool:
        other = config.model_copy(update={"Kv": Kv})
        return _radius(parameters, other, period, ticks, late) <= 1

    low = next((Kv for i in range(HALVINGS) if stable(Kv := config.Kv / 2 ** (i + 1))), None)
    if low is None:
        return None
    high = 2 * low
    while high > 1.01 * low:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


@lru_cache(maxsize=256)  # a sweep makes many scenarios with one loop
def _radius(
    parameters: AxisParameters, config: ControllerConfig, period: float, torque: int, late: int
) -> float:
    """Return the largest growth of a mode of the closed loop from sample to sample."""
    if config.rate:
        period = TICK
    ticks = round(period / TICK) if torque else 1
    F, g = _sampled(parameters, period / ticks)
    size = _ANGLE + len(g) + torque + late
    sample = _command(config, period, size, late)
    tick = _tick(F, g, size, torque)
    loop = np.linalg.matrix_power(tick, ticks) @ sample
    return float(np.abs(np.linalg.eigvals(loop)).max())


def _tick(F: Array, g: Array, size: int, torque: int) -> Array:
    """Return what a tick does to plant and torques on the way, as (size, size)."""
    step, chain = np.eye(size), _ANGLE + len(g)
    step[_ANGLE:chain, _ANGLE:chain] = F
    step[_ANGLE:chain, chain if torque else _HELD] = g  # the oldest torque on the way
    for place in range(chain, chain + torque):
        step[place] = 0.0
        step[place, place + 1 if place + 1 < chain + torque else _HELD] = 1.0
    return step


def _command(config: ControllerConfig, period: float, size: int, late: int) -> Array:
    """Return what the controller does at a sample, as (size, size); see `Controller`."""
    pole = np.exp(-period / config.tau) if config.tau > 0 else 0.0
    eye = np.eye(size)
    first = size - late
    error = -eye[first if late else _ANGLE]
    speed = pole * eye[_SPEED] + (1 - pole) / period * (error - eye[_ERROR])
    wanted = config.Kp * error + speed
    integral = eye[_INTEGRAL] + period * config.Ki * wanted
    step = np.eye(size)
    step[_ERROR], step[_SPEED], step[_INTEGRAL] = error, speed, integral
    step[_HELD] = config.Kv * (wanted + integral)
    for place in range(first, first + late):  # the oldest angle first
        step[place] = eye[place + 1 if place + 1 < first + late else _ANGLE]
    return step


def _sampled(parameters: AxisParameters, period: float) -> tuple[Array, Array]:
    """Return F (2n, 2n) and g (2n,) of angles and speeds from sample to sample, torque held.

    By the Runge-Kutta steps of the engine, which on a linear axis are series of fourth order.
    """
    steps = substeps([], period)
    A = _continuous(parameters) * (period / steps)
    term = total = np.eye(len(A))
    for order in range(1, 5):
        term = term @ A / order
        total = total + term
    sampled = np.linalg.matrix_power(total, steps)
    return sampled[:-1, :-1], sampled[:-1, -1]


def _continuous(parameters: AxisParameters) -> Array:
    """Return the derivative (2n + 1, 2n + 1) of angles, speeds and a held torque."""
    J, k, d, f = (
        np.array([value for name, value in parameters.items() if name[0] == kind and name != "k_T"])
        for kind in "Jkdf"
    )
    n = len(J)
    twists = np.eye(n)[:-1] - np.eye(n)[1:]  # over angles
    twists[0, 0] = parameters.get("r", 1.0)
    K, D = twists.T * k @ twists, twists.T * d @ twists + np.diag(f)
    A = np.zeros((2 * n + 1, 2 * n + 1))
    A[:n, n:-1] = np.eye(n)
    A[n:-1, :-1] = -np.hstack([K, D]) / J[:, None]
    A[n, -1] = parameters.k_T / J[0]
    return A
