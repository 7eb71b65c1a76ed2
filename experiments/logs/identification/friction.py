"""What an axis may have beside its linear model: dry friction of the motor, gravity, two sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import BRISTLES, STATIC
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import motion
from flexaxis.estimators.offline.structure import guessed, prior
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.setup import Setup, columns_beside
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.sim.errors import did_you_mean

Array = NDArray[np.float64]

KINDS: Mapping[str, Mapping[str, str]] = {
    "coulomb": {"coulomb": "f_c"},
    "lugre": {
        "coulomb": "f_c",
        "breakaway": "f_s",
        "stribeck": "v_s",
        "stiffness": "sigma_0",
        "damping": "sigma_1",
    },
    "static": {"coulomb": "f_c", "breakaway": "f_s", "alpha": "alpha", "beta": "beta"},
}
"""Laws of dry friction of the motor by the word for them: roles, and parameters of those names."""
STIFF = 100.0  # rad a sample, at which bristles swing that stand for Coulomb's friction
LEVELS = np.r_[0.0, np.geomspace(0.01, 1.2, 40)]  # of dry friction, times the rms torque
MOVING = 0.01  # of the greatest power of the speed: where there is less, noise is too near
STUCK = 0.03  # of the rms speed: slower, friction is what the torque is
LEAST_LEVEL = 0.03  # of the rms torque, of dry friction to start from


def able(model: Model) -> bool:
    """Return whether a model has the motor that laws of friction act on."""
    return "speed_motor" in model.states and "J_m" in model.parameters


def rubbing(
    setup: Setup,
    kind: str,
    level: float,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    given: Mapping[str, float],
) -> Setup:
    """Return a setup with a law of friction of the motor.

    Parameters
    ----------
    setup : Setup
        Whose model has no law.
    kind : str
        Of `KINDS`.
    level : float
        Level of dry friction to start from, in units of the torque.
    free, fix, given
        As for `flexaxis.experiments.logs.identification.identify.identify`.

    Raises
    ------
    LogError
        If the kind is unknown, or the model has no motor that the law could act on.
    """
    if kind not in KINDS:
        raise LogError(f"unknown friction {kind!r}.{did_you_mean(kind, KINDS)}")
    model, log = setup.model, setup.log
    if not able(model):
        raise LogError(
            f"--friction {kind} acts on a state speed_motor by 1/J_m, and model {model.name} has "
            "no such state or parameter: write its own [[law]] into the TOML, or use --friction "
            "none"
        )
    roles: dict[str, str | float] = dict(KINDS[kind])
    if kind == "coulomb":
        roles["stiffness"] = (STIFF / log.period) ** 2 * abs(model.nominal["J_m"])
    law = replace(STATIC if kind == "static" else BRISTLES, parameters=roles)
    grown = replace(model, laws=(law,), nominal=dict(model.nominal) | dict.fromkeys(law.names, 1.0))
    moves = motion(log.u[log.ok], log.y[log.ok], log.period)
    grown = guessed(grown, model.parameters, period=log.period, motion=moves)
    size = float(np.std(log.u[log.ok])) * abs(model.nominal.get("k_T", 1.0))
    start = {"f_c": max(abs(level * model.nominal.get("k_T", 1.0)), LEAST_LEVEL * size)}
    grown = replace(grown, nominal=dict(grown.nominal) | start | dict(given))
    mine = tuple(n for n in law.names if (not free or n in free) and n not in fix)
    box = prior(grown, law.names, period=log.period, motion=moves)
    lower, upper = (
        dict(zip(law.names, side.tolist(), strict=True)) for side in (box.lower, box.upper)
    )
    names = (*setup.names, *mine)
    return replace(setup, model=grown, names=names, lower=lower | {"f_c": 0.0}, upper=upper)


def beside(setup: Setup, names: Sequence[str]) -> Setup:
    """Return a setup in which gravity or two sides of friction act beside the torque."""
    log = setup.log
    columns = columns_beside(log.angle, log.y, log.period)
    return replace(setup, beside={name: columns[name] for name in names})


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
    scale, direction = float(np.std(u)), smooth_sign(v, period)
    best, least = 0.0, np.inf
    for level in LEVELS * scale:
        rest = spectra(u - friction(u, direction, level), v, period, pieces=6, trend=True)
        moving = rest.motion > MOVING * rest.motion.max()
        unlikely = float(np.mean(np.log(1 - np.minimum(rest.coherence[moving], 1 - 1e-9))))
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


def friction(u: Array, direction: Array, level: float) -> Array:
    """Return the torque of dry friction of some level; at rest it is what the torque is."""
    return np.where(abs(direction) < 1, np.clip(u, -level, level), level * direction)


def linear_part(model: Model) -> Model:
    """Return a model without its laws, and without their parameters."""
    linear = replace(model, laws=())
    kept = {name: model.nominal[name] for name in linear.parameters}
    return replace(linear, nominal=kept)
