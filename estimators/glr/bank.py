"""
A bank of hypotheses beside a Kalman filter, in compiled code: that θ_i jumped at sample k₀.

What a jump of size one does to the error of the filter goes along one vector δ, which begins as
e_i. With the output row h, the transition F and the gain K of the filter (`filters.joint`), in
every sample

    φ = hᵀδ,  J ← J + φ²/S,  d ← d + φ e/S,  δ ← F δ − K φ,

whence the size of the jump is ν̂ = d/(J + κ/σ²) and the logarithm of its evidence against none

    ℓ = ½ d²/(J + κ/σ²)/κ − ½ ln(1 + J σ²/κ) + ln(prior),

σ being the standard deviation of sizes (A. S. Willsky and H. L. Jones, *A generalized likelihood
ratio approach to the detection and estimation of jumps in linear systems*, IEEE Trans. AC 21 (1976)
108–112). κ ≥ 1 is the mean of e²/S that no hypothesis explains: a model that is wrong tempers all
of them alike. The estimate is the mean over "no jump" and all hypotheses.

Onsets stand on a grid that thins out with age: on each level the last `PER_LEVEL` multiples of a
spacing, which doubles from level to level. A hypothesis stands for all onsets within its spacing,
and only where no finer level has them.
"""

import numpy as np

from flexaxis.estimators.glr.cogging import pair_columns, pull_columns
from flexaxis.estimators.models.compiler import inlined

PER_LEVEL = 8
FIRM = 20.0  # samples of e²/S of variance one that κ starts from, so that a few say little of it


@inlined
def carry_columns(bank, state, e, S, p):
    """Take every δ over the last sample, and through its measurement unless e is NaN."""
    D, moved, phi, X, gain = bank["D"], bank["moved"], bank["phi"], state["X"], state["gain"]
    m, H = D.shape
    measured = not np.isnan(e)
    root = 1.0 / np.sqrt(S) if measured else 0.0
    times(phi, X[-1], root, D)
    for i in range(m - p):
        times(moved[i], X[i], 1.0, D)
    if bank["searching"] > 0:
        pull_columns(bank, root)
    for i in range(m - p):
        for c in range(H):
            D[p + i, c] = moved[i, c]
    if measured:
        J, d, scaled = bank["J"], bank["d"], e * root
        for c in range(H):
            J[c] += phi[c] * phi[c]
            d[c] += phi[c] * scaled
        for a in range(m):
            g = gain[a]
            for c in range(H):
                D[a, c] -= g * phi[c]
        if bank["searching"] > 0:
            pair_columns(bank, scaled)
        bank["chi2"] += scaled * scaled
        bank["used"] += 1.0


@inlined
def times(out, row, factor, D):
    """Write a row of X, from its second lane on and times a factor, times all columns."""
    for c in range(len(out)):
        out[c] = 0.0
    for a in range(D.shape[0]):
        x = row[1 + a] * factor
        if x != 0.0:
            for c in range(len(out)):
                out[c] += x * D[a, c]


@inlined
def open_slots(bank, state, which, base, now, p):  # noqa: PLR0917
    """Begin the hypotheses whose onset is this sample, in the place of the oldest of a level."""
    onset = bank["onset"]
    spacing, s = base, 0
    while s < len(onset) and now % spacing == 0:
        row = s + (now // spacing) % PER_LEVEL
        onset[row] = now
        bank["chi2_at"][row], bank["used_at"][row] = bank["chi2"], bank["used"]
        q, n = len(which), bank["D"].shape[0] - p
        for i in range(q):
            c = row * q + i
            for a in range(bank["D"].shape[0]):
                bank["D"][a, c] = 0.0
            bank["D"][which[i], c] = 1.0
            bank["J"][c] = bank["d"][c] = 0.0
        P, kept = state["P"], bank["kept_P"][row]
        for a in range(P.shape[0]):
            for b in range(P.shape[1]):
                kept[a, b] = P[a, b]
        for a in range(p):
            bank["kept_xi"][row, a] = state["theta"][a]
        for a in range(n):
            bank["kept_xi"][row, p + a] = state["X"][a, 0]
        spacing, s = 2 * spacing, s + PER_LEVEL


@inlined
def weigh(bank, which, variance, log_prior, base, now, least):  # noqa: PLR0917
    """
    Write size and weight of every hypothesis, and κ; return the logarithm of the odds of any jump.

    ``least`` is κ as it was before anything changed.
    """
    onset, J, d = bank["onset"], bank["J"], bank["d"]
    size, weight = bank["size"], bank["weight"]
    q = len(which)
    best, at = 0.0, -1
    for s in range(len(onset)):
        width = base << (s // PER_LEVEL)
        age = now - onset[s]
        owned = onset[s] >= 0 and age >= (1 if s < PER_LEVEL else PER_LEVEL * width // 2)
        for i in range(q):
            c = s * q + i
            A = J[c] + 1.0 / variance[i]
            size[c] = d[c] / A
            weight[c] = 0.5 * d[c] * size[c] if owned and variance[i] > 0.0 else -1.0
            if weight[c] > best:
                best, at = weight[c], s
    kappa = least
    if at >= 0:
        used = bank["used"] - bank["used_at"][at]
        left = bank["chi2"] - bank["chi2_at"][at] - 2.0 * best
        kappa = max(least, (left + FIRM * least) / (used + FIRM))
    bank["kappa"] = kappa
    highest = 0.0
    for s in range(len(onset)):
        width = base << (s // PER_LEVEL)
        for i in range(q):
            c = s * q + i
            if weight[c] >= 0.0:
                size[c] = d[c] / (J[c] + kappa / variance[i])
                weight[c] = (
                    0.5 * d[c] * size[c] / kappa
                    - 0.5 * np.log1p(J[c] * variance[i] / kappa)
                    + log_prior[i]
                    + np.log(float(width))
                )
                highest = max(highest, weight[c])
            else:
                weight[c] = -np.inf
    total = 0.0
    for c in range(len(weight)):
        bank["evidence"][c] = weight[c]
        weight[c] = np.exp(weight[c] - highest)
        total += weight[c]
    none = np.exp(-highest)
    for c in range(len(weight)):
        weight[c] /= total + none
    bank["none"] = none / (total + none)
    return np.log(max(total, 1e-300)) + highest


@inlined
def mean_of(bank, theta, lower, upper, mixed):
    """Write the mean of θ (p,) over all hypotheses."""
    D, size, weight = bank["D"], bank["size"], bank["weight"]
    for a in range(len(mixed)):
        total = 0.0
        for c in range(len(weight)):
            total += weight[c] * size[c] * D[a, c]
        mixed[a] = min(max(theta[a] + total, lower[a]), upper[a])
