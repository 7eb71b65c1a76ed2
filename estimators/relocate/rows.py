"""
What is remembered of a sample: some of its numbers, and what was known of each parameter.

A row of the ring is numbers of eight bytes. Those of the sample come first, at the same places
whatever was carried.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.records import Record, record

Array = NDArray[np.float64]

OF_SAMPLE = (
    "epsilon", "scale", "expected", "noise", "quiet", "samples", "signal", "armed", "learning",
    "heard", "evidence", "silent", "lags", "correlations", "model", "colour", "unforeseen", "plain",
    "white", "correlation", "power", "count", "y", "valid", "u", "turned",
)  # fmt: skip
"""Fields of a state that are remembered of a sample …"""
OF_ALL = ("theta", "P", "claim", "X", "psi")
"""… and of every parameter."""


@dataclass(frozen=True)
class Stretch:
    """
    A copy of what was known after each of N samples in a row; nothing changes it any more.

    Attributes
    ----------
    first : int
        The first sample, counted from the start of the filter.
    rows : (N,) array of records
        The filter after the measurement of each.
    """

    first: int
    rows: Record

    def at(self, sample: int) -> np.void:
        """Return the filter after a sample."""
        return self.rows[sample - self.first]

    @property
    def theta(self) -> Array:
        """All parameters, (N, p)."""
        return np.ascontiguousarray(self.rows["theta"])

    @property
    def x(self) -> Array:
        """State, (N, n)."""
        return np.ascontiguousarray(self.rows["X"][:, :-1, 0])


def row_of(design: Design, state: Record) -> Record:
    """
    Return a row (1,) as it is at the start, of all parameters.

    Parameters
    ----------
    design : Design
        Of all parameters.
    state : (1,) record
        Of them, without θ and X.
    """
    p, n = len(design.theta0), design.model.n
    X = np.zeros((n + 1, 1 + p))
    X[:-1, 0] = design.x0
    X[-1, 0] = design.model.blocks(design.theta0)[0, -1, :-1] @ design.x0
    own = {"theta": design.theta0, "X": X}
    return record(
        **{name: own[name] if name in own else state[name][0] for name in OF_SAMPLE + OF_ALL}
    )


def heard(row: Record) -> np.dtype:
    """Return of what a row is, of which `flexaxis.estimators.relocate.taking.relearn` learns."""
    return np.dtype([(name, row.dtype[name]) for name in (*OF_SAMPLE, "psi")])


def words_of(records: Record) -> Array:
    """Return records (N,) as their numbers of eight bytes (N, K), to read and to write."""
    return records.view(float).reshape(len(records), -1)


def roughness(residuals: Array, enough: int) -> float:
    """
    Return the variance of the noise by residuals (N,), whatever a wrong model adds.

    Mean of (e[k] − 3e[k−1] + 3e[k−2] − e[k−3])²/20, as in
    `flexaxis.estimators.recursion.level`; zero where no more than ``enough`` are known.
    """
    rough = np.convolve(residuals, [1.0, -3.0, 3.0, -1.0], "valid")
    known = rough[~np.isnan(rough)]
    return float(np.mean(known**2) / 20) if len(known) > enough else 0.0
