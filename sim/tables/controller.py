"""Compute the torque command of the controller from the reference and the motor angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationInfo, field_validator, model_validator

from flexaxis.sim.tables.config import Config, NotNegative, Positive
from flexaxis.sim.tables.feed_forward import AdaptConfig


class ControllerConfig(Config):
    """The table ``[controller]`` of a scenario: gains, rate and feed-forward of the controller.

    Attributes
    ----------
    Kp : float
        Position gain [1/s].
    Kv : float
        Speed gain [N m s/rad].
    Ki : float
        Integral gain [1/s].
    tau : float
        Time constant of the low-pass filter for the speed error [s]. If `tau` is 0, the speed error
        is not filtered.
    rate : {1000}, optional
        Sampling rate of an inner control loop [Hz]. By default, there is no inner loop, and the
        controller runs at the sampling rate of the scenario. An inner control loop interpolates the
        reference linearly between samples.
    log : {"mean", "sample"}, optional
        Torque that is logged if there is an inner control loop. If `log` is "mean" (default), the
        logged torque is the mean command during each sample. If `log` is "sample", the logged
        torque is the command at the start of each sample.
    adapt : AdaptConfig, optional
        Settings of the feed-forward. If an estimator runs in the control loop, the feed-forward
        uses the estimated parameters.
    """

    Kp: NotNegative = 4.0
    Kv: Positive = 0.22
    Ki: NotNegative = 2.0
    tau: NotNegative = 0.0005
    rate: Literal[1000] | None = None
    log: Literal["mean", "sample"] | None = None
    adapt: AdaptConfig | None = None

    @model_validator(mode="after")
    def _one_rate(self) -> ControllerConfig:
        if self.adapt and self.rate:
            raise ValueError(
                "`adapt` does not work with an inner control loop: remove `rate` or `adapt`"
            )
        return self

    @field_validator("log")
    @classmethod
    def _of_an_inner_loop(cls, log: str | None, info: ValidationInfo) -> str | None:
        if log is not None and info.data.get("rate") is None:
            raise ValueError("`log` needs an inner control loop: set controller.rate = 1000")
        return log

    @property
    def exact(self) -> bool:
        """Whether the motor torque is equal to the logged torque during the whole sample."""
        return self.rate is None

    def logged(self, commands: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the logged torque, given all torque commands during a sample (both in N m)."""
        inner = self.rate is not None and self.log != "sample"
        return np.asarray(np.mean(commands, axis=0)) if inner else commands[0]

    def in_words(self) -> str:
        """Return a short description of the inner control loop or of the feed-forward."""
        if self.adapt:
            return "loop with feed-forward"
        if self.rate is None:
            return ""
        return f"loop at {self.rate} Hz, logged torque: {self.log or 'mean'}"


class Controller:
    r"""Cascaded position and speed controller with integral action, for several runs in parallel.

    With the position error e = reference − angle, the torque command u in sample k is

    .. math::

        v_k &= a v_{k-1} + (1 - a)(e_k - e_{k-1})/T, \quad a = e^{-T/\tau} \\
        s_k &= K_p e_k + v_k \\
        I_k &= I_{k-1} + T K_i s_k \\
        u_k &= K_v (s_k + I_k)

    The controller is initially at rest: :math:`e_{-1} = v_{-1} = I_{-1} = 0`.

    Parameters
    ----------
    config : ControllerConfig
        Gains and time constant of the controller.
    runs : int
        Number of runs R.
    period : float
        Sampling period T [s].

    Attributes
    ----------
    state : ndarray (3, R)
        State of the controller before sample k: :math:`e_{k-1}, v_{k-1}, I_{k-1}`.
    """

    # The controller uses only elementwise operations. Therefore the bits of its results do not
    # depend on the number of runs.
    def __init__(self, config: ControllerConfig, runs: int, *, period: float) -> None:
        pole = math.exp(-period / config.tau) if config.tau > 0 else 0.0
        self._pole, self._rate = pole, (1 - pole) / period
        self._Kp, self._Kv, self._KiT = config.Kp, config.Kv, config.Ki * period
        self.state = np.zeros((3, runs))

    def torque(
        self, reference: NDArray[np.float64], angle: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the torque command of each run [N m], and update the controller state.

        Parameters
        ----------
        reference, angle : ndarray (R,)
            Desired and measured motor angle [rad].
        """
        before, speed, integral = self.state
        error = reference - angle
        speed = self._pole * speed + self._rate * (error - before)
        command = self._Kp * error + speed
        integral = integral + self._KiT * command
        self.state = np.stack([error, speed, integral])
        return self._Kv * (command + integral)
