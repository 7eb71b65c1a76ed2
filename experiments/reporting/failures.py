"""Cases that could not be run, in words."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

_SAMPLE = re.compile(r", sample \d+( \([^)]*\))?")
ALIKE = 60  # characters by which two reasons are told apart


def in_words(failures: Sequence[Mapping[str, Any]]) -> list[tuple[str, int]]:
    """Return a sentence for each kind of failure, and how many cases failed like that.

    Parameters
    ----------
    failures : sequence of mapping
        With `scenario`, `estimator`, `seed` and `error`.
    """
    told: dict[tuple[str, str], list[str]] = {}
    for row in failures:
        where = f"{row['scenario']}, seed {row['seed']}"
        text = row["error"].partition(": ")[2]
        if not text.startswith(row["estimator"]):  # else it says itself of whom and where
            text = f"{row['estimator']} failed on {where}: {row['error']}"
        alike = row["estimator"], _SAMPLE.sub("", row["error"].replace(where, ""))[:ALIKE]
        told.setdefault(alike, []).append(text)
    return [(texts[0], len(texts)) for texts in told.values()]
