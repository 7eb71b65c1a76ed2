"""Consistency: whether an estimator knows its own errors, of its estimates and its predictions."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.scores import Track, finite
from flexaxis.experiments.scoring.windows import claimed_at

Array = NDArray[np.float64]

MEMORY = (
    0.1  # s of lags that whiteness looks at: two periods of the slower mode of the nominal axis
)


def nis(innovations: Array) -> float | None:
    """Return the mean of ε²/S, 1 for an honest claim: normalised innovation squared.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 5.4.2.

    Parameters
    ----------
    innovations : ndarray (N, 2)
        ε = y − ŷ before y was used, and S, the variance claimed of it; NaN where there was no y.

    Returns
    -------
    float or None
        None where nothing is claimed, or nothing that can be.
    """
    z = normalised(innovations)
    z = z[~np.isnan(z)]
    return finite(float(np.mean(z**2))) if z.size else None


def whiteness(innovations: Array, lags: int) -> float | None:
    """Return the Ljung-Box statistic of ε/√S over its degrees of freedom: 1 on average if white.

    With the autocorrelations r_l of n values, of which n_l pairs lie l samples apart,

    Q = (n + 2)/n Σ_l n_l r_l²,  r_l = (mean of the n_l products)/(mean square),

    which without gaps is n (n + 2) Σ_l ρ_l²/(n − l) of Ljung and Box, Biometrika 65, 1978, 297-303.
    No mean is taken off: an innovation that has one is not white.

    Parameters
    ----------
    innovations : ndarray (N, 2)
        As for `nis`.
    lags : int
        Number of lags, from 1.

    Returns
    -------
    float or None
        None where nothing is claimed, or there are no two values at one of the distances.
    """
    z = normalised(innovations)
    defined = ~np.isnan(z)
    z, n = np.where(defined, z, 0.0), int(defined.sum())
    square = float(np.sum(z**2))
    if n < 2 or not np.isfinite(square) or square == 0:
        return None
    pairs = np.array([np.sum(defined[lag:] & defined[:-lag]) for lag in range(1, lags + 1)])
    products = np.array([z[lag:] @ z[:-lag] for lag in range(1, lags + 1)])
    if not pairs.all():
        return None
    r = products / pairs / (square / n)
    return finite(float((n + 2) / n * np.sum(pairs * r**2) / lags))


def normalised(innovations: Array) -> Array:
    """Return ε/√S (N,), NaN where it is not defined."""
    epsilon, variance = np.asarray(innovations, float).T
    good = np.isfinite(epsilon) & np.isfinite(variance) & (variance > 0)
    return np.where(good, epsilon / np.sqrt(np.where(good, variance, 1.0)), np.nan)


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


# What follows are the scores themselves, the same for all parameters of a case.


def nis_of(track: Track, i: int) -> float | None:
    """Return the mean of ε²/S in the time in which std is taken."""
    del i
    innovations = _quiet(track)
    return None if innovations is None else track.once("nis", lambda: nis(innovations))


def whiteness_of(track: Track, i: int) -> float | None:
    """Return the colour of the innovations in the time in which std is taken."""
    del i
    innovations, lags = _quiet(track), round(MEMORY / track.scenario.period)
    return (
        None
        if innovations is None
        else track.once("whiteness", lambda: whiteness(innovations, lags))
    )


def _quiet(track: Track) -> Array | None:
    """Return the innovations from first to last quiet sample, NaN in pauses between them."""
    if track.innovations is None or not track.quiet.size:
        return None
    first, last = track.quiet[[0, -1]]
    pause = ~np.isin(np.arange(first, last + 1), track.quiet)
    return np.where(pause[:, None], np.nan, track.innovations[first : last + 1])


def nees_of(track: Track, i: int) -> float | None:
    """Return θ̃ᵀ Σ⁻¹ θ̃ with the claimed covariance, before the first fault."""
    del i
    last = claimed_at(track.scenario)
    return track.once("nees", lambda: nees(track.theta[last] - track.truth[last], track.claimed))
