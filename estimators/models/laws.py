"""
Nonlinear torque laws of an axis, represented as data.

A torque law describes a torque, the variable that drives the torque, the states on which the torque
acts, and the torque parameters. For each affected state, a law multiplies its torque F(w, θ) by a
formula and adds the product to the state derivative. The driving variable w is a linear combination
of states, or the input. The following list contains all kinds of torque law, with the roles of
their parameters in brackets:

bristle (coulomb, breakaway, stribeck, stiffness, damping, softness)
    LuGre friction, which approaches Coulomb friction as the bristles become stiff. At the speed v,
    the bristle torque p obeys ṗ = σ₀ [v − |v| p/g(v)], and the friction torque is F = p + σ₁/σ₀ ṗ.
    The steady-state bristle torque is g(v) = [f_c + f_s exp(−(v/v_s)²)] tanh(|v|/v_0). If v_0 is
    zero, the factor tanh(|v|/v_0) is replaced by one. The LuGre friction law comes from *A new
    model for control of systems with friction* (Canudas de Wit, Olsson, Åström and Lischinsky,
    1995).

static (coulomb, breakaway, alpha, beta)
    The static friction law F = [f_c + f_s/cosh(α v)] tanh(β v) from *Nonlinear identification of a
    physically parameterized robot model* (Wernholt and Gunnarsson, 2006).

spring (cubic, gap)
    The torque F = d + κ d³ − x of a nonlinear spring minus that of a linear spring of stiffness
    one, where d is the part of the twist x outside the gap.

sinusoid (sine, cosine, poles)
    The torque F = a sin(N φ) + b cos(N φ), which is periodic in the angle φ. The sinusoidal torque
    represents cogging, or gravity if the number N of waves per revolution is one.

gear (coulomb, breakaway, stribeck, sharpness, motor, external, motor_slow, external_slow,
softness; input, stiffness, ratio)
    Friction that increases with the gear load, F = [f_c + |μ_e τ_g + μ_m τ_u| + (f_s + |μ_es τ_g +
    μ_ms τ_u|) exp(−|v/v_s|^α)] tanh(v/v_0). The friction torque F depends on the motor torque τ_u =
    k_T u and the gear torque τ_g = r k_g x. The gear twist x is the driving variable of the law
    ``spring`` in the same model. The load-dependent friction law is model M5 in *Extended friction
    models for the physics simulation of servo actuators* (Duclusaud, Passault, Padois and Ly,
    arXiv:2410.08650). The paper on servo actuators uses the opposite sign for the gear torque.

clip (limit)
    The torque limit of the motor drive, where the torque F is the clipped input minus the input u.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.formula import multiply_out


class Role(NamedTuple):
    """
    The properties of one parameter of a torque law.

    Attributes
    ----------
    size : str
        Unit of ``guess``, as a formula in the typical magnitudes that
        `flexaxis.estimators.offline.structure` defines. The formula is empty if the parameter value
        cannot be guessed.
    guess : (4,) tuple of float
        Initial estimate, standard deviation, lower bound and upper bound of the parameter, in units
        of ``size``.
    signed : bool
        Whether the parameter can be negative.
    needed : bool
        Whether the parameter must be strictly positive.
    told : bool
        Whether the parameter value comes from a data sheet and is not learnt.
    fixable : bool
        Whether the parameter is fixed if the initialisation data do not excite it.
    shared : bool
        Whether the parameter of the law is also a parameter of the linear model.
    """

    size: str = ""
    guess: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    signed: bool = False
    needed: bool = False
    told: bool = False
    fixable: bool = False
    shared: bool = False


class Kind(NamedTuple):
    """
    A kind of nonlinear torque law.

    Attributes
    ----------
    roles : mapping of str to Role
        Parameters of the law, in the order that the compiled code uses.
    remembers : bool
        Whether the law has its own state variable.
    rubs : bool
        Whether the law describes friction; if so, its driving variable is a speed.
    loaded : bool
        Whether the torque depends on a load, which is the twist of a law ``spring`` in the same
        model.
    nominal : (drive, force, rate), optional
        Typical magnitudes of the law's variables on the nominal axis, in the order of the
        attributes of `flexaxis.estimators.offline.structure.Sizes`.
    """

    roles: Mapping[str, Role]
    remembers: bool = False
    rubs: bool = False
    loaded: bool = False
    nominal: tuple[float, float, float] | None = None


LOAD, SLOW_LOAD = (Role("1", (share, 0.15, 0.0, 1.0)) for share in (0.1, 0.05))
COULOMB = Role("force", (0.05, 0.15, 0.0, 3.0))
BREAKAWAY = Role("force", (0.02, 0.15, 0.0, 5.0))

# Published and simulated axes lie within one or two standard deviations of these guesses. For the
# axis of an industrial robot, f_c is 0.14 and f_s is 0.8 of the rms torque, and friction changes at
# 0.07 to 0.2 of the rms speed (Wernholt and Gunnarsson 2006). The Coulomb level of bristles has a
# positive lower bound, because bristles that transmit no torque have no stiffness.
LAWS: Mapping[str, Kind] = {
    "bristle": Kind(
        {
            "coulomb": Role("force", (0.05, 0.15, 1e-5, 3.0)),
            "breakaway": BREAKAWAY,
            "stribeck": Role("drive", (0.15, 0.1, 0.02, 1.0)),
            "stiffness": Role("force*rate/drive", (6.0, 6.0, 0.5, 1e3), needed=True),
            "damping": Role("force/drive", (0.5, 1.0, 0.0, 10.0)),
            "softness": Role("drive", (0.02, 0.04, 1e-3, 1.0)),
        },
        remembers=True,
        rubs=True,
        nominal=(5.0, 0.85, 176.0),
    ),
    "static": Kind(
        {
            "coulomb": COULOMB,
            "breakaway": BREAKAWAY,
            "alpha": Role("1/drive", (10.0, 5.0, 1.0, 50.0)),
            "beta": Role("1/drive", (20.0, 10.0, 1.0, 100.0)),
        },
        rubs=True,
    ),
    "gear": Kind(
        {
            "coulomb": COULOMB,
            "breakaway": BREAKAWAY,
            "stribeck": Role("drive", (1.0, 1.0, 0.05, 20.0), needed=True),
            "sharpness": Role("1", (2.0, 0.3, 0.5, 10.0), needed=True),  # 2 for bristles
            "motor": LOAD,
            "external": LOAD,
            "motor_slow": SLOW_LOAD,
            "external_slow": SLOW_LOAD,
            "softness": Role("drive", (0.05, 0.05, 1e-3, 1.0), needed=True),
            "input": Role(signed=True, shared=True),
            "stiffness": Role(shared=True),
            "ratio": Role(signed=True, shared=True),
        },
        rubs=True,
        loaded=True,
        nominal=(5.0, 0.85, 176.0),
    ),
    "spring": Kind(
        {
            "cubic": Role("1/drive^2", (0.0, 0.03, -0.03, 1.0), signed=True, fixable=True),
            "gap": Role("drive", (0.02, 0.05, 0.0, 2.0), fixable=True),
        },
        nominal=(7.5e-4, 9.4e-4, 146.0),
    ),
    "sinusoid": Kind(
        {
            "sine": Role("force", (0.0, 0.1, -1.0, 1.0), signed=True),
            "cosine": Role("force", (0.0, 0.1, -1.0, 1.0), signed=True),
            "poles": Role("1", (10.0, 0.5, 0.1, 1e3), needed=True, told=True),
        },
        nominal=(0.0424, 0.85, 118.0),
    ),
    "clip": Kind(
        {"limit": Role("drive", (5.0, 1.0, 0.1, 100.0), needed=True, told=True)},
        nominal=(0.85, 0.85, 0.0),
    ),
}
"""All kinds of torque law; `flexaxis.estimators.models.law_torques` computes the torques."""
KINDS = tuple(LAWS)
MOST_ROLES = max(len(kind.roles) for kind in LAWS.values())
INPUT = "input"


@dataclass(frozen=True)
class Law:
    """
    A nonlinear torque law of an axis model.

    Parameters
    ----------
    kind : str
        Kind of law, which is one of `KINDS`.
    drive : mapping of str to float
        Coefficients that define the driving variable w, keyed by state name or by ``"input"``.
    acts : mapping of str to str
        Coefficients of the torque F in the state derivatives, as formulas keyed by state name. For
        example, the formula ``"-1/J_m"`` belongs to a torque that brakes the motor.
    parameters : mapping of str to (str or float)
        Names of model parameters, or numerical values, keyed by role. A parameter whose role is not
        listed has the value 0.

    Raises
    ------
    EstimatorError
        If the kind of law or a role is unknown, or a formula cannot be read.

    Examples
    --------
    >>> Law("static", {"speed_motor": 1.0}, {"speed_motor": "-1/J_m"},
    ...     {"coulomb": "f_c", "beta": 50.0}).names
    ('f_c',)
    """

    kind: str
    drive: Mapping[str, float]
    acts: Mapping[str, str]
    parameters: Mapping[str, str | float]
    __pydantic_config__: ClassVar = {"extra": "forbid"}

    def __post_init__(self) -> None:
        if self.kind not in LAWS:
            raise EstimatorError(
                f"unknown torque law {self.kind!r}: {did_you_mean(self.kind, KINDS)}"
            )
        for name in self.parameters:
            if name not in self.roles:
                raise EstimatorError(
                    f"the torque law {self.kind!r} has no parameter {name!r}: "
                    + did_you_mean(name, self.roles)
                )
        for name, role in self.roles.items():
            value = self.parameters.get(name, 0.0)
            if isinstance(value, str) or role.signed:
                continue
            if not value >= 0 or (role.needed and not value > 0):
                least = "above 0" if role.needed else "at least 0"
                raise EstimatorError(
                    f"torque law {self.kind!r}: {name} must be {least}, not {value!r}"
                )
        for formula in self.acts.values():
            multiply_out(formula)
        if not self.drive or not self.acts:
            raise EstimatorError(
                f"the torque law {self.kind!r} needs a driving variable, such as drive = "
                "{speed_motor = 1.0}, and a state on which its torque acts, such as acts = "
                '{speed_motor = "-1/J_m"}'
            )

    @property
    def roles(self) -> Mapping[str, Role]:
        """Properties of the law's parameters, keyed by role name."""
        return LAWS[self.kind].roles

    @property
    def own(self) -> dict[str, str]:
        """Names of those law parameters that are not in the linear model, keyed by role."""
        return {
            role: name
            for role, name in self.parameters.items()
            if isinstance(name, str) and not self.roles[role].shared
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the law's own parameters, as used in the model."""
        return tuple(self.own.values())
