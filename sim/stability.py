"""Before a simulation, check whether the control loop with the nominal linear axis is stable.

The equations of motion are M q̈ + D q̇ + K q = k_T u, where the vector q contains the angles of the
masses and u is the torque command. The stability check takes the controller, the sampling period
and the delays of a scenario into account.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.parameters import AxisParameters
from flexaxis.sim.tables.controller import Controller, ControllerConfig
from flexaxis.sim.tables.nonlinear import substeps
from flexaxis.sim.timing import TICK

Array = NDArray[np.float64]

GROWTH = 1e-6  # relative growth of a mode per sample that rounding errors can cause


def loop_problem(
    parameters: AxisParameters,
    config: ControllerConfig,
    period: float,
    *,
    torque_ticks: int = 0,
    late: int = 0,
) -> str | None:
    """Return an error message if the control loop is unstable; otherwise return None.

    Parameters
    ----------
    parameters : AxisParameters
        Parameters of the nominal axis.
    config : ControllerConfig
        Gains and sampling rate of the controller.
    period : float
        Sampling period T [s].
    torque_ticks : int
        Delay of the torque [ms].
    late : int
        Delay of the motor angle that the controller reads [samples].
    """
    growth = _radius(parameters, config, period, torque_ticks, late)
    if growth <= 1 + GROWTH:
        return None
    return (
        f"the control loop with the nominal axis is unstable for Kv = {config.Kv:g} and a sampling "
        f"period of {1000 * period:g} ms (a mode grows by a factor of {growth:.6g} per sample). "
        "Lower controller.Kv, or check controller.Kp, controller.Ki and the delays"
    )


@lru_cache(maxsize=256)  # a sweep contains many scenarios with the same loop
def _radius(
    parameters: AxisParameters, config: ControllerConfig, period: float, torque: int, late: int
) -> float:
    """Return the spectral radius: the largest factor by which a mode of the loop grows per sample.

    The state of the closed loop consists of the states of the controller, the plant and the delays.
    The function simulates one sample with each unit vector as the initial state. The resulting
    states are the columns of the transition matrix. The spectral radius is the largest absolute
    eigenvalue of the transition matrix.
    """
    if config.rate:
        period = TICK
    ticks = round(period / TICK) if torque else 1
    F, g = _sampled(parameters, period / ticks)
    first, last = 3 + len(g), 3 + len(g) + torque
    size = last + late
    unit = np.eye(size)
    controller = Controller(config, size, period=period)
    controller.state = unit[:3].copy()
    x, torques, angles = unit[3:first], [*unit[first:last]], [*unit[last:]]
    angles.append(x[0])
    command = controller.torque(np.zeros(size), angles.pop(0))
    for _ in range(ticks):
        torques.append(command)
        x = F @ x + np.outer(g, torques.pop(0))
    loop = np.vstack([controller.state, x, *torques, *angles])
    return float(np.abs(np.linalg.eigvals(loop)).max())


def _sampled(parameters: AxisParameters, period: float) -> tuple[Array, Array]:
    """Return F and g of the discrete-time axis model x[k+1] = F x[k] + g u[k].

    The state x contains the angles and speeds of the masses. The torque u is constant during a
    sample. For a linear axis, a Runge-Kutta step of the physics engine equals a fourth-order Taylor
    expansion of the matrix exponential.
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
    """Return the system matrix of the continuous-time axis model, as an array (2n + 1, 2n + 1).

    The state consists of the n angles and n speeds of the masses, and the constant torque.
    """
    J, k, d, f = (
        np.array([value for name, value in parameters.items() if name[0] == kind and name != "k_T"])
        for kind in "Jkdf"
    )
    n = len(J)
    twists = np.eye(n)[:-1] - np.eye(n)[1:]  # matrix that maps the angles to the spring twists
    twists[0, 0] = parameters.get("r", 1.0)
    K, D = twists.T * k @ twists, twists.T * d @ twists + np.diag(f)
    A = np.zeros((2 * n + 1, 2 * n + 1))
    A[:n, n:-1] = np.eye(n)
    A[n:-1, :-1] = -np.hstack([K, D]) / J[:, None]
    A[n, -1] = parameters.k_T / J[0]
    return A
