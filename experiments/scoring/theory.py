"""A case beside its theory: limits, score, consistency of the claim."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.case import Track, finite, lag_of
from flexaxis.experiments.scoring.limits import Limits, record_limits, score
from flexaxis.experiments.scoring.windows import claimed_at

Array = NDArray[np.float64]


def nees(error: Array, covariance: Any) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃, which for an honest Σ is χ² with p degrees of freedom on average p.

    Parameters
    ----------
    error : ndarray (p,)
        θ̃.
    covariance : array_like (p, p) or None
        Σ, as claimed.
    """
    if covariance is None:
        return None
    scale = np.sqrt(np.abs(np.diag(np.asarray(covariance, float))))
    if not (np.isfinite(error).all() and np.all(scale > 0)):
        return None
    try:
        scaled = error / scale
        return finite(float(scaled @ np.linalg.solve(covariance / np.outer(scale, scale), scaled)))
    except np.linalg.LinAlgError:
        return None


# What follows are the scores themselves: of a track and the index of an estimated parameter.


def limits_of(track: Track, i: int) -> Limits:
    """Return the limits of one estimated parameter.

    They are those of the scenario's `identify`, the same for all estimators: whoever takes more or
    fewer parameters for unknown is measured by the same bound.
    """
    asked = track.scenario.identify
    if track.torque is None or track.names[i] not in asked:
        return Limits()
    torque = track.torque
    found = track.once("limits", lambda: record_limits(track.scenario, torque))
    return found[asked.index(track.names[i])]


def score_of(track: Track, i: int) -> float | None:
    """Return the score of the lag between doing nothing and the bound."""
    return score(lag_of(track, i), limits_of(track, i))


def nees_of(track: Track, i: int) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃ where it is asked what is claimed, before the first fault."""
    del i
    last = claimed_at(track.scenario)
    return track.once("nees", lambda: nees(track.theta[last] - track.truth[last], track.claimed))
