"""The shipped axis models with one to three masses, and models that are read from tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.laws import INPUT, Law
from flexaxis.estimators.models.model import Model

PAPER = ("k_T", "1/J_a", "f_m")  # parameters identified in the paper


def one_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return the model of a rigid motor with viscous friction, J_m ω̇ = k_T u − f_m ω.

    Parameters
    ----------
    nominal : mapping
        Nominal values of the torque constant k_T, the inertia J_m and the viscous friction f_m
        [SI].

    Returns
    -------
    Model
        Model with the motor torque command as input and the motor speed [rad/s] as output.
    """
    return Model(
        name="one_mass",
        states=("speed_motor",),
        A=(("-f_m/J_m",),),
        B=("k_T/J_m",),
        C=("1",),
        nominal=dict(nominal),
        positive=("J_m",),
        nonnegative=("f_m",),
        nonzero=("k_T",),
    )


def three_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return the model of a three-mass axis, in which two springs couple motor, gear and arm.

    Parameters
    ----------
    nominal : mapping
        Nominal values of k_T, J_m, J_g, J_a, k_g, k_a, d_g, d_a, f_m, f_g, f_a and r [SI], as in
        equations (3) and (4) of Östring and Gunnarsson. Inertias and stiffnesses must be positive.
        Damping and friction must not be negative. The parameters k_T and r must not be zero.

    Returns
    -------
    Model
        Model with the motor torque command as input and the motor speed [rad/s] as output.
    """
    return Model(
        name="three_mass",
        states=("twist_gear", "twist_arm", "speed_motor", "speed_gear", "speed_arm"),
        A=(
            ("0", "0", "r", "-1", "0"),
            ("0", "0", "0", "1", "-1"),
            ("-r*k_g/J_m", "0", "-(r^2*d_g + f_m)/J_m", "r*d_g/J_m", "0"),
            ("k_g/J_g", "-k_a/J_g", "r*d_g/J_g", "-(f_g + d_g + d_a)/J_g", "d_a/J_g"),
            ("0", "k_a/J_a", "0", "d_a/J_a", "-(d_a + f_a)/J_a"),
        ),
        B=("0", "0", "k_T/J_m", "0", "0"),
        C=("0", "0", "1", "0", "0"),
        nominal=dict(nominal),
        positive=("J_m", "J_g", "J_a", "k_g", "k_a"),
        nonnegative=("d_g", "d_a", "f_m", "f_g", "f_a"),
        nonzero=("k_T", "r"),
        identify=PAPER,
        fixed=("r",),
    )


_friction = partial(Law, drive={"speed_motor": 1.0}, acts={"speed_motor": "-1/J_m"})
BRISTLES = _friction(
    "bristle",
    parameters={
        "coulomb": "f_c",
        "breakaway": "f_s",
        "stribeck": "v_s",
        "stiffness": "sigma_0",
        "damping": "sigma_1",
        "softness": "v_0",
    },
)
"""Dry motor friction, which is Coulomb or LuGre friction depending on the parameter values."""
STATIC = _friction(
    "static",
    parameters={"coulomb": "f_c", "breakaway": "f_s", "alpha": "alpha", "beta": "beta"},
)
"""A static friction law, published for the motor of an industrial robot."""
GEAR_FRICTION = _friction(
    "gear",
    parameters={
        "coulomb": "f_c",
        "breakaway": "f_s",
        "stribeck": "v_s",
        "sharpness": "sharpness",
        "motor": "mu_m",
        "external": "mu_e",
        "motor_slow": "mu_ms",
        "external_slow": "mu_es",
        "softness": "v_0",
        "input": "k_T",
        "stiffness": "k_g",
        "ratio": "r",
    },
)
"""Friction that increases with the gear load; the model must also contain `GEAR_SPRING`."""
GEAR_SPRING = Law(
    "spring",
    drive={"twist_gear": 1.0},
    acts={"speed_motor": "-r*k_g/J_m", "speed_gear": "k_g/J_g"},
    parameters={"cubic": "kappa", "gap": "gap"},
)
"""A gear spring that has backlash and becomes stiffer with increasing twist."""
COGGING = Law(
    "sinusoid",
    drive={"angle_motor": 1.0},
    acts={"speed_motor": "1/J_m"},
    parameters={"sine": "c_sin", "cosine": "c_cos", "poles": "poles"},
)
"""Motor cogging; the model must contain the motor angle, which `with_angle` adds."""
LIMIT = Law(
    "clip",
    drive={INPUT: 1.0},
    acts={"speed_motor": "k_T/J_m"},
    parameters={"limit": "torque_limit"},
)
"""The torque limit of the motor drive."""


def with_angle(model: Model, state: str = "angle_motor") -> Model:
    """Return the model with the motor angle as an additional state, which starts at zero."""
    return replace(
        model,
        states=(*model.states, state),
        A=(*((*row, "0") for row in model.A), (*model.C, "0")),
        B=(*model.B, "0"),
        C=(*model.C, "0"),
    )


def with_cogging(model: Model) -> Model:
    """Return the model with motor cogging as the last law and the motor angle as the last state."""
    model = with_angle(model)
    cogging = {"c_sin": 0.0, "c_cos": 0.0, "poles": 10.0}
    return replace(model, laws=(*model.laws, COGGING), nominal=dict(model.nominal) | cogging)


def real_axis(nominal: Mapping[str, float]) -> Model:
    """
    Return the three-mass axis with dry friction, backlash and other nonlinear torques.

    The model always contains dry motor friction and a stiffening gear spring with backlash. If the
    nominal values include ``mu_m``, the friction increases with the gear load. If the nominal
    values include ``poles``, the model contains cogging. If the nominal values include
    ``torque_limit``, the model limits the motor torque.

    Parameters
    ----------
    nominal : mapping
        Nominal values of the `three_mass` parameters and of f_c, f_s, v_s, sigma_0, sigma_1, v_0,
        kappa and gap, which are defined in `flexaxis.estimators.models.laws`. If the nominal values
        include ``poles``, they must also include c_sin and c_cos. If the nominal values include
        ``mu_m``, they must also include mu_e, mu_ms, mu_es and sharpness, but need not include
        sigma_0 and sigma_1.
    """
    model = three_mass(nominal)
    laws = [GEAR_FRICTION if "mu_m" in nominal else BRISTLES, GEAR_SPRING]
    if "poles" in nominal:
        model = with_angle(model)
        laws.append(COGGING)
    if "torque_limit" in nominal:
        laws.append(LIMIT)
    return replace(model, name="real_axis", laws=tuple(laws), fixed=(*model.fixed, "poles"))


def two_mass(nominal: Mapping[str, float]) -> Model:
    """
    Return the model of a gearless motor that drives a load through an elastic shaft.

    Parameters
    ----------
    nominal : mapping
        Nominal values of the torque constant k_T, the inertias J_m (motor) and J_l (load), the
        shaft stiffness k, the shaft damping d, and the viscous friction f_m (motor) and f_l (load)
        [SI].

    Returns
    -------
    Model
        Model with the motor torque command as input and the motor speed [rad/s] as output.
    """
    return Model(
        name="two_mass",
        states=("twist", "speed_motor", "speed_load"),
        A=(
            ("0", "1", "-1"),
            ("-k/J_m", "-(d + f_m)/J_m", "d/J_m"),
            ("k/J_l", "d/J_l", "-(d + f_l)/J_l"),
        ),
        B=("0", "k_T/J_m", "0"),
        C=("0", "1", "0"),
        nominal=dict(nominal),
        positive=("J_m", "J_l", "k"),
        nonnegative=("d", "f_m", "f_l"),
        nonzero=("k_T",),
    )


@dataclass(frozen=True)
class Traits:
    """
    Properties of an unknown axis, derived from its measured frequency response.

    Attributes
    ----------
    inertia : float
        Total inertia of the axis [kg m²], referred to the motor, under the assumption k_T = 1.
    friction : float
        Assumed small value of the viscous friction [N m s/rad].
    resonance : float
        Frequency [rad/s] at which the gain |G| of the axis exceeds that of a rigid axis with the
        same total inertia by the largest factor.
    """

    inertia: float
    friction: float
    resonance: float


@dataclass(frozen=True)
class _Shipped:
    """
    A shipped model.

    Attributes
    ----------
    factory : callable
        Function ``factory(nominal)`` that returns the model with the given nominal values.
    rough : mapping
        Plausible parameter values of an unknown axis [SI].
    guess : callable or None
        Function ``guess(traits)`` that derives better parameter values than ``rough`` from the
        frequency response, or None if the frequency response does not determine the parameters.
    """

    factory: Callable[[Mapping[str, float]], Model]
    rough: Mapping[str, float]
    guess: Callable[[Traits], dict[str, float]] | None = None


def _one_mass_guess(seen: Traits) -> dict[str, float]:
    return {"k_T": 1.0, "J_m": seen.inertia, "f_m": seen.friction}


def _two_mass_guess(seen: Traits) -> dict[str, float]:
    """Return parameters for two inertias J, a resonance at ω² = 2 k/J and a 2 % damping ratio."""
    stiffness = seen.resonance**2 * seen.inertia / 4
    return {
        "k_T": 1.0, "J_m": seen.inertia / 2, "J_l": seen.inertia / 2, "k": stiffness,
        "d": 0.04 * stiffness / seen.resonance, "f_m": seen.friction, "f_l": seen.friction,
    }  # fmt: skip


N1 = {
    "k_T": 1.0, "J_m": 1.2e-3, "J_g": 7.0, "J_a": 0.8, "k_g": 1.06e5, "k_a": 8.4e3,
    "d_g": 26.0, "d_a": 1.6, "f_m": 0.05, "f_g": 0.5, "f_a": 0.1, "r": 1 / 118,
}  # fmt: skip
"""The nominal benchmark axis, which is comparable to the first axis of an industrial robot."""

MODELS: Mapping[str, _Shipped] = {
    "one_mass": _Shipped(
        one_mass, rough={"k_T": 1.0, "J_m": 1e-3, "f_m": 1e-3}, guess=_one_mass_guess
    ),
    "two_mass": _Shipped(
        two_mass,
        rough={
            "k_T": 1.0, "J_m": 1e-3, "J_l": 1e-3, "k": 100.0, "d": 1e-2, "f_m": 1e-2, "f_l": 1e-2,
        },
        guess=_two_mass_guess,
    ),
    "three_mass": _Shipped(three_mass, rough=N1),
}  # fmt: skip
"""The shipped axis models, keyed by model name."""

_KEYS = ("name", "states", "A", "B", "C", "nominal")


def model_from_tables(tables: Mapping[str, Any]) -> Model:
    """
    Create an axis model from nested tables, such as the tables that `tomllib` returns.

    Parameters
    ----------
    tables : mapping
        Tables that contain either the key ``model`` (name of a shipped model) or the keys ``name``,
        ``states``, ``A`` (rows of formulas), ``B`` and ``C``. The key ``nominal`` contains the
        value of each parameter [SI]. The optional key ``law`` contains a list of torque laws, which
        are tables with the fields of `flexaxis.estimators.models.laws.Law`. The function ignores
        all other keys of the tables.

    Raises
    ------
    EstimatorError
        If a key or a nominal value is missing, a value has the wrong type, or a formula cannot be
        read.

    Examples
    --------
    >>> model_from_tables({"model": "one_mass", "nominal": {"k_T": 1, "J_m": 2, "f_m": 3}}).states
    ('speed_motor',)

    >>> values = {"k_T": 1, "J_m": 2, "f_m": 3, "f_c": 0.1}
    >>> friction = {"kind": "static", "drive": {"speed_motor": 1}}
    >>> friction["acts"] = {"speed_motor": "-1/J_m"}
    >>> friction["parameters"] = {"coulomb": "f_c", "beta": 20}
    >>> model_from_tables({"model": "one_mass", "nominal": values, "law": [friction]}).parameters
    ('k_T', 'J_m', 'f_m', 'f_c')
    """
    laws = _checked("law", list[Law], tables.get("law", []))
    if "model" in tables:
        name = str(tables["model"])
        if name not in MODELS:
            raise EstimatorError(f"unknown model {name!r}: {did_you_mean(name, MODELS)}")
        nominal = _checked("nominal", dict[str, float], tables.get("nominal", {}))
        model = MODELS[name].factory(nominal)
    else:
        model = _checked("model", Model, {key: tables[key] for key in _KEYS if key in tables})
    return replace(model, laws=(*model.laws, *laws)) if laws else model


def _checked(key: str, kind: Any, value: Any) -> Any:
    """Convert a table to the type ``kind``, or raise EstimatorError if that is not possible."""
    from pydantic import TypeAdapter, ValidationError  # slow to import

    try:
        return TypeAdapter(kind).validate_python(value)
    except ValidationError as error:
        wrong = (
            f"{'.'.join(map(str, (key, *e['loc'])))}: {e['msg'].removeprefix('Value error, ')}"
            for e in error.errors()
        )
        raise EstimatorError("; ".join(wrong)) from None
