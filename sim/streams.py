"""Provide random numbers that depend on their purpose and not on the order of the draws."""

from __future__ import annotations

from hashlib import sha256

import numpy as np


def stream(key: str, seed: int, purpose: str) -> np.random.Generator:
    """Return the random number generator for one purpose in one run.

    Generators with different (key, seed, purpose) are independent. Generators with the same key,
    seed and purpose produce the same numbers in every process and in any order.

    Parameters
    ----------
    key : str
        Key of the scenario, `Scenario.key`.
    seed : int
        Seed of the run.
    purpose : str
        Purpose of the numbers, for example ``"noise.speed"``.

    Notes
    -----
    The generator is Philox 4x64 (Salmon et al., 2011). The key of Philox is the first 128 bits of
    the SHA-256 of `key`, `seed` and `purpose`.
    """
    digest = sha256(f"{key}/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))
