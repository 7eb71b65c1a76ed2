"""
Several runs at once: those that fit together side by side in the registers of the processor.

Every estimator gives what it gives alone, to the last bit, whoever runs beside it: only the time
differs.
"""

from collections import defaultdict
from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.beside import kind_of, take_together
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]


def run_together(
    estimators: Sequence[Estimator],
    u: Sequence[ArrayLike],
    y: Sequence[ArrayLike],
    valid: Sequence[ArrayLike | None] | None = None,
    *,
    patient: bool = False,
) -> list[Array]:
    """
    Run estimators, each on its own signals, and return the estimates of each.

    Runs of the prediction-error method, `flexaxis.estimators.Rpem`, on models of one structure and
    records of one length go side by side in vector registers, whatever their tunings, starts and
    gaps; two to three times as many samples a second as one by one. All others are run alone.
    Estimates and what every estimator is left with are the same as from its own ``run``.

    Parameters
    ----------
    estimators : sequence of Estimator
        Each another one; they go on from the state they are in.
    u, y : sequence of (N,) array_like
        Torque and output for each.
    valid : sequence of (N,) array_like of bool or None, optional
        False where y is missing.
    patient : bool
        Whether code is compiled for this only when so many samples have come together that it is
        worth its while.

    Returns
    -------
    list of (N, p) arrays

    Raises
    ------
    EstimatorError
        If there are not as many signals as estimators, an estimator is given twice, or signals
        cannot be used.
    """
    gaps = [None] * len(estimators) if valid is None else list(valid)
    if not len(estimators) == len(u) == len(y) == len(gaps):
        raise EstimatorError(
            f"{len(estimators)} estimators got {len(u)} u, {len(y)} y and {len(gaps)} valid; give "
            "each its own"
        )
    if len({id(estimator) for estimator in estimators}) < len(estimators):
        raise EstimatorError("an estimator is given twice; give a copy of it for each run")
    signals = [check_signals(*each) for each in zip(u, y, gaps, strict=True)]
    together: dict[Hashable, list[int]] = defaultdict(list)
    for i, (estimator, (given, _, _)) in enumerate(zip(estimators, signals, strict=True)):
        if (kind := kind_of(estimator)) is not None:
            together[kind, len(given)].append(i)
    found: dict[int, Array | None] = {}
    for (kind, _), places in together.items():
        some = [(estimators[i], signals[i]) for i in places]
        found |= zip(places, take_together(kind, some, patient=patient), strict=True)
    return [
        run_estimator(estimator, *signals[i]) if found.get(i) is None else found[i]
        for i, estimator in enumerate(estimators)
    ]
