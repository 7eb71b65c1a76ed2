"""Check whether the variances that an estimator reports agree with its actual errors."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.scores import Track, finite
from flexaxis.experiments.scoring.windows import claimed_at

Array = NDArray[np.float64]

MEMORY = 0.1  # longest lag of the whiteness test, two periods of the slower nominal mode [s]


def nis(innovations: Array) -> float | None:
    """Return the normalised innovation squared (NIS), which is the mean of ε²/S.

    If the variances S are correct, the expected NIS is 1 (Bar-Shalom, Li and Kirubarajan,
    Estimation with Applications to Tracking and Navigation, 2001, section 5.4.2).

    Parameters
    ----------
    innovations : ndarray (N, 2)
        Innovations ε = y − ŷ, and the innovation variances S that the estimator reports. The
        estimator predicts ŷ before it uses y. The innovations and variances are NaN where y is
        missing.

    Returns
    -------
    float or None
        Mean of ε²/S, or None if the estimator reports no positive, finite variance.
    """
    z = normalised(innovations)
    z = z[~np.isnan(z)]
    return finite(float(np.mean(z**2))) if z.size else None


def whiteness(innovations: Array, lags: int) -> float | None:
    """Return the Ljung-Box statistic of ε/√S, divided by its degrees of freedom.

    For white innovations, the expected result is 1. The statistic Q is computed from n innovations;
    n_l is the number of pairs of innovations that are l samples apart.

    Q = (n + 2)/n Σ_l n_l r_l²,  where r_l is the mean product over the n_l pairs, divided by the
    mean square of all normalised innovations.

    Without missing values, Q is the statistic n (n + 2) Σ_l ρ_l²/(n − l) of Ljung and Box
    (Biometrika 65, 1978, 297-303). The function does not subtract the mean of the innovations,
    because innovations with a nonzero mean are not white.

    Parameters
    ----------
    innovations : ndarray (N, 2)
        Innovations ε and reported variances S, as in the function `nis`.
    lags : int
        Number of lags: l runs from 1 to `lags`.

    Returns
    -------
    float or None
        Ljung–Box statistic divided by `lags`. The result is None if the estimator reports no valid
        variance, or if a lag has no pair of valid innovations.
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
    """Return the normalised innovations ε/√S (N,); undefined values are NaN."""
    epsilon, variance = np.asarray(innovations, float).T
    good = np.isfinite(epsilon) & np.isfinite(variance) & (variance > 0)
    return np.where(good, epsilon / np.sqrt(np.where(good, variance, 1.0)), np.nan)


def nees(error: Array, covariance: Any) -> float | None:
    """Return the normalised estimation error squared (NEES), which is θ̃ᵀ Σ⁻¹ θ̃.

    If Σ is correct, the NEES of p parameters has a χ² distribution with p degrees of freedom and
    mean p.

    Parameters
    ----------
    error : ndarray (p,)
        Errors θ̃ of the estimates.
    covariance : array_like (p, p) or None
        Covariance Σ that the estimator reports.
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


# Scores: functions of a track that return the same value for all parameters of a case.


def nis_of(track: Track, i: int) -> float | None:
    """Return the NIS over the samples (all before the fault) from which `std` is computed."""
    del i
    innovations = _quiet(track)
    return None if innovations is None else nis(innovations)


def whiteness_of(track: Track, i: int) -> float | None:
    """Return the whiteness of the innovations at the samples from which `std` is computed."""
    del i
    innovations, lags = _quiet(track), round(MEMORY / track.scenario.period)
    return None if innovations is None else whiteness(innovations, lags)


def _quiet(track: Track) -> Array | None:
    """Return the innovations before the fault, with NaN during excitation pauses.

    The function returns None if the estimator reports no innovations, or if there are no samples
    before the fault.
    """
    if track.innovations is None or not track.quiet.size:
        return None
    first, last = track.quiet[[0, -1]]
    pause = ~np.isin(np.arange(first, last + 1), track.quiet)
    return np.where(pause[:, None], np.nan, track.innovations[first : last + 1])


def nees_of(track: Track, i: int) -> float | None:
    """Return the NEES θ̃ᵀ Σ⁻¹ θ̃ before the first fault, from the reported covariance Σ."""
    del i
    last = claimed_at(track.scenario)
    return nees(track.theta[last] - track.truth[last], track.claimed)
