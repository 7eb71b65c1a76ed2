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
"""An estimator in the loop, as defined in `flexaxis.estimators.protocol`.

An estimator has the attributes `names` and `output`. The method ``step(u, y)`` takes u[k] and y[k]
and returns the estimates θ[k]. The command of sample k + 1 is the first command that uses θ[k].
"""


class AdaptConfig(Config):
    """The table ``[controller.adapt]`` of a scenario: terms and limits of the feed-forward.

    Attributes
    ----------
    friction, inertia, torque : bool
        Terms of the feed-forward. `friction` adds the friction torque at the desired speed.
        `inertia` adds the torque for the desired acceleration. `torque` divides the command by the
        estimated torque constant.
    smooth : float
        Speed v₀ below which the sign of the desired speed is smoothed [rad/s].
    limit : float
        Factor that limits the estimates. Each estimate is clipped to the interval from
        nominal/limit to limit × nominal. The feed-forward ignores estimates of parameters whose
        nominal value is 0.
    gain : float
        Factor that limits the estimate of the torque constant in the same way. The estimated torque
        constant scales the loop gain, so this factor must be smaller than the gain margin.
    """

    friction: bool = True
    inertia: bool = True
    torque: bool = True
    smooth: Positive = 0.1
    limit: Annotated[float, Field(gt=1, le=10)] = 3.0
    gain: Annotated[float, Field(gt=1, le=10)] = 1.5

    def command(self, feedback: Array, motion: tuple[Array, Array], of: Mapping[str, Any]) -> Array:
        r"""Return the command (R,) [N m] as the sum of feedback and feed-forward.

        .. math::

            u = (k_{T0} u_{fb} + J a + f_m v + f_c \tanh(v/v_0)) / k_T, \quad
            J = J_m + r^2 (J_g + J_a + \dots)

        Parameters
        ----------
        feedback : ndarray (R,)
            Command of the feedback controller for the nominal torque constant k_T0 [N m].
        motion : (ndarray (R,), ndarray (R,))
            Desired speed v [rad/s] and acceleration a [rad/s²].
        of : mapping of str to float or ndarray (R,)
            Values of the parameters in `USED`, of the inertias (motor first), and of ``"k_T0"``,
            keyed by name.
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
    """The feed-forward of a batch of R runs; each run uses its own estimates.

    Parameters
    ----------
    config : AdaptConfig
        Terms and limits of the feed-forward.
    nominal : mapping of str to float
        Parameters of the axis before any fault, keyed by name. A run without an estimator always
        uses these values.
    reference : ndarray (N, R)
        Desired motor angle [rad].
    period : float
        Sampling period T [s].
    followers : sequence of Follower or None
        Estimator of each run, or None for a run without an estimator.

    Attributes
    ----------
    limited : ndarray (R,)
        Number of samples of each run in which an estimate exceeded a limit or was not finite.
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
        """Return the torque command (R,) [N m] of sample k, computed with the latest estimates."""
        before, after = self._speed[k], self._speed[k + 1]
        motion = after, (after - before) / self._period
        return self._config.command(feedback, motion, self._values | {"k_T0": self._k_T0})

    def learn(self, k: int, torque: Array, angle: Array, speed: Array) -> None:
        """Pass the torque (R,), angle (R,) and speed (R,) of sample k to the estimators."""
        increment = (angle - self._angle) / self._period if k else np.zeros_like(angle)
        self._angle = angle.copy()
        read = {"speed": speed, "angle": angle, "increment": increment}
        for run, follower in enumerate(self._followers):
            if follower is not None:
                y = read[follower.output][run]
                theta = follower.step(float(torque[run]), float(y))
                self._use(run, dict(zip(follower.names, theta, strict=True)))

    def _use(self, run: int, theta: Mapping[str, float]) -> None:
        """Clip the estimates of a run to their limits, and count samples with clipped estimates."""
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
