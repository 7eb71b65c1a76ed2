"""What `relocate` tells of a change that it found."""

from dataclasses import dataclass

SURE = 1.96  # standard deviations, of 95 %
UNEXPLAINED = "no single change of a parameter explains the residual since"
LOST = "no parameters near here explain the data"


@dataclass(frozen=True)
class Finding:
    """
    A change that was found.

    Attributes
    ----------
    alarm : int
        Sample at which it was found.
    onset : int
        Sample after which the parameters were different.
    parameters : tuple of str
        What changed; empty for an unmodelled change, which no hypothesis explains.
    ratio : tuple of float
        New value over the value before, for each.
    reason : str
        Why there are no parameters, in words; empty where there are.
    interval : tuple of (low, high)
        In which the ratio lies with 95 %, for each, as the filter claims.
    """

    alarm: int
    onset: int
    parameters: tuple[str, ...]
    ratio: tuple[float, ...]
    reason: str = ""
    interval: tuple[tuple[float, float], ...] = ()


def interval_of(after: float, before: float, variances: tuple[float, float]) -> tuple[float, float]:
    """Return in which interval a ratio lies, of two values with independent errors."""
    ratio = after / before
    deviation = (variances[0] + variances[1] * ratio**2) ** 0.5 / abs(before)
    return float(ratio - SURE * deviation), float(ratio + SURE * deviation)
