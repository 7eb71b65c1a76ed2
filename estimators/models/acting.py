"""The laws of a model as records, for compiled code."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.laws import INPUT, KINDS, LAWS, MOST_ROLES, Law

F, F_W, F_S, S, S_W, S_S, ROLE = range(7)
"""Places in ``local``, see `flexaxis.estimators.models.law_torques`."""
LAW = np.dtype(
    [("kind", int), ("memory", int), ("load", int)]
    + [(name, float) for name in ("force", "offset", "change", "reach")]
    + [("parameter", int, MOST_ROLES), ("value", float, MOST_ROLES)]
    + [("roles", float, MOST_ROLES), ("local", float, ROLE + 2 * MOST_ROLES)]
)
"""
A law: its place in `KINDS`; the state that it has of its own, and the law by whose drive it is
loaded, −1 for none; the torque of the last step, c, w̄ in a step of the search and what it is made
of; which θ_i its parameters are by role, −1 for none, with factors of these, or values; parameters
at θ, and what its torque is, with derivatives.
"""


class Acting(NamedTuple):
    """
    The laws of a model as compiled code takes them, for θ relative or not.

    Attributes
    ----------
    records : (L,) records
    drive : (L, n+1) array
        w of each law, as factors of the n states and of the input.
    """

    records: NDArray[np.void]
    drive: NDArray[np.float64]

    def relative(self, scale: NDArray[np.float64]) -> "Acting":
        """Return the same as functions of θ/scale."""
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
