"""
A model as a function of the parameters that are identified: its terms c·Πθ^e.

Its laws are records, for compiled code.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.laws import INPUT, KINDS, LAWS, MOST_ROLES, Law

Array = NDArray[np.float64]

F, F_W, F_S, S, S_W, S_S, ROLE = range(7)
"""Places in ``local``, see `flexaxis.estimators.models.law_torques`."""
LAW = np.dtype(
    [("kind", int), ("memory", int), ("load", int)]
    + [(name, float) for name in ("force", "offset", "change", "reach")]
    + [("parameter", int, MOST_ROLES), ("value", float, MOST_ROLES)]
    + [("roles", float, MOST_ROLES), ("local", float, ROLE + 2 * MOST_ROLES)]
)
"""
A law as a record: its place in `KINDS`; its own state and the law that loads it, −1 for none; the
last torque and numbers of the search of a step, see `reaction`; for each role the index of its θ_i,
−1 for none, with a factor of θ_i or its value; parameters at θ; torque and derivatives.
"""


class Acting(NamedTuple):
    """
    The laws of a model as records for compiled code, in θ or relative parameters.

    Attributes
    ----------
    records : (L,) records
    drive : (L, n+1) array
        Drive w of each law, as factors of the n states and of the input.
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
    Return laws as records for compiled code.

    Parameters
    ----------
    laws : sequence of Law
    states : sequence of str
        States of the model; the own states of the laws follow them, in the order of the laws.
    nominal : mapping of str to float
    identify : sequence of str
        The identified parameters.
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
        The identified parameters.
    theta : (p,) array
        Their nominal values.
    n : int
        Number of states.
    row, column : (t,) int arrays
        Place of each term in the (n+1, n+1) block matrix.
    coefficient : (t,) array
        Factor c of each term, with all parameters that are not identified multiplied in.
    exponent : (t, p) int array
        Powers of θ in each term.
    reset : tuple of int
        States that are zero at the start of every sample.
    laws : Acting
        Its nonlinear laws. Their torques are the last states of the matrix, which the linear part
        holds over a step.
    additive : tuple of bool
        Which θ_i are parameters of laws, and may be zero.
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
        """Number of laws, whose torques are the last states of the matrix."""
        return len(self.laws.records)

    @property
    def states(self) -> int:
        """Number of states, with the own states of laws and without their torques."""
        return self.n - self.forces

    def relative(self, scale: ArrayLike) -> "Parametrization":
        """
        Return the same model as a function of θ/scale, without units and signs of θ.

        Parameters
        ----------
        scale : (p,) array_like
            One value for each parameter, none of them zero.
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
        Return the block matrix [A B; C 0] at θ and its p derivatives, (1+p, n+1, n+1).

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
