"""A model as a function of the parameters that are identified: its terms c·Πθ^e."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.acting import Acting

Array = NDArray[np.float64]


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
        Its nonlinear laws. Their torques are then the last states of the matrix, which the linear
        part takes as held.
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
        """Number of states, those of the laws' own included, the torques of laws not."""
        return self.n - self.forces

    @property
    def own_states(self) -> int:
        """Number of states that a user may give: not those of laws, nor those that are reset."""
        own = np.sum(self.laws.records["memory"] >= 0)
        return self.states - int(own) - len(self.reset)

    def relative(self, scale: ArrayLike) -> "Parametrization":
        """
        Return the same model as a function of θ/scale, in which units and signs of θ vanish.

        Parameters
        ----------
        scale : (p,) array_like
            One value of each parameter, of which none is zero.
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
