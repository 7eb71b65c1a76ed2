"""
A model as a function of the identified parameters, represented by terms c·Πθ^e.

The nonlinear torque laws of the model are stored as records for compiled code.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.laws import INPUT, KINDS, LAWS, MOST_ROLES, Law

Array = NDArray[np.float64]

F, F_W, F_S, S, S_W, S_S, ROLE = range(7)
"""Indices into the array ``local`` of `flexaxis.estimators.models.law_torques`."""
LAW = np.dtype(
    [("kind", int), ("memory", int), ("load", int)]
    + [(name, float) for name in ("force", "offset", "change", "reach")]
    + [("parameter", int, MOST_ROLES), ("value", float, MOST_ROLES)]
    + [("roles", float, MOST_ROLES), ("local", float, ROLE + 2 * MOST_ROLES)]
)
"""
Record type of a nonlinear torque law.

The field ``kind`` is the index of the law's kind in `KINDS`. The field ``memory`` is the index of
the law's own state, or −1 for a law without a state. The field ``load`` is the index of the law
whose driving variable is the load, or −1 for a law without a load. The field ``force`` is the
torque in the last step. The fields ``offset``, ``change`` and ``reach`` store intermediate results
of the Newton search in `implicit_torque`. For each role, the field ``parameter`` is the index i of
an identified parameter, and the field ``value`` is a factor that multiplies θ_i. If ``parameter``
is −1, ``value`` is the parameter value itself. The field ``roles`` contains the values of the law's
parameters at θ, and ``local`` contains the torque and its derivatives.
"""


def law_records(
    laws: Sequence[Law],
    states: Sequence[str],
    nominal: Mapping[str, float],
    identify: Sequence[str],
) -> tuple[NDArray[np.void], Array]:
    """
    Convert torque laws to records for compiled code.

    Parameters
    ----------
    laws : sequence of L laws
    states : sequence of str
        Names of the states of the linear model. The states of the torque laws come after the states
        of the linear model, in the order of the laws.
    nominal : mapping of str to float
        Nominal values of the physical parameters.
    identify : sequence of str
        Names of the identified parameters.

    Returns
    -------
    records : (L,) records
        Torque laws as records of type `LAW`.
    drive : (L, n+1) array
        Coefficients of the n states and of the input in the driving variable w of each law.
    """
    records, kinds = np.zeros(len(laws), LAW), [law.kind for law in laws]
    records["parameter"] = records["memory"] = records["load"] = -1
    own = [i for i, kind in enumerate(kinds) if LAWS[kind].remembers]
    records["memory"][own] = len(states) + np.arange(len(own))
    drive, places = np.zeros((len(laws), len(states) + len(own) + 1)), [*states, *own, INPUT]
    for record, coefficients, law in zip(records, drive, laws, strict=True):
        record["kind"] = KINDS.index(law.kind)
        if LAWS[law.kind].loaded:
            record["load"] = kinds.index("spring")
        for state, coefficient in law.drive.items():
            coefficients[places.index(state)] = coefficient
        for role, parameter in law.parameters.items():
            r = list(law.roles).index(role)
            if parameter in identify:
                record["value"][r], record["parameter"][r] = 1.0, identify.index(parameter)
            else:
                value = nominal[parameter] if isinstance(parameter, str) else parameter
                record["value"][r] = value
    return records, drive


@dataclass(frozen=True)
class Parametrization:
    """
    A model as a function of θ, represented by the terms c·Πθ^e of the matrix [A B; C 0].

    Attributes
    ----------
    names : tuple of str
        Names of the p identified parameters.
    theta : (p,) array
        Nominal values of the identified parameters.
    n : int
        Number of states, including the torque laws' own states and the law torques.
    row, column : (t,) int arrays
        Row and column of each term in the (n+1, n+1) block matrix.
    coefficient : (t,) array
        Factor c of each term, which includes the powers of all parameters that are not identified.
    exponent : (t, p) int array
        Exponent of each parameter θ_i in each term.
    reset : tuple of int
        Indices of the states that are set to zero at the start of every sample.
    laws, drive : (L,) records, (L, n+1) array
        Nonlinear torque laws, as returned by `law_records`. The law torques are the last elements
        of the state vector, and the linear part of the model treats them as constant over a step.
    additive : tuple of bool
        For each θ_i, whether the parameter belongs to a torque law and can therefore be zero.
    """

    names: tuple[str, ...]
    theta: Array
    n: int
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    coefficient: Array
    exponent: NDArray[np.int64]
    reset: tuple[int, ...]
    laws: NDArray[np.void]
    drive: Array
    additive: tuple[bool, ...] = ()

    @property
    def forces(self) -> int:
        """Number of torque laws, which is also the number of law torques among the states."""
        return len(self.laws)

    @property
    def states(self) -> int:
        """Number of states, including the laws' own states but not the law torques."""
        return self.n - self.forces

    def relative(self, scale: ArrayLike) -> "Parametrization":
        """
        Return the model as a function of the dimensionless parameters θ/scale.

        Parameters
        ----------
        scale : (p,) array_like
            Nonzero scale of each parameter, in the unit of the parameter.
        """
        scale = np.asarray(scale, float)
        factor = np.prod(scale ** self.exponent.astype(float), axis=1)
        laws, which = self.laws.copy(), self.laws["parameter"]
        laws["value"] *= np.where(which >= 0, scale[which], 1.0)
        return replace(
            self, theta=self.theta / scale, coefficient=self.coefficient * factor, laws=laws
        )

    def blocks(self, theta: ArrayLike) -> Array:
        """
        Return the matrix [A B; C 0] at θ and its p derivatives, as an array (1+p, n+1, n+1).

        Parameters
        ----------
        theta : (p,) array_like
            Identified parameters.
        """
        theta = np.asarray(theta, float)
        blocks = np.zeros((1 + len(theta), self.n + 1, self.n + 1))
        place = self.row, self.column
        np.add.at(blocks[0], place, self.coefficient * np.prod(theta**self.exponent, axis=1))
        for i, e in enumerate(self.exponent.T):
            lowered = self.exponent.copy()
            lowered[e != 0, i] -= 1
            slope = self.coefficient * e * np.prod(theta**lowered, axis=1)
            np.add.at(blocks[1 + i], place, slope)
        return blocks

    def matrices(self, theta: ArrayLike) -> tuple[Array, Array, Array]:
        """
        Return A (n, n), B (n, 1) and C (1, n) of equations (3) and (4) at θ.

        Parameters
        ----------
        theta : (p,) array_like
            Identified parameters.
        """
        block = self.blocks(theta)[0]
        return block[:-1, :-1], block[:-1, -1:], block[-1:, :-1]
