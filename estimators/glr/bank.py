"""
A bank of parameter jump hypotheses for a Kalman filter, in compiled code.

Each hypothesis states that one parameter θ_i jumped at the sample k₀, which is called the onset of
the jump. A parameter jump of size one changes the estimation error of the filter by a vector δ. At
the onset of a jump of θ_i, δ is the unit vector e_i. Let h be the output vector, F the transition
matrix, K the gain, e the innovation and S the innovation variance of the filter in
`flexaxis.estimators.filters.joint`. The following equations update a hypothesis by one sample:

    φ = hᵀδ,  J ← J + φ²/S,  d ← d + φ e/S,  δ ← F δ − K φ.

The estimated jump size is ν̂ = d/(J + κ/σ²). The log evidence ℓ of the jump is the following sum:

    ℓ = ½ d²/(J + κ/σ²)/κ − ½ ln(1 + J σ²/κ) + ln(prior),

The symbol σ denotes the prior standard deviation of the jump size. The formulas for jump size and
evidence follow *A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems* (Willsky and Jones, 1976). The misfit factor κ ≥ 1 is the mean of e²/S after the
contribution of the best hypothesis has been subtracted. If the model is wrong, the misfit factor κ
is large and reduces the evidence for all hypotheses equally. The parameter estimate is the weighted
mean over all hypotheses, including the hypothesis that no parameter jumped.

The grid of onset times becomes coarser towards the past. Level 0 of the grid contains the last
`PER_LEVEL` onsets at the finest spacing. Each further level of the grid contains `MORE` older
onsets at twice the spacing of the previous level. When the age of an onset reaches `PER_LEVEL` grid
spacings, the onset moves to the next level if it lies on the coarser grid. Otherwise the onset is
dropped. Each onset therefore belongs to exactly one level and represents all jump times within one
grid spacing.
"""

from typing import NamedTuple

import numpy as np

from flexaxis.estimators.models.compiler import fused, inlined, summed
from flexaxis.estimators.models.matrix_rows import copy
from flexaxis.estimators.models.memory import Matrix, Vector

ALARM = 7.0  # nats, log odds of any jump at which the comparison of candidates starts
PER_LEVEL, MORE = 8, 4  # number of onsets on level 0, and on each further level
NEVER = -1  # index of a sample that does not exist
FIRM = 20.0  # weight of the initial κ in samples, which prevents large changes after few samples


class Columns(NamedTuple):
    """
    The columns δ of H hypotheses, and the sums that determine the jump size of each hypothesis.

    Attributes
    ----------
    D, moved : (m, H), (n+1, H) arrays
        The columns δ of all hypotheses, and the predicted effect of each column on the states and
        the output.
    J, d : (H,) arrays
        For each hypothesis, the information sum Σ φ²/S and the score sum Σ φ e/S over the samples,
        where φ is the effect of the column δ on the output.
    """

    D: Matrix
    moved: Matrix
    J: Vector
    d: Vector


@inlined
def level_of(slot):
    """Return the level of the onset grid to which a slot belongs."""
    return 0 if slot < PER_LEVEL else slot // MORE - 1


@fused
def correct(columns, state, e, S):
    """
    Update the columns δ of all hypotheses with a measurement.

    The function updates the information sum by J ← J + φ², the score sum by d ← d + φ z, and the
    column by δ ← F δ − K √S φ, where φ = hᵀδ/√S is the normalised output effect of the hypothesis.
    The function returns the normalised innovation z = e/√S, or 0 if the measurement is missing.
    Before the call, the array ``moved`` must contain the product G δ.
    """
    D, moved, J, d, gain = columns.D, columns.moved, columns.J, columns.d, state.gain
    n, p, seen = len(moved) - 1, len(state.lower), moved[-1]
    root = 0.0 if np.isnan(e) else 1.0 / np.sqrt(S)
    z = 0.0 if np.isnan(e) else e * root
    for c in range(len(J)):
        phi = seen[c] * root
        J[c] += phi * phi
        d[c] += phi * z
    for a in range(p):
        row, g = D[a], gain[a] * root
        if g != 0.0:
            for c in range(len(row)):
                row[c] -= g * seen[c]
    for i in range(n):
        row, to, g = D[p + i], moved[i], gain[p + i] * root
        for c in range(len(row)):
            row[c] = to[c] - g * seen[c]
    return z


@inlined
def open_slots(bank, state, now):
    """Start the hypotheses for jumps at sample ``now``, and move older onsets to coarser levels."""
    onset, base = bank.onset, bank.now[0]["base"]
    last = level_of(len(onset) - 1)
    for level in range(last, -1, -1):  # the highest level first, so no onset is overwritten
        width = base << level
        if now % width:
            continue
        row = _slot(level, now // width)
        old = onset[row]
        if level < last and old >= 0 and old % (2 * width) == 0:
            _move(bank, row, _slot(level + 1, old // (2 * width)))
        onset[row] = NEVER
    if now % base == 0:
        _begin(bank, state, _slot(0, now // base), now)


@inlined
def _slot(level, number):
    """Return the slot of onset ``number`` on the given level of the onset grid."""
    return number % PER_LEVEL if level == 0 else MORE * (1 + level) + number % MORE


@inlined
def _move(bank, row, to):
    """Move an onset and all its hypotheses from slot ``row`` to slot ``to``."""
    columns, q = bank.columns, len(bank.which)
    bank.onset[to] = bank.onset[row]
    bank.chi2_at[to], bank.used_at[to] = bank.chi2_at[row], bank.used_at[row]
    for i in range(q):
        c, d = row * q + i, to * q + i
        columns.J[d], columns.d[d] = columns.J[c], columns.d[c]
        for a in range(len(columns.D)):
            columns.D[a, d] = columns.D[a, c]
    for a in range(bank.kept.shape[1]):
        copy(bank.kept[to], a, bank.kept[row], a)


@inlined
def _begin(bank, state, row, now):
    """Start the hypotheses for jumps at sample ``now``, and store the current filter state."""
    columns, kept = bank.columns, bank.kept[row]
    m, q, p = len(state.P), len(bank.which), len(state.lower)
    bank.onset[row] = now
    bank.chi2_at[row], bank.used_at[row] = bank.now[0]["chi2"], bank.now[0]["used"]
    for i in range(q):
        c = row * q + i
        for a in range(m):
            columns.D[a, c] = 0.0
        columns.D[bank.which[i], c] = 1.0
        columns.J[c] = columns.d[c] = 0.0
    for a in range(m):
        copy(kept, a, state.P, a)
        kept[m, a] = state.theta[a] if a < p else state.X[a - p, 0]


@fused
def weigh(bank, now):
    """
    Store κ, and the jump size and weight of each hypothesis; return the log odds of a jump.

    The code computes the evidence directly as exp ℓ = exp(½ d ν̂/κ) prior/√(1 + J σ²/κ), because a
    square root is faster to compute than the logarithm in ℓ.
    """
    J, d, size, weight, b = bank.columns.J, bank.columns.d, bank.size, bank.weight, bank.now[0]
    precision, prior = bank.precision, bank.prior
    q, H, least = len(bank.which), len(weight), b["misfit"]
    for s in range(len(bank.onset)):
        usable = 0 <= bank.onset[s] != now
        wide = np.log(float(b["base"] << level_of(s)))
        for i in range(q):
            known = usable and bank.variance[i] > 0.0
            prior[s * q + i] = bank.log_prior[i] + wide if known else -np.inf
            precision[s * q + i] = 1.0 / bank.variance[i] if known else np.inf
    best, at = 0.0, -1
    for c in range(H):
        gain = d[c] * d[c] / (J[c] + precision[c])
        if gain > best:
            best, at = gain, c
    kappa = least
    if at >= 0:
        used = b["used"] - bank.used_at[at // q]
        left = b["chi2"] - bank.chi2_at[at // q] - best
        kappa = max(least, (left + FIRM * least) / (used + FIRM))
    b["kappa"] = kappa
    for c in range(H):
        size[c] = d[c] / (J[c] + kappa * precision[c])
    half = 0.5 / kappa
    highest = 0.0
    for c in range(H):
        weight[c] = half * d[c] * size[c] + prior[c]
        highest = max(highest, weight[c])
    for c in range(H):
        weight[c] = np.exp(weight[c] - highest)
    for c in range(H):
        weight[c] /= np.sqrt(1.0 + J[c] / (kappa * precision[c]))
    total = _total(weight)
    share = 1.0 / (total + np.exp(-highest))
    for c in range(H):
        weight[c] *= share
    return np.log(max(total, 1e-300)) + highest


@summed
def _total(a):
    """Return the sum of all elements of ``a``; the compiler may reorder the summands."""
    total = 0.0
    for c in range(len(a)):
        total += a[c]
    return total


@fused
def mean_of(bank, theta, lower, upper):
    """Store the mean of θ (p,) over all hypotheses, clipped to the parameter bounds."""
    mixed, columns = bank.mixed, bank.columns
    part = columns.moved[-1]  # no longer needed in this sample, so its memory is reused
    for c in range(len(part)):
        part[c] = bank.weight[c] * bank.size[c]
    for a in range(len(mixed)):
        mixed[a] = min(max(theta[a] + _sum(part, columns.D[a]), lower[a]), upper[a])


@summed
def _sum(a, b):
    """Return the scalar product of ``a`` and ``b``; the compiler may reorder the summands."""
    total = 0.0
    for c in range(len(a)):
        total += a[c] * b[c]
    return total
