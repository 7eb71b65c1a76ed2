"""Whether the loop is stable on the nominal linear axis, before anything is simulated.

From the equations of motion, M q̈ + D q̇ + K q = k_T u for the angles q of motor, gear and arm, with
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
_ANGLE, _MOTOR, _ERROR, _SPEED, _INTEGRAL, _HELD, _CHAINS = 0, 3, 6, 7, 8, 9, 10


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
    size = _CHAINS + torque + late
    sample = _command(config, period, size, torque, late)
    tick = _tick(parameters, period / ticks, size, torque)
    loop = np.linalg.matrix_power(tick, ticks) @ sample
    return float(np.abs(np.linalg.eigvals(loop)).max())


def _tick(parameters: AxisParameters, period: float, size: int, torque: int) -> Array:
    """Return what a tick does to plant and torques on the way, as (size, size)."""
    F, g = _sampled(parameters, period)
    step = np.eye(size)
    step[:6, :6] = F
    acting = _CHAINS if torque else _HELD  # the oldest torque on the way
    step[:6, acting] = g
    for place in range(_CHAINS, _CHAINS + torque):
        step[place] = 0.0
        step[place, place + 1 if place + 1 < _CHAINS + torque else _HELD] = 1.0
    return step


def _command(config: ControllerConfig, period: float, size: int, torque: int, late: int) -> Array:
    """Return what the controller does at a sample, as (size, size); see `Controller`."""
    pole = np.exp(-period / config.tau) if config.tau > 0 else 0.0
    eye = np.eye(size)
    first = _CHAINS + torque
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
    """Return F (6, 6) and g (6,) of angles and speeds from sample to sample, torque held.

    By the Runge-Kutta steps of the engine, which on a linear axis are series of fourth order.
    """
    steps = substeps([], period)
    A = _continuous(parameters) * (period / steps)
    term = total = np.eye(len(A))
    for order in range(1, 5):
        term = term @ A / order
        total = total + term
    sampled = np.linalg.matrix_power(total, steps)
    return sampled[:6, :6], sampled[:6, 6]


def _continuous(parameters: AxisParameters) -> Array:
    """Return the derivative (7, 7) of angles, speeds and a held torque."""
    p = parameters
    gear, arm = np.array([p.r, -1.0, 0.0]), np.array([0.0, 1.0, -1.0])  # twists over angles
    K = p.k_g * np.outer(gear, gear) + p.k_a * np.outer(arm, arm)
    D = p.d_g * np.outer(gear, gear) + p.d_a * np.outer(arm, arm) + np.diag([p.f_m, p.f_g, p.f_a])
    A = np.zeros((7, 7))
    A[:3, 3:6] = np.eye(3)
    A[3:6, :6] = -np.hstack([K, D]) / np.array([[p.J_m], [p.J_g], [p.J_a]])
    A[_MOTOR, 6] = p.k_T / p.J_m
    return A
