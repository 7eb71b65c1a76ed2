"""Dry friction of an axis before it is fitted: which laws there are, and how large it may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import coherence, welch

from flexaxis.estimators.models.axes import BRISTLES, STATIC
from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.model import Model
from flexaxis.experiments.logs.errors import LogError
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

STIFF = 1e4  # of bristles that stand for none, in units of the law's size
LEVELS = np.r_[0.0, np.geomspace(0.01, 1.2, 40)]  # of dry friction, times the rms torque
MOVING = 0.01  # of the greatest power of the speed: where there is less, noise is too near
STUCK = 0.03  # of the rms speed: slower, friction is what the torque is


@dataclass(frozen=True)
class Sizes:
    """How large what an axis does is: rms torque [N m], rms speed [rad/s], fastest mode [rad/s]."""

    torque: float
    speed: float
    rate: float


@dataclass(frozen=True)
class Choice:
    """A law that may be identified.

    Attributes
    ----------
    law : Law
        With a parameter's name in every role.
    start : mapping of str to float
        Of the free parameters, in units of their size, see `_unit`; f_c is guessed from the log.
    numbers : mapping of str to float
        Of the roles that are fixed.
    lower, upper : mapping of str to float
        The box, in the same units.
    words : str
    """

    law: Law
    start: Mapping[str, float]
    numbers: Mapping[str, float]
    lower: Mapping[str, float]
    upper: Mapping[str, float]
    words: str


CHOICES: Mapping[str, Choice] = {
    "coulomb": Choice(
        BRISTLES,
        {"coulomb": 0.1},
        {"stiffness": STIFF},
        {},
        {"coulomb": 5.0},
        "Coulomb friction",
    ),
    "lugre": Choice(
        BRISTLES,
        {"coulomb": 0.1, "breakaway": 0.02, "stribeck": 0.1, "stiffness": 10.0, "damping": 0.1},
        {},
        {"stribeck": 0.005, "stiffness": 0.1},
        {"coulomb": 5.0, "breakaway": 10.0, "stribeck": 2.0, "stiffness": 3000.0, "damping": 20.0},
        "LuGre friction",
    ),
    "static": Choice(
        STATIC,
        {"coulomb": 0.1, "breakaway": 0.05, "alpha": 10.0, "beta": 20.0},
        {},
        {"alpha": 0.3, "beta": 0.3},
        {"coulomb": 5.0, "breakaway": 50.0, "alpha": 300.0, "beta": 1000.0},
        "the static curve",
    ),
}
"""Laws of friction of the motor, by the word for them."""

_UNITS = {
    "coulomb": lambda s: s.torque,
    "breakaway": lambda s: s.torque,
    "stribeck": lambda s: s.speed,
    "stiffness": lambda s: s.torque * s.rate / s.speed,
    "damping": lambda s: s.torque / s.speed,
    "alpha": lambda s: 1 / s.speed,
    "beta": lambda s: 1 / s.speed,
}


@dataclass(frozen=True)
class Box:
    """Start and box of the parameters of laws, by name."""

    start: Mapping[str, float]
    lower: Mapping[str, float]
    upper: Mapping[str, float]


def rubbing(model: Model, kind: str, sizes: Sizes, level: float) -> tuple[Model, Box]:
    """Return a model with a law of friction of the motor, and where its parameters may be.

    Parameters
    ----------
    model : Model
        Without laws; with a state ``speed_motor`` and a parameter ``J_m``.
    kind : str
        Of `CHOICES`.
    sizes : Sizes
    level : float
        Level of dry friction to start from [N m].

    Raises
    ------
    LogError
        If the kind is unknown, or the model has no motor that the law could act on.
    """
    if kind not in CHOICES:
        raise LogError(f"unknown friction {kind!r}.{did_you_mean(kind, CHOICES)}")
    if "speed_motor" not in model.states or "J_m" not in model.parameters:
        raise LogError(
            f"--friction {kind} acts on a state speed_motor by 1/J_m, and model {model.name} has "
            "no such state or parameter: write its own [[law]] into the TOML, or use --friction "
            "none"
        )
    choice = CHOICES[kind]
    units = {role: float(_UNITS[role](sizes)) for role in (*choice.start, *choice.numbers)}
    names: dict[str, str | float] = {
        role: str(choice.law.parameters[role]) for role in choice.start
    }
    numbers = {role: value * units[role] for role, value in choice.numbers.items()}
    law = replace(choice.law, parameters=names | numbers)
    start = {str(names[role]): value * units[role] for role, value in choice.start.items()}
    start["f_c"] = max(level, 0.01 * sizes.torque)
    box = Box(
        start,
        {str(names[r]): choice.lower.get(r, 0.0) * units[r] for r in choice.start},
        {str(names[r]): choice.upper[r] * units[r] for r in choice.start},
    )
    # names first, so that the model has its parameters when it is made
    grown = replace(model, laws=(law,), nominal=dict(model.nominal) | start)
    return grown, box


def guessed_level(u: Array, v: Array, *, period: float) -> float:
    """Return the level of dry friction, in units of u, with which the rest is most nearly linear.

    Friction acts where the torque does, so an axis with a linear rest answers to u − F linearly,
    and their coherence is one. No model is needed: the level is the one of the greatest coherence,
    in terms of the likelihood Σ log(1 − γ²).

    Parameters
    ----------
    u, v : ndarray (N,)
        Torque, and the speed of the motor.
    period : float
        [s].
    """
    segment = min(len(u) // 6, round(4 / period))
    scale = float(np.std(u))
    direction = smooth_sign(v, period)
    _, power = welch(v, fs=1 / period, nperseg=segment, detrend="linear")
    moving = power > MOVING * power.max()
    best, least = 0.0, np.inf
    for level in LEVELS * scale:
        rest = u - friction(u, v, direction, level)
        _, share = coherence(rest, v, fs=1 / period, nperseg=segment, detrend="linear")
        unlikely = float(np.mean(np.log(1 - np.minimum(share[moving], 1 - 1e-9))))
        if unlikely < least - 1e-3:
            best, least = float(level), unlikely
    return best


def smooth_sign(v: Array, period: float) -> Array:
    """Return the direction of a motion, not that of its noise: a short mean before the sign."""
    rough = np.diff(v)
    noise = 1.4826 * float(np.median(abs(rough))) / np.sqrt(2)
    wanted = max(STUCK * float(np.std(v)), 1e-12)
    length = int(np.clip((noise / wanted) ** 2, 1, max(0.02 / period, 1)))
    mean = np.convolve(v, np.ones(length) / length, "same")
    return np.where(abs(mean) > wanted, np.sign(mean), mean / wanted)


def friction(u: Array, v: Array, direction: Array, level: float) -> Array:
    """Return the torque of dry friction of some level; at rest it is what the torque is."""
    resting = abs(direction) < 1
    return np.where(resting, np.clip(u, -level, level), level * direction)


def names_by(kind: str) -> set[str]:
    """Return the parameters of a law of `CHOICES` that can be identified."""
    choice = CHOICES[kind]
    return {str(choice.law.parameters[role]) for role in choice.start}


def names_of(model: Model) -> Sequence[str]:
    """Return the parameters of the laws of a model, in their order."""
    return tuple(dict.fromkeys(name for law in model.laws for name in law.names))


def linear_part(model: Model) -> Model:
    """Return a model without its laws, and without their parameters."""
    linear = replace(model, laws=())
    kept = {name: model.nominal[name] for name in linear.parameters}
    return replace(linear, nominal=kept)
