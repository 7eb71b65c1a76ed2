"""Axes of a study: which are options of an estimator, and points in words."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

ALL = "estimator"  # before the name of an option: that of every estimator
SIZE = re.compile(r"fault\[(\d+)\]\.factor")  # the size of a fault


def applies(key: str, estimator: str) -> bool:
    """Whether an axis is an option of this estimator: "estimator.X" of all, "NAME.X" of one.

    Examples
    --------
    >>> applies("estimator.forgetting", "rpem-forgetting")
    True
    >>> applies("ekf.walk", "rpem-forgetting")
    False
    """
    return key.rpartition(".")[0] in {ALL, estimator.partition("[")[0].strip()}


def is_option(key: str, estimators: Sequence[str]) -> bool:
    """Whether an axis is an option of estimators, and not a key of the scenario."""
    return key.rpartition(".")[0] == ALL or any(applies(key, text) for text in estimators)


def in_words(axes: Mapping[str, Any]) -> str:
    """Return a point in words: "fault[0].factor = 1.5, start = 1.2"."""
    return ", ".join(f"{key} = {json.dumps(value)}" for key, value in axes.items())
