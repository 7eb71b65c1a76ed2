"""
Nonlinear laws of an axis as data: a torque, where it acts, what drives it, its parameters.

A law adds F(w, θ) to the derivatives of some states, times a formula in the parameters, where w is
a linear combination of states or the input. The kinds, with their roles in brackets:

bristle (coulomb, breakaway, stribeck, stiffness, damping, softness)
    LuGre friction, whose limit for stiff bristles is Coulomb's. With the speed v and the torque p
    of the bristles, ṗ = σ₀ [v − |v| p/g(v)], F = p + σ₁/σ₀ ṗ, and
    g(v) = [f_c + f_s exp(−(v/v_s)²)] tanh(|v|/v_0), the last factor one for v_0 = 0. C. Canudas de
    Wit, H. Olsson, K. J. Åström and P. Lischinsky, *A new model for control of systems with
    friction*, IEEE Trans. AC 40 (1995) 419–425.
static (coulomb, breakaway, alpha, beta)
    F = [f_c + f_s/cosh(α v)] tanh(β v): E. Wernholt and S. Gunnarsson, *Nonlinear identification of
    a physically parameterized robot model*, SYSID 2006.
spring (cubic, gap)
    What a spring of stiffness one does beyond F = x: F = d + κ d³ − x, where d is what of x lies
    outside a gap of that width.
sinusoid (sine, cosine, poles)
    F = a sin(N φ) + b cos(N φ), such as cogging, or gravity for N = 1.
shape (sine, cosine, waves, softness, which)
    Friction of a shape that nobody told: F = a sin(N φ) + b cos(N φ) over an angle φ for ``which``
    0; that times tanh(v/v_0) for 1; [a N |x| + b tanh(v/v_0)] tanh(v/v_0) for 2, which grows with
    a load x and is larger one way. It is driven by v, and reads φ or x from a state that compiled
    code is told as its memory.
clip (limit)
    F = u clipped to ± the limit, less u.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.formula import multiply_out

ROLES: Mapping[str, tuple[str, ...]] = {
    "bristle": ("coulomb", "breakaway", "stribeck", "stiffness", "damping", "softness"),
    "static": ("coulomb", "breakaway", "alpha", "beta"),
    "spring": ("cubic", "gap"),
    "sinusoid": ("sine", "cosine", "poles"),
    "clip": ("limit",),
    "shape": ("sine", "cosine", "waves", "softness", "which"),
}
"""What the parameters of each kind of law are, in the order in which compiled code takes them."""
KINDS = tuple(ROLES)
REMEMBERS = ("bristle",)  # kinds with a state of their own
NEEDED = {  # roles that must be above 0
    "bristle": ("stiffness",),
    "sinusoid": ("poles",),
    "clip": ("limit",),
    "shape": ("softness",),
}
SIGNED = ("cubic", "sine", "cosine")  # roles that may be below it
MOST_ROLES = max(map(len, ROLES.values()))
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
        w, as factors of states or of ``"input"``.
    acts : mapping of str to str
        State to the formula by which F is multiplied in its derivative: ``"-1/J_m"`` for a torque
        that brakes the motor.
    parameters : mapping of str to (str or float)
        Role to the name of a parameter of the model, or to a number; 0 for roles left out.

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

    def __post_init__(self) -> None:
        if self.kind not in ROLES:
            raise EstimatorError(f"unknown law {self.kind!r}: {did_you_mean(self.kind, KINDS)}")
        for role in self.parameters:
            if role not in ROLES[self.kind]:
                raise EstimatorError(
                    f"law {self.kind!r} has no parameter {role!r}: "
                    + did_you_mean(role, ROLES[self.kind])
                )
        for role in ROLES[self.kind]:
            given, needed = self.parameters.get(role, 0.0), role in NEEDED.get(self.kind, ())
            if isinstance(given, str) or role in SIGNED:
                continue
            if not given >= 0 or (needed and not given > 0):
                least = "above 0" if needed else "0 or above it"
                raise EstimatorError(f"law {self.kind!r} takes a {role} {least}, not {given!r}")
        for formula in self.acts.values():
            multiply_out(formula)
        if not self.drive or not self.acts:
            raise EstimatorError(
                f"law {self.kind!r} needs what drives it, drive = {{speed_motor = 1.0}}, and where "
                'it acts, acts = {speed_motor = "-1/J_m"}'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its parameters in the model."""
        return tuple(name for name in self.parameters.values() if isinstance(name, str))

    @property
    def positive(self) -> tuple[str, ...]:
        """Names of those that must be above 0."""
        needed = (self.parameters.get(role) for role in NEEDED.get(self.kind, ()))
        return tuple(name for name in needed if isinstance(name, str))

    @property
    def nonnegative(self) -> tuple[str, ...]:
        """Names of those that must not be below 0."""
        return tuple(
            name
            for role, name in self.parameters.items()
            if isinstance(name, str) and role not in SIGNED
        )

    @property
    def remembers(self) -> bool:
        """Whether it has a state of its own."""
        return self.kind in REMEMBERS


class Acting(NamedTuple):
    """
    The laws of a model as compiled code takes them, for θ relative or not.

    Attributes
    ----------
    kind : (L,) int array
        Place in `KINDS`.
    memory : (L,) int array
        State that a law has of its own; −1 for none.
    drive : (L, n+1) array
        w of each law, as factors of the n states and of the input.
    value : (L, R) array
        Parameters of each role, or where they are identified their factor of θ_i.
    parameter : (L, R) int array
        Which θ_i it is; −1 for none.
    """

    kind: NDArray[np.int64]
    memory: NDArray[np.int64]
    drive: NDArray[np.float64]
    value: NDArray[np.float64]
    parameter: NDArray[np.int64]

    def relative(self, scale: NDArray[np.float64]) -> "Acting":
        """Return the same as functions of θ/scale."""
        factor = np.where(self.parameter >= 0, np.r_[scale, 1.0][self.parameter], 1.0)
        return self._replace(value=self.value * factor)


def acting(
    laws: Sequence[Law],
    states: Sequence[str],
    nominal: Mapping[str, float],
    identify: Sequence[str],
) -> Acting:
    """
    Return laws as compiled code takes them.

    Parameters
    ----------
    laws : sequence of Law
    states : sequence of str
        Of the model; the states that laws have of their own follow them, in their order.
    nominal : mapping of str to float
    identify : sequence of str
        The identified parameters.
    """
    own = np.cumsum([law.remembers for law in laws])
    memory = np.where([law.remembers for law in laws], len(states) + own - 1, -1)
    drive = np.zeros((len(laws), len(states) + int(own[-1]) + 1))
    value, index = np.zeros((len(laws), MOST_ROLES)), np.full((len(laws), MOST_ROLES), -1)
    for i, law in enumerate(laws):
        for state, factor in law.drive.items():
            drive[i, -1 if state == INPUT else list(states).index(state)] = factor
        for role, parameter in law.parameters.items():
            r = ROLES[law.kind].index(role)
            if isinstance(parameter, str) and parameter in identify:
                value[i, r], index[i, r] = 1.0, list(identify).index(parameter)
            else:
                value[i, r] = nominal[parameter] if isinstance(parameter, str) else parameter
    kinds = np.array([KINDS.index(law.kind) for law in laws], np.int64)
    return Acting(kinds, memory.astype(np.int64), drive, value, index.astype(np.int64))
