"""Provide random numbers for each purpose, independent of the order in which they are drawn."""

from __future__ import annotations

from hashlib import sha256

import numpy as np


def stream(key: str, seed: int, purpose: str) -> np.random.Generator:
    """Return the random number generator for one purpose in one run.

    Two generators are statistically independent if their keys, seeds or purposes differ. Two
    generators with the same key, seed and purpose produce the same numbers, even in different
    processes.

    Parameters
    ----------
    key : str
        Key of the scenario, `Scenario.key`.
    seed : int
        Seed of the run.
    purpose : str
        Purpose of the random numbers, for example ``"noise.speed"``.

    Notes
    -----
    The random number generator is Philox 4x64 (Salmon et al., 2011). The Philox key consists of the
    first 128 bits of a SHA-256 hash of `key`, `seed` and `purpose`.
    """
    digest = sha256(f"{key}/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))
