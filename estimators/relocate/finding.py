"""What `relocate` tells of a change that it found; see `flexaxis.estimators.finding`."""

from flexaxis.estimators.finding import LOST, OVERTAKEN, UNEXPLAINED, Finding

__all__ = ["LOST", "OVERTAKEN", "UNEXPLAINED", "Finding", "interval_of"]

SURE = 1.96  # standard deviations, of 95 %


def interval_of(after: float, before: float, variances: tuple[float, float]) -> tuple[float, float]:
    """Return in which interval a ratio lies, of two values with independent errors."""
    ratio = after / before
    deviation = (variances[0] + variances[1] * ratio**2) ** 0.5 / abs(before)
    return float(ratio - SURE * deviation), float(ratio + SURE * deviation)
