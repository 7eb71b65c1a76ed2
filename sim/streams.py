"""Random numbers keyed by their purpose, never by the order of the draws."""

from __future__ import annotations

from hashlib import sha256

import numpy as np


def stream(key: str, seed: int, purpose: str) -> np.random.Generator:
    """Return the random stream of one purpose in one run.

    Streams of different (key, seed, purpose) are independent. The same three give the same
    numbers on any worker and in any order.

    Parameters
    ----------
    key : str
        That of the scenario, `Scenario.key`.
    seed : int
        Number of the run.
    purpose : str
        What the numbers are for, for example ``"noise.speed"``.

    Notes
    -----
    Philox 4x64 (Salmon et al., 2011) with the first 128 bits of the SHA-256 of the three as key.
    """
    digest = sha256(f"{key}/{seed}/{purpose}".encode()).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest[:16], "big")))
