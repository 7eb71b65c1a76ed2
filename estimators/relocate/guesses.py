"""What is known of a real axis before its first sample, measured by how it moves in the first."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Sizes(NamedTuple):
    """
    How large the motion of an axis is.

    Attributes
    ----------
    torque : float
        Root mean square of the motor torque [N m].
    speed : float
        Of the motor speed [rad/s].
    angle : float
        Of the motor angle about its mean [rad].
    twist : float
        Of the gear spring under that torque [rad].
    """

    torque: float
    speed: float
    angle: float
    twist: float


class Guess(NamedTuple):
    """
    A start and its standard deviation, times powers of torque, speed, angle and twist.

    Without any power they are relative to the nominal value.
    """

    start: float
    deviation: float
    powers: tuple[int, int, int, int] | None = None

    def at(self, nominal: float, sizes: Sizes) -> tuple[float, float]:
        """Return start and deviation [SI]."""
        unit = nominal if self.powers is None else float(np.prod(np.power(sizes, self.powers)))
        return self.start * unit, self.deviation * abs(unit)


TORQUE, SPEED, TWIST = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 1)
TRACKED = {"f_c": Guess(0.1, 0.3, TORQUE)}
"""What is tracked besides what is identified."""
LEARNT = {
    # data sheets and drawings
    "k_g": Guess(1.0, 0.1),
    "J_m": Guess(1.0, 0.05),
    "k_a": Guess(1.0, 0.1),
    "d_g": Guess(1.0, 0.3),
    "d_a": Guess(1.0, 0.3),
    # laws of which nobody is told
    "f_s": Guess(0.05, 0.2, TORQUE),
    "v_s": Guess(0.1, 0.2, SPEED),
    "sigma_0": Guess(8.0, 8.0, (1, 0, -1, 0)),
    "sigma_1": Guess(0.5, 2.0, (1, -1, 0, 0)),
    "v_0": Guess(0.01, 0.1, SPEED),
    "kappa": Guess(0.0, 0.1, (0, 0, 0, -2)),
    "gap": Guess(0.0, 0.1, TWIST),
    "c_sin": Guess(0.0, 0.1, TORQUE),
    "c_cos": Guess(0.0, 0.1, TORQUE),
}
"""What is learnt once."""
WALKS = {"f_m": 3.0, "f_c": 1.5}
"""How much faster than inertias these walk with temperature, for what they are expected to be."""
TOLD = ("k_g", "J_m", "k_a", "d_g", "d_a")
"""Of these a data sheet says what they are, and it may be right."""
ABSENT = (
    (("f_c", "f_s"), ("v_s", "sigma_0", "sigma_1", "v_0")),
    (("kappa",), ()),
    (("gap",), ()),
    (("c_sin", "c_cos"), ()),
)
"""What an axis may not have at all, and what means nothing then."""
INERT = ("f_c", "f_s", "kappa", "gap", "c_sin", "c_cos")
"""Without these no law does anything, whatever its other parameters are."""
POSITIVE = ("f_c", "f_s", "v_s", "sigma_0", "sigma_1", "v_0", "gap")


def measured_sizes(u: Array, y: Array, period: float, nominal: Mapping[str, float]) -> Sizes:
    """
    Return how large the motion of a stretch is.

    Parameters
    ----------
    u, y : (N,) arrays
        Torque and speed.
    period : float
        [s].
    nominal : mapping
        With k_T, and with r and k_g where there is a gear.
    """
    angle = period * np.cumsum(y)
    torque = abs(nominal["k_T"]) * float(np.sqrt(np.mean(u**2)))
    return _sizes(torque, float(np.sqrt(np.mean(y**2))), float(np.std(angle)), nominal)


def natural_sizes(nominal: Mapping[str, float]) -> Sizes:
    """
    Return sizes of a motion by a hundredth of a unit of angle at the pace of the axis.

    A linear model does not say how large its motion is, so these depend on units. They are what
    parameters of laws are divided by, and nothing else: no law acts until a motion is measured.
    """
    pace = np.sqrt(nominal["k_a"] / nominal["J_a"])
    return _sizes(0.01 * nominal["J_m"] * pace**2, 0.01 * pace, 0.01, nominal)


def _sizes(torque: float, speed: float, angle: float, nominal: Mapping[str, float]) -> Sizes:
    stiffness = abs(nominal.get("r", 1.0)) * nominal.get("k_g", 1.0)
    return Sizes(torque, speed, angle, torque / stiffness)


def with_starts(nominal: Mapping[str, float]) -> dict[str, float]:
    """Return nominal values, with a size for each parameter of the laws that is not among them."""
    sizes = natural_sizes(nominal)
    starts = {name: guess.at(0.0, sizes)[0] for name, guess in (TRACKED | LEARNT).items()}
    return {name: value for name, value in starts.items() if name not in nominal} | dict(nominal)
