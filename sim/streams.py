"""Random numbers keyed by their purpose, independent of the order of the draws."""

from __future__ import annotations

from hashlib import sha256

import numpy as np


def stream(key: str, seed: int, purpose: str) -> np.random.Generator:
    """Return the random stream for one purpose in one run.

    Streams with different (key, seed, purpose) are independent. The same key, seed and purpose
    give the same numbers on any worker and in any order.

    Parameters
    ----------
    key : str
        Key of the scenario, `Scenario.key`.
    seed : int
        Seed of the run.
    purpose : str
        What the numbers are used for, for example ``"noise.speed"``.

    Notes
    -----
    The generator is Philox 4x64 (Salmon et al., 2011). Its key is the first 128 bits of the SHA-256
    of key, seed and purpose.
    """
    digest = sha256(f"{key}/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))
