"""Averaged spectra of torque and motion by Welch's method: the one place where they are made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd

Array = NDArray[np.float64]

SEGMENT = 4.0  # s, of which spectra are averaged
EDGE = 0.01  # of the power of the torque that lies below its band, and above it


@dataclass(frozen=True)
class Spectra:
    """Averaged spectra of torque u and motion y.

    Attributes
    ----------
    frequency : ndarray (M,)
        [Hz].
    torque, motion : ndarray (M,)
        Power densities.
    cross : ndarray (M,) of complex
        From torque to motion.
    """

    frequency: Array
    torque: Array
    motion: Array
    cross: NDArray[np.complex128]

    @property
    def coherence(self) -> Array:
        """Share of the motion that the torque explains (M,); 0 where there is neither."""
        both = self.torque * self.motion
        return np.divide(np.abs(self.cross) ** 2, both, out=np.zeros_like(both), where=both > 0)

    @property
    def band(self) -> tuple[float, float]:
        """Frequencies between which 98 % of the power of the torque lies [Hz]."""
        share = np.cumsum(self.torque) / max(float(np.sum(self.torque)), 1e-300)
        low, high = np.interp([EDGE, 1 - EDGE], share, self.frequency)
        return float(low), float(high)


def spectra(
    u: Array, y: Array, period: float, *, pieces: int = 2, length: int = 0, trend: bool = False
) -> Spectra:
    """Return averaged spectra of two signals (N,).

    Parameters
    ----------
    u, y : ndarray (N,)
    period : float
        [s].
    pieces : int
        That a short record has at the least; of a long one they are `SEGMENT` long.
    length : int
        Of a piece, in samples, in place of that.
    trend : bool
        Whether a straight line is taken from each piece, and not its mean alone.
    """
    length = length or min(len(u) // pieces, round(SEGMENT / period))
    detrend = "linear" if trend else "constant"
    first, second = np.stack([u, y, u]), np.stack([u, y, y])
    frequency, each = csd(first, second, fs=1 / period, nperseg=length, detrend=detrend)
    return Spectra(frequency, each[0].real, each[1].real, each[2])
