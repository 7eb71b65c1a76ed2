"""What an axis may have beside its linear model: dry friction of the motor, gravity, two sides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import BRISTLES, STATIC
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import motion
from flexaxis.estimators.offline.structure import guessed, prior
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.log import columns_beside
from flexaxis.experiments.logs.identification.setup import Setup
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
LEAST_LEVEL = 0.03  # of the rms torque, of dry friction to start from


@dataclass(frozen=True)
class Asked:
    """What somebody stated.

    Attributes
    ----------
    friction, gravity, free, fix, given, highpass
        As for `flexaxis.experiments.logs.identification.identify.identify`.
    told : bool
        Whether it is known if the torque is held or smooth: then it is not looked for.
    """

    friction: str = "auto"
    gravity: str = "auto"
    free: tuple[str, ...] = ()
    fix: tuple[str, ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    highpass: float | None = None
    told: bool = True


def able(model: Model) -> bool:
    """Return whether a model has the motor that laws of friction act on."""
    return "speed_motor" in model.states and "J_m" in model.parameters


def rubbing(
    setup: Setup,
    kind: str,
    level: float,
    asked: Asked,
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
    asked : Asked

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
    grown = replace(grown, nominal=dict(grown.nominal) | start | dict(asked.given))
    mine = tuple(n for n in law.names if (not asked.free or n in asked.free) and n not in asked.fix)
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


def linear_part(model: Model) -> Model:
    """Return a model without its laws, and without their parameters."""
    linear = replace(model, laws=())
    kept = {name: model.nominal[name] for name in linear.parameters}
    return replace(linear, nominal=kept)
