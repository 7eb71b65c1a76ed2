"""What an estimator tells of a change that it found."""

from dataclasses import dataclass


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
    interval : tuple of (float, float)
        Between which the ratio lies with a probability of 95 %, for each; empty where none is
        claimed.
    """

    alarm: int
    onset: int
    parameters: tuple[str, ...]
    ratio: tuple[float, ...]
    reason: str = ""
    interval: tuple[tuple[float, float], ...] = ()
