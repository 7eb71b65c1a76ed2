"""What a bank of hypotheses says of the parameters: mean and covariance over it, and its parts."""

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.glr.workspace import Workspace

Array = NDArray[np.float64]


def mean(work: Workspace) -> tuple[Array, Array]:
    """Return all parameters (p,) and their covariance (p, p), over all hypotheses."""
    bank, scale, p = work.bank, work.design.scale, work.p
    theta, P = work.states["theta"][0].copy(), work.states["P"][0, :p, :p].copy()
    if bank["taken"]:
        theta[:] = bank["mixed"]
        union = bank["union"]
        theta[union] = bank["given"]
        P[np.ix_(union, union)] = bank["given_P"] + bank["given_between"]
        P += _between(work)
    return theta * scale, P * np.outer(scale, scale)


def _between(work: Workspace) -> Array:
    """Return what of the covariance of θ lies between the hypotheses, and in their sizes."""
    bank = work.bank
    likely = np.flatnonzero(bank["weight"] > 1e-9)
    D, weight = bank["D"][: work.p, likely], bank["weight"][likely]
    size = bank["size"][likely]
    variance = bank["variance"][likely % len(work.jumps.which)]
    spread = 1.0 / (bank["J"][likely] / bank["kappa"] + 1.0 / variance)
    moved = D @ (weight * size)
    return (D * (weight * (size**2 + spread))) @ D.T - np.outer(moved, moved)


def beliefs(work: Workspace) -> dict[str, float]:
    """Return the probability that each parameter has jumped."""
    by = work.bank["weight"].reshape(-1, len(work.jumps.which)).sum(axis=0)
    return {work.names[i]: float(w) for i, w in zip(work.jumps.which, by, strict=True)}


def hypotheses(work: Workspace) -> dict[str, Array]:
    """Return how many samples ago (H, 3), with which probability and by how much each jumped."""
    bank, which = work.bank, work.jumps.which
    held = np.flatnonzero(bank["onset"] >= 0)
    rows = held[np.argsort(-bank["onset"][held], kind="stable")]
    weight, size = (bank[key].reshape(-1, len(which))[rows] for key in ("weight", "size"))
    ago = work.now - bank["onset"][rows]
    names, scale = work.names, work.design.scale
    return {
        names[i]: np.stack([ago, weight[:, j], size[:, j] * scale[i]], axis=1)
        for j, i in enumerate(which)
    }
