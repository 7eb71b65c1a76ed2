"""
Nonlinear laws of an axis as data.

A law describes a torque, its drive, the states on which the torque acts, and its parameters. A law
adds its torque F(w, θ), multiplied by a formula, to the derivatives of some states. The drive w of
the law is a linear combination of states, or the input. The list below contains the kinds of law,
with the roles of their parameters in brackets:

bristle (coulomb, breakaway, stribeck, stiffness, damping, softness)
    LuGre friction, which approaches Coulomb friction as the bristles become stiff. The speed is v
    and the torque of the bristles is p: ṗ = σ₀ [v − |v| p/g(v)], F = p + σ₁/σ₀ ṗ, and
    g(v) = [f_c + f_s exp(−(v/v_s)²)] tanh(|v|/v_0). If v_0 = 0, the factor tanh is one.
    C. Canudas de Wit, H. Olsson, K. J. Åström and P. Lischinsky, *A new model for control of
    systems with friction*, IEEE Trans. AC 40 (1995) 419–425.
static (coulomb, breakaway, alpha, beta)
    F = [f_c + f_s/cosh(α v)] tanh(β v): E. Wernholt and S. Gunnarsson, *Nonlinear identification of
    a physically parameterized robot model*, SYSID 2006.
spring (cubic, gap)
    Difference between a nonlinear spring and a linear spring, both of stiffness one:
    F = d + κ d³ − x, where d is the part of the twist x outside the gap.
sinusoid (sine, cosine, poles)
    Torque that is periodic in the angle, F = a sin(N φ) + b cos(N φ): cogging, or gravity if N = 1.
gear (coulomb, breakaway, stribeck, sharpness, motor, external, motor_slow, external_slow,
softness; input, stiffness, ratio)
    Friction that grows with the load of a gear,
    F = [f_c + |μ_e τ_g + μ_m τ_u| + (f_s + |μ_es τ_g + μ_ms τ_u|) exp(−|v/v_s|^α)] tanh(v/v_0),
    with τ_u = k_T u and τ_g = r k_g x. The twist x of the gear is the drive of the law ``spring``
    in the same model. This is model M5 of M. Duclusaud, G. Passault, V. Padois and O. Ly, *Extended
    friction models for the physics simulation of servo actuators*, arXiv:2410.08650, where the
    torque of the gear has the opposite sign.
clip (limit)
    Torque limit of the drive: F is u clipped to ± the limit, minus u.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.formula import multiply_out


class Role(NamedTuple):
    """
    The properties of one parameter of a law.

    Attributes
    ----------
    size : str
        Unit of ``guess``: a formula in the sizes defined by
        `flexaxis.estimators.offline.structure`; empty if the value cannot be guessed.
    guess : (4,) tuple of float
        Initial estimate, its standard deviation, and its lower and upper bound, in units of
        ``size``.
    signed : bool
        Whether the parameter may be negative.
    needed : bool
        Whether the parameter must be positive.
    told : bool
        Whether the parameter is taken from a data sheet instead of being learnt.
    fixable : bool
        Whether the parameter is held constant if the initialisation data do not excite it.
    shared : bool
        Whether the parameter also belongs to the linear model.
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
    A kind of law.

    Attributes
    ----------
    roles : mapping of str to Role
        Parameters of the law, in the order used by compiled code.
    remembers : bool
        Whether the law has a state of its own.
    rubs : bool
        Whether the law describes friction, whose drive is a speed.
    loaded : bool
        Whether the torque depends on a load: the drive of a law ``spring`` in the same model.
    nominal : (drive, force, rate), optional
        Sizes of the law on the nominal axis, see `flexaxis.estimators.offline.structure.Sizes`.
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
"""All kinds of law; `flexaxis.estimators.models.law_torques` computes their torques."""
KINDS = tuple(LAWS)
MOST_ROLES = max(len(kind.roles) for kind in LAWS.values())
INPUT = "input"


@dataclass(frozen=True)
class Law:
    """
    A nonlinear law of a model.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    drive : mapping of str to float
        Coefficients of the drive w, keyed by the names of states or ``"input"``.
    acts : mapping of str to str
        Formulas that multiply F in the derivatives of states, keyed by the names of the states; for
        example ``"-1/J_m"`` for a torque that brakes the motor.
    parameters : mapping of str to (str or float)
        Names of parameters of the model, or numbers, keyed by role. A missing role has the value 0.

    Raises
    ------
    EstimatorError
        If the kind or a role is unknown, or a formula cannot be read.

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
            raise EstimatorError(f"unknown law {self.kind!r}: {did_you_mean(self.kind, KINDS)}")
        for name in self.parameters:
            if name not in self.roles:
                raise EstimatorError(
                    f"law {self.kind!r} has no parameter {name!r}: "
                    + did_you_mean(name, self.roles)
                )
        for name, role in self.roles.items():
            value = self.parameters.get(name, 0.0)
            if isinstance(value, str) or role.signed:
                continue
            if not value >= 0 or (role.needed and not value > 0):
                least = "above 0" if role.needed else "at least 0"
                raise EstimatorError(f"law {self.kind!r}: {name} must be {least}, not {value!r}")
        for formula in self.acts.values():
            multiply_out(formula)
        if not self.drive or not self.acts:
            raise EstimatorError(
                f"law {self.kind!r} needs a drive, such as drive = {{speed_motor = 1.0}}, and a "
                'state to act on, such as acts = {speed_motor = "-1/J_m"}'
            )

    @property
    def roles(self) -> Mapping[str, Role]:
        """Roles of the law's parameters, by name."""
        return LAWS[self.kind].roles

    @property
    def own(self) -> dict[str, str]:
        """Names of the law's parameters by role, without parameters of the linear model."""
        return {
            role: name
            for role, name in self.parameters.items()
            if isinstance(name, str) and not self.roles[role].shared
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the law's own parameters in the model."""
        return tuple(self.own.values())
