"""When the torque acts: delays that can be, those that cannot, and what they mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt
from flexaxis.experiments.logs.errors import LogError

Array = NDArray[np.float64]

EARLY = 3.0  # standard deviations beyond the least delay that there can be
HALF, NOTHING = 0.5, 0.05  # samples: least delay of a measured torque; and less is none


def check_delay(attempt: Attempt) -> None:
    """Refuse a given delay that is none of those that are looked for.

    Raises
    ------
    LogError
    """
    delay, least, most = attempt.delay, attempt.earliest, attempt.latest
    if delay is None or least <= delay <= most:
        return
    raise LogError(
        f"--delay {delay:g}: the torque of this log acts {least:g} … {most:g} s after it is "
        "logged; shift its column by whole samples if it is further off"
    )


def at_its_least(attempt: Attempt, fitted: Fitted) -> bool:
    """Return whether a delay that was looked for came to its least."""
    return attempt.delay is None and bool(fitted.z[-1] <= attempt.earliest)


def too_late(attempt: Attempt, fitted: Fitted, deviations: Array, stated: bool) -> list[str]:
    """Return what a delay at the end of what is possible means, and one beyond it.

    A held torque acts when it is set and not before. One that is smooth may be the mean over the
    sample that ends where it is logged; then it is half a sample early.
    """
    lag, period = float(fitted.z[-1]), attempt.log.period
    if attempt.delay is not None:
        return []
    if lag >= attempt.latest * (1 - 1e-9):
        return [
            f"the torque acts {1e3 * lag:.3g} ms late or more: the columns of torque and motion "
            "are shifted; look at `flexaxis import`, or give --delay S"
        ]
    least = -HALF * period if stated else -NOTHING * period
    if attempt.log.smooth and lag < least - EARLY * deviations[-1]:
        return [
            f"the torque acts {-lag / period:.2f} samples before it is logged, which is not "
            "possible: its column is shifted against the motion, or filtered (a measured current "
            "is); shift it (by a sample, if it is held), or log the torque before its filter; "
            "inertias are off as well"
        ]
    return []


def taken_as(attempt: Attempt, fitted: Fitted, stated: bool) -> list[str]:
    """Return how the torque was taken, where nobody said so."""
    if at_its_least(attempt, fitted):
        return [
            "the delay is the least that a held torque can have; that is no estimate, and has "
            "no deviation"
        ]
    if not attempt.log.smooth or stated:
        return []
    return [
        "the torque seems a smooth, measured one, though the record has it as held: it would act "
        "before it is set; it was taken as smooth, as with --torque-is smooth at import"
    ]
