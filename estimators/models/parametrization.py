"""
A model as a function of the identified parameters: a sum of terms c·Πθ^e.

The laws of the model are stored as records for compiled code.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.laws import INPUT, KINDS, LAWS, MOST_ROLES, Law

Array = NDArray[np.float64]

F, F_W, F_S, S, S_W, S_S, ROLE = range(7)
"""Indices into ``local``, see `flexaxis.estimators.models.law_torques`."""
LAW = np.dtype(
    [("kind", int), ("memory", int), ("load", int)]
    + [(name, float) for name in ("force", "offset", "change", "reach")]
    + [("parameter", int, MOST_ROLES), ("value", float, MOST_ROLES)]
    + [("roles", float, MOST_ROLES), ("local", float, ROLE + 2 * MOST_ROLES)]
)
"""
A law as a record.

``kind`` is the index in `KINDS`. ``memory`` and ``load`` are the indices of the law's own state and
of the law that acts as its load, or −1. ``force`` is the last torque; ``offset``, ``change`` and
``reach`` are used by the search in `reaction`. For each role, ``parameter`` is the index of a θ_i
and ``value`` a factor of θ_i; if ``parameter`` is −1, ``value`` is the value of the parameter.
``roles`` contains the parameters at θ, and ``local`` the torque and its derivatives.
"""


class Acting(NamedTuple):
    """
    The laws of a model as records for compiled code, as functions of θ or of relative parameters.

    Attributes
    ----------
    records : (L,) records
        Laws, of type `LAW`.
    drive : (L, n+1) array
        Coefficients of the n states and of the input in the drive w of each law.
    """

    records: NDArray[np.void]
    drive: NDArray[np.float64]

    def relative(self, scale: NDArray[np.float64]) -> "Acting":
        """Return the same laws as functions of θ/scale."""
        records, which = self.records.copy(), self.records["parameter"]
        records["value"] *= np.where(which >= 0, np.r_[scale, 1.0][which], 1.0)
        return Acting(records, self.drive)


def acting(
    laws: Sequence[Law],
    states: Sequence[str],
    nominal: Mapping[str, float],
    identify: Sequence[str],
) -> Acting:
    """
    Convert laws to records for compiled code.

    Parameters
    ----------
    laws : sequence of Law
    states : sequence of str
        Names of the states of the linear model. The states of the laws follow these states, in the
        order of the laws.
    nominal : mapping of str to float
        Nominal values of the parameters.
    identify : sequence of str
        Names of the identified parameters.
    """
    records, kinds = np.zeros(len(laws), LAW), [law.kind for law in laws]
    records["parameter"] = records["memory"] = records["load"] = -1
    drive, memory = [], len(states)
    for record, law in zip(records, laws, strict=True):
        record["kind"] = KINDS.index(law.kind)
        if law.remembers:
            record["memory"], memory = memory, memory + 1
        if LAWS[law.kind].loaded:
            record["load"] = kinds.index("spring")
        for role, parameter in law.parameters.items():
            r = list(law.roles).index(role)
            if parameter in identify:
                record["value"][r], record["parameter"][r] = 1.0, identify.index(parameter)
            else:
                value = nominal[parameter] if isinstance(parameter, str) else parameter
                record["value"][r] = value
        drive.append([law.drive.get(state, 0.0) for state in states])
    own = memory - len(states)
    inputs = [law.drive.get(INPUT, 0.0) for law in laws]
    w = np.reshape(drive, (len(laws), len(states)))
    return Acting(records, np.column_stack([w, np.zeros((len(laws), own)), inputs]))


@dataclass(frozen=True)
class Parametrization:
    """
    A model as a function of θ: the terms c·Πθ^e of the block matrix [A B; C 0].

    Attributes
    ----------
    names : tuple of str
        Names of the p identified parameters.
    theta : (p,) array
        Nominal values of the identified parameters.
    n : int
        Number of states, including the states and the torques of laws.
    row, column : (t,) int arrays
        Position of each term in the (n+1, n+1) block matrix.
    coefficient : (t,) array
        Factor c of each term, including the powers of all parameters that are not identified.
    exponent : (t, p) int array
        Exponent of each θ_i in each term.
    reset : tuple of int
        Indices of the states that are set to zero at the start of every sample.
    laws : Acting
        Nonlinear laws. The torques of the laws are the last states of the matrix; the linear part
        holds these torques constant over a step.
    additive : tuple of bool
        For each θ_i, whether the parameter belongs to a law and may therefore be zero.
    """

    names: tuple[str, ...]
    theta: Array
    n: int
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    coefficient: Array
    exponent: NDArray[np.int64]
    reset: tuple[int, ...]
    laws: Acting
    additive: tuple[bool, ...] = ()

    @property
    def forces(self) -> int:
        """Number of laws, which equals the number of torques among the states of the matrix."""
        return len(self.laws.records)

    @property
    def states(self) -> int:
        """Number of states, including the states of laws but not the torques of laws."""
        return self.n - self.forces

    def relative(self, scale: ArrayLike) -> "Parametrization":
        """
        Return the same model as a function of θ/scale, which has no units.

        Parameters
        ----------
        scale : (p,) array_like
            Nonzero scale of each parameter, in the unit of the parameter.
        """
        scale = np.asarray(scale, float)
        factor = np.prod(scale ** self.exponent.astype(float), axis=1)
        return replace(
            self,
            theta=self.theta / scale,
            coefficient=self.coefficient * factor,
            laws=self.laws.relative(scale),
        )

    def blocks(self, theta: ArrayLike) -> Array:
        """
        Return the block matrix [A B; C 0] at θ and its p derivatives, of shape (1+p, n+1, n+1).

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
        Return A (n, n), B (n, 1) and C (1, n) at θ, paper eq. (3), (4).

        Parameters
        ----------
        theta : (p,) array_like
            Identified parameters.
        """
        block = self.blocks(theta)[0]
        return block[:-1, :-1], block[:-1, -1:], block[-1:, :-1]

    def derivatives(self, theta: ArrayLike) -> tuple[Array, Array, Array]:
        """
        Return ∂A (p, n, n), ∂B (p, n, 1) and ∂C (p, 1, n) at θ, paper eq. (18), (20), (24).

        Parameters
        ----------
        theta : (p,) array_like
            Identified parameters.
        """
        block = self.blocks(theta)[1:]
        return block[:, :-1, :-1], block[:, :-1, -1:], block[:, -1:, :-1]
