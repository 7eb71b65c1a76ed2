"""How often an estimator comes how near to the bound: its lags over all scenarios and runs.

The view of COCO (Hansen et al., Optimization Methods and Software 36, 2021, 114-144): the share of
all problems that are solved within a multiple of the best that can be. A problem here is a fault in
a run, and the best the lag of its Cramér–Rao bound.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Row = Mapping[str, Any]

AS_NULL = 1 - 1e-6  # of the lag of an estimator that never moves: no better than that


@dataclass(frozen=True, eq=False)
class Ecdf:
    """The distribution of lag over bound, of several estimators on the same problems.

    Attributes
    ----------
    problems : int
        Faults in runs, the same for all: who has no lag at one has not reached it.
    faults : int
        Pairs of scenario and parameter among them.
    ratios : mapping of str to ndarray
        lag/bound of each estimator, increasing, of the problems where it reached anything.
    """

    problems: int
    faults: int
    ratios: Mapping[str, Array]

    def curve(self, estimator: str) -> tuple[Array, Array]:
        """Return x and the share of problems with lag/bound ≤ x, where it steps up."""
        ratios = self.ratios[estimator]
        return ratios, np.arange(1, len(ratios) + 1) / self.problems

    def share(self, estimator: str, within: float) -> float:
        """Return the share of problems with lag/bound ≤ `within`."""
        return float(np.sum(self.ratios[estimator] <= within) / self.problems)


def ecdf(rows: Iterable[Row], estimators: Sequence[str]) -> Ecdf | None:
    """Return the distribution of lag over bound; None where no fault has a bound.

    A run that was lost, that could not be run, or whose lag is that of an estimator that never
    moves, never reaches anything, and neither does who does not estimate what changes: all count
    among the problems.

    Parameters
    ----------
    rows : iterable of mapping
        Of single runs: ``scenario, parameter, seed, estimator, lag, lag_bound, lag_null,
        diverged``. Rows without a bound are left out.
    estimators : sequence of str
        Who is asked for, in their order.
    """
    problems: set[tuple[str, str, int]] = set()
    found: dict[str, list[float]] = {name: [] for name in estimators}
    for row in rows:
        if row["lag_bound"]:
            problems.add((row["scenario"], row["parameter"], row["seed"]))
            if row["estimator"] in found and _reached(row):
                found[row["estimator"]].append(row["lag"] / row["lag_bound"])
    if not problems:
        return None
    ratios = {name: np.sort(np.array(each, float)) for name, each in found.items()}
    return Ecdf(len(problems), len({problem[:2] for problem in problems}), ratios)


def _reached(row: Row) -> bool:
    if row["diverged"] or row["lag"] is None:
        return False
    null = row["lag_null"]
    return null is None or row["lag"] < AS_NULL * null
