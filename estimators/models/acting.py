"""The laws of a model as arrays, for compiled code."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import INPUT, KINDS, LAWS, MOST_ROLES, Law


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
    load : (L,) int array
        Of which law the drive is the load of a law; −1 for none.
    """

    kind: NDArray[np.int64]
    memory: NDArray[np.int64]
    drive: NDArray[np.float64]
    value: NDArray[np.float64]
    parameter: NDArray[np.int64]
    load: NDArray[np.int64]

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
    own = np.cumsum([law.remembers for law in laws], dtype=int)
    memory = np.where([law.remembers for law in laws], len(states) + own - 1, -1)
    drive = np.zeros((len(laws), len(states) + sum(law.remembers for law in laws) + 1))
    value, index = np.zeros((len(laws), MOST_ROLES)), np.full((len(laws), MOST_ROLES), -1)
    for i, law in enumerate(laws):
        for state, factor in law.drive.items():
            drive[i, -1 if state == INPUT else list(states).index(state)] = factor
        for role, parameter in law.parameters.items():
            r = list(law.roles).index(role)
            if isinstance(parameter, str) and parameter in identify:
                value[i, r], index[i, r] = 1.0, list(identify).index(parameter)
            else:
                value[i, r] = nominal[parameter] if isinstance(parameter, str) else parameter
    kinds = [law.kind for law in laws]
    load = [kinds.index("spring") if LAWS[kind].loaded else -1 for kind in kinds]
    return Acting(
        np.array([KINDS.index(kind) for kind in kinds], np.int64),
        memory.astype(np.int64),
        drive,
        value,
        index.astype(np.int64),
        np.array(load, np.int64),
    )
