"""What `relocate` tells of a change that it found; see `flexaxis.estimators.finding`."""

from flexaxis.estimators.finding import LOST, UNEXPLAINED, Finding

__all__ = ["LOST", "UNEXPLAINED", "Finding"]
