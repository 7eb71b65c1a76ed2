"""Cases that could not be run, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

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
        alike = row["estimator"], row["error"].replace(where, "")[:ALIKE]
        told.setdefault(alike, []).append(f"{row['estimator']} failed on {where}: {row['error']}")
    return [(texts[0], len(texts)) for texts in told.values()]
