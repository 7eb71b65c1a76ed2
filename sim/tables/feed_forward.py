"""Compute the feed-forward of the controller from estimated or nominal parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from flexaxis.sim.tables.config import Config, Positive

Array = NDArray[np.float64]

USED = ("k_T", "f_m", "f_c", "r")
"""Names of the parameters that the feed-forward uses in addition to the inertias."""


Follower = Any
"""Type of an estimator in the control loop (see `flexaxis.estimators.protocol`).

An estimator has the attributes `names` and `output`. The method ``step(u, y)`` of an estimator
takes the torque u[k] and the measurement y[k], and returns the estimates θ[k]. The feed-forward
uses the estimates θ[k] from the torque command of sample k + 1 onwards.
"""


class AdaptConfig(Config):
    """The table ``[controller.adapt]`` of a scenario: terms and limits of the feed-forward.

    Attributes
    ----------
    friction, inertia, torque : bool
        Whether the feed-forward contains the term of the same name. The term `friction` adds the
        friction torque at the desired speed. The term `inertia` adds the torque for the desired
        acceleration. The term `torque` divides the torque command by the estimated torque constant.
    smooth : float
        Speed v₀ [rad/s], below which a smooth function replaces the sign of the desired speed.
    limit : float
        Largest factor by which an estimate can differ from its nominal value, for all parameters
        except the torque constant. The feed-forward clips each estimate that differs from its
        nominal value by a larger factor. If the nominal value of a parameter is 0, the feed-forward
        ignores the estimate of the parameter.
    gain : float
        Largest factor by which the estimated torque constant can differ from its nominal value. The
        estimated torque constant scales the loop gain, so `gain` must be smaller than the gain
        margin of the control loop.
    """

    friction: bool = True
    inertia: bool = True
    torque: bool = True
    smooth: Positive = 0.1
    limit: Annotated[float, Field(gt=1, le=10)] = 3.0
    gain: Annotated[float, Field(gt=1, le=10)] = 1.5

    def command(self, feedback: Array, motion: tuple[Array, Array], of: Mapping[str, Any]) -> Array:
        r"""Return the torque command [N m], which is the sum of feedback and feed-forward.

        .. math::

            u = (k_{T0} u_{fb} + J a + f_m v + f_c \tanh(v/v_0)) / k_T, \quad
            J = J_m + r^2 (J_g + J_a + \dots)

        Parameters
        ----------
        feedback : ndarray (R,)
            Torque command u_fb of the feedback controller for the nominal torque constant k_T0 [N
            m].
        motion : (ndarray (R,), ndarray (R,))
            Desired speed v [rad/s] and acceleration a [rad/s²].
        of : mapping of str to float or ndarray (R,)
            Values of the parameters in `USED`, of all inertias and of k_T0, keyed by parameter
            name. The motor inertia must come before the other inertias.
        """
        speed, acceleration = motion
        torque = of["k_T0"] * feedback
        if self.inertia:
            motor, *others = (value for name, value in of.items() if name[0] == "J")
            torque = torque + (motor + of["r"] ** 2 * sum(others)) * acceleration
        if self.friction:
            torque = torque + of["f_m"] * speed + of["f_c"] * np.tanh(speed / self.smooth)
        return np.asarray(torque / of["k_T" if self.torque else "k_T0"])


class FeedForward:
    """Feed-forward of R runs that are simulated in parallel; each run has its own estimates.

    Parameters
    ----------
    config : AdaptConfig
        Terms and limits of the feed-forward.
    nominal : mapping of str to float
        Parameter values of the axis before the first fault, keyed by name. A run without an
        estimator always uses the nominal values.
    reference : ndarray (N, R)
        Desired motor angle [rad].
    period : float
        Sampling period T [s].
    followers : sequence of Follower or None
        Estimator in the control loop of each run, or None for a run without an estimator.

    Attributes
    ----------
    limited : ndarray (R,)
        Number of samples in each run at which an estimate exceeded its limits or was not finite.
    """

    def __init__(
        self,
        config: AdaptConfig,
        nominal: Mapping[str, float],
        reference: Array,
        period: float,
        followers: Sequence[Follower | None],
    ) -> None:
        self._config, self._followers, self._period = config, followers, period
        runs = reference.shape[1]
        inertias = [name for name in nominal if name[0] == "J"]
        known = {name: nominal.get(name, float(name == "r")) for name in (*USED, *inertias)}
        self._known = {name for name, value in known.items() if value}  # 0 has no relative limits
        self._values = {name: np.full(runs, value) for name, value in known.items()}
        most = {name: config.gain if name == "k_T" else config.limit for name in known}
        self._box = {name: (v / most[name], v * most[name]) for name, v in known.items()}
        self._k_T0 = known["k_T"]
        path = np.vstack([reference[:1], reference, reference[-1:]])
        self._speed = np.diff(path, axis=0) / period  # row k: speed just before sample k
        self._angle = np.zeros(runs)
        self.limited = np.zeros(runs, int)

    def command(self, k: int, feedback: Array) -> Array:
        """Compute the torque command of each run for sample k [N m], with the latest estimates."""
        before, after = self._speed[k], self._speed[k + 1]
        motion = after, (after - before) / self._period
        return self._config.command(feedback, motion, self._values | {"k_T0": self._k_T0})

    def learn(self, k: int, torque: Array, angle: Array, speed: Array) -> None:
        """Pass the torque, angle and speed of each run at sample k to its estimator."""
        increment = (angle - self._angle) / self._period if k else np.zeros_like(angle)
        self._angle = angle.copy()
        read = {"speed": speed, "angle": angle, "increment": increment}
        for run, follower in enumerate(self._followers):
            if follower is not None:
                y = read[follower.output][run]
                theta = follower.step(float(torque[run]), float(y))
                self._use(run, dict(zip(follower.names, theta, strict=True)))

    def _use(self, run: int, theta: Mapping[str, float]) -> None:
        """Limit the estimates of a run, and count the samples with limited estimates."""
        beyond = False
        for name, estimate in theta.items():
            parameter = name.removeprefix("1/")
            if parameter not in self._known:
                continue
            with np.errstate(divide="ignore"):
                value = np.float64(estimate) ** (-1 if name != parameter else 1)
            if np.isfinite(value):
                self._values[parameter][run] = np.clip(value, *self._box[parameter])
            beyond |= bool(self._values[parameter][run] != value)
        self.limited[run] += beyond
