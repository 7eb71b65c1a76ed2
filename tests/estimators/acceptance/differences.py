"""Slopes by central differences."""

from collections.abc import Callable

import numpy as np


def central(function: Callable, at: np.ndarray, part: float) -> np.ndarray:
    """∂function/∂at_i (p, …), with steps that are a part of each value."""
    steps = part * np.diag(np.abs(at))
    return np.array([(function(at + s) - function(at - s)) / (2 * s.max()) for s in steps])
