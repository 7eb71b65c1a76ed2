"""The colour of a noise: filters that make residuals white, and where they have settled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

HIGHEST_ORDER = 60  # of the model of the noise
BRIDGED = 10  # times a gap, that a high-pass needs to forget it


@dataclass(frozen=True)
class Colour:
    """
    What makes residuals white: a high-pass where there is one, then the inverse of the noise.

    Attributes
    ----------
    inverse : (n+1,) array
        1, a₁, …, a_n of the autoregression.
    highpass : (s, 6) array or None
        Sections of a filter, as scipy has them.
    skip : int
        Samples that the high-pass needs to settle.
    """

    inverse: Array
    highpass: Array | None = None
    skip: int = 0

    def white(self, x: Array) -> Array:
        """Return signals (…, N) filtered."""
        return lfilter(self.inverse, 1.0, self.high(x), axis=-1)

    def high(self, x: Array) -> Array:
        """Return signals (…, N) without what the high-pass takes away."""
        return x if self.highpass is None else sosfilt(self.highpass, x, axis=-1)

    def bridged(self, x: Array, ok: Flags) -> Array:
        """Return signals (…, N) with lines over what is missing, so that the high-pass rests.

        The inverse has an end, and `_settled` leaves out what it has seen; a high-pass has none,
        and would ring for what a simulation is off where nothing was measured.
        """
        if self.highpass is None or ok.all() or not ok.any():
            return x
        k = np.arange(len(ok))
        lines = [np.interp(k, k[ok], row[ok]) for row in x.reshape(-1, len(ok))]
        return np.where(ok, x, np.reshape(lines, x.shape))

    def settled(self, ok: Flags) -> Flags:
        """
        Return where the filters have seen usable samples only, and the high-pass has settled.

        After a gap it needs `BRIDGED` times as long as the gap was, as a line is missing little of
        a short one, and `skip` samples at most.
        """
        good = _settled(ok, len(self.inverse))
        if self.highpass is None:
            return good
        good[: self.skip] = False
        edges = np.flatnonzero(np.diff(np.r_[True, ok, True]))
        for begin, end in edges.reshape(-1, 2):
            good[end : end + min(self.skip, BRIDGED * (end - begin))] = False
        return good


def colourless(highpass: float | None, period: float) -> Colour:
    """Return the colour of white noise, behind a high-pass of some corner [Hz]."""
    if highpass is None:
        return Colour(np.ones(1))
    sections = butter(4, highpass * 2 * period, "highpass", output="sos")
    return Colour(np.ones(1), sections, round(1 / (highpass * period)))


def _settled(ok: Flags, length: int) -> Flags:
    """Return where a filter of some length has seen usable samples only."""
    return np.convolve(~ok, np.ones(length))[: len(ok)] < 0.5


def noise_model(residual: Array, highest: int, ok: Flags | None = None) -> Array:
    """
    Return the coefficients (n+1,) of an autoregression, 1, a₁, …, a_n, of the best order.

    By the recursion of Levinson and Durbin; the order is the one of the least Bayesian information
    criterion, N log σ² + n log N. Samples on either side of a gap are no neighbours: what is not
    ``ok`` adds nothing to the correlations, which stay those of a sequence.
    """
    used = np.ones(len(residual), bool) if ok is None else ok
    N = int(used.sum())
    e = np.where(used, residual - residual[used].mean(), 0.0)
    highest = min(highest, N // 20)
    r = np.array([e[: len(e) - k] @ e[k:] for k in range(highest + 1)]) / N
    a, variance = np.ones(1), r[0]
    best, least = a, N * np.log(variance)
    for n in range(1, highest + 1):
        reflection = -(a @ r[n:0:-1]) / variance
        a = np.append(a, 0.0)
        a = a + reflection * a[::-1]
        variance *= 1 - reflection**2
        criterion = N * np.log(variance) + n * np.log(N)
        if criterion < least:
            best, least = a, criterion
    return best
