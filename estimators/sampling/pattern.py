"""Where a model's matrices are not zero and how they depend on θ, as integers for the compiler."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.parametrization import Parametrization


class Pattern(NamedTuple):
    """
    The structure of the block matrix [A B; C 0], without any of its numbers.

    Attributes
    ----------
    n, p : int
        States and identified parameters.
    reset : tuple of int
        States that are zero at the start of every sample.
    entries : tuple of (row, column, varies)
        Places that are not zero; ``varies`` is 1 where the entry depends on θ.
    terms : tuple of (entry, e_1, …, e_p)
        The terms c·Πθ^e of the entries that depend on θ.
    laws : int
        Nonlinear laws, whose torques are the last of the states.
    """

    n: int
    p: int
    reset: tuple[int, ...]
    entries: tuple[tuple[int, ...], ...]
    terms: tuple[tuple[int, ...], ...]
    laws: int = 0

    @property
    def states(self) -> int:
        """Number of states, without the torques of laws."""
        return self.n - self.laws

    @property
    def lanes(self) -> int:
        """Width of a row of lanes: a value and p derivatives, padded to whole registers."""
        return 2 if self.p == 1 else -4 * (-(1 + self.p) // 4)


def split(model: Parametrization) -> tuple[Pattern, NDArray[np.float64]]:
    """
    Split a model into its pattern and the coefficients of the pattern's terms.

    Parameters
    ----------
    model : Parametrization

    Returns
    -------
    pattern : Pattern
    coefficients : (terms,) array
    """
    keys = np.column_stack([model.row, model.column, model.exponent])
    keys, inverse = np.unique(keys, axis=0, return_inverse=True)
    coefficients = np.bincount(inverse.ravel(), model.coefficient).astype(float)
    places = [tuple(place) for place in np.unique(keys[:, :2], axis=0).tolist()]
    varying = {(row, column) for row, column, *exponents in keys.tolist() if any(exponents)}
    kept = [k for k, key in enumerate(keys.tolist()) if (key[0], key[1]) in varying]
    pattern = Pattern(
        n=model.n,
        p=len(model.names),
        reset=model.reset,
        entries=tuple((*place, int(place in varying)) for place in places),
        terms=tuple((places.index((r, c)), *e) for r, c, *e in keys[kept].tolist()),
        laws=model.forces,
    )
    return pattern, coefficients[kept]
