"""
Several runs at once: those that fit together side by side in the registers of the processor.

Every estimator gives what it gives alone, to the last bit, whoever runs beside it: only the time
differs.
"""

from collections import Counter, defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.beside import Kind, is_worth, kind_of, take_together
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.signals import check_signals

Array = NDArray[np.float64]


def run_together(
    estimators: Sequence[Estimator],
    u: Sequence[ArrayLike],
    y: Sequence[ArrayLike],
    valid: Sequence[ArrayLike | None] | None = None,
) -> list[Array]:
    """
    Run estimators, each on its own signals, and return the estimates of each.

    Runs of the prediction-error method, `flexaxis.estimators.Rpem`, on models of one structure and
    records of one length go side by side in vector registers, whatever their tunings, starts and
    gaps: two to three times as many samples a second as one by one with AVX-512, a third more with
    AVX2. Their bounds and period must ask for series of one order
    (`flexaxis.estimators.sampling.plan`). All others are run alone.
    Estimates and what every estimator is left with are the same as from its own ``run``.

    Parameters
    ----------
    estimators : sequence of Estimator
        Each another one; they go on from the state they are in.
    u, y : sequence of (N,) array_like
        Torque and output for each.
    valid : sequence of (N,) array_like of bool or None, optional
        False where y is missing.

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
    together: dict[tuple[Kind, int], list[int]] = defaultdict(list)
    for i, (estimator, (given, _, _)) in enumerate(zip(estimators, signals, strict=True)):
        if (kind := kind_of(estimator)) is not None:
            together[kind, len(given)].append(i)
    found: list[Array | None] = [None] * len(estimators)
    for (kind, _), places in together.items():
        some = [(estimators[i], signals[i]) for i in places]
        for i, theta in zip(places, take_together(kind, some), strict=True):
            found[i] = theta
    return [
        run_estimator(estimator, *given) if theta is None else theta
        for estimator, given, theta in zip(estimators, signals, found, strict=True)
    ]


def worth_together(estimators: Sequence[Estimator], samples: int, *, runs: int = 1) -> list[bool]:
    """
    Return which of some estimators are better run together, by `run_together`, than each alone.

    Side by side needs code of its own, half a second of compiling for each structure of a model.
    It is compiled here, and only when as many samples as pay for that have come together in this
    process, or when it is in the cache folder. The answer changes the time that runs take, and
    nothing else.

    Parameters
    ----------
    estimators : sequence of Estimator
    samples : int
        That each is to take in a run.
    runs : int
        Of each, by copies of it.
    """
    kinds = [kind_of(estimator) for estimator in estimators]
    counts = Counter(kind for kind in kinds if kind is not None)
    worth = {kind for kind, count in counts.items() if is_worth(kind, runs * count, samples)}
    return [kind in worth for kind in kinds]
