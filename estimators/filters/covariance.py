"""
Covariances of ξ = [θ; x], compiled: over a sample, through a measurement, and mixed.

P is (m, w) for p parameters and n states, m = p + n, with w from `padded`; what pads a row is zero.
In a sample θ stays and x moves, ξ⁺ = F ξ with F = [I 0; G], so that its block θθ only gains W.
X (> n, ≥ 1+m) has G behind its first lane, rows of no account below it, and in its last row h, the
derivative of the output. What is symmetric is computed once and stays so to the last bit.
"""

import numpy as np

from flexaxis.estimators.models.compiler import Compiled, fused, remembered


def padded(m: int) -> int:
    """Return the length of the row of a covariance: whole registers of four."""
    return -4 * (-m // 4)


@fused
def look(X, P, Ph):
    """
    Write P h, and return hᵀPh.

    Parameters
    ----------
    X, P
        As above.
    Ph : (m,) array
    """
    m, spread = len(Ph), 0.0
    for a in range(m):
        Ph[a] = P[0, a] * X[-1, 1]
    for q in range(1, m):
        for a in range(m):
            Ph[a] += P[q, a] * X[-1, 1 + q]
    for a in range(m):
        spread += Ph[a] * X[-1, 1 + a]
    return spread


@fused
def carry(X, Ph, root, W, P, gain):  # noqa: PLR0917
    """
    Take P over a sample and through its measurement: P ← F P Fᵀ + W − k kᵀ, k = F P h·root.

    Parameters
    ----------
    X, Ph, P
        As for `look`.
    root : float
        1/√S of the innovation; 0 where there is no measurement.
    W : (p, p) array
        What the covariance of θ gains.
    gain : (m,) array
        k, written.
    """
    m, p = len(gain), len(W)
    G, GP = np.empty((m - p, m)), np.empty((m - p, m))
    for i in range(m - p):
        for b in range(m):
            G[i, b] = X[i, 1 + b]
            GP[i, b] = X[i, 1] * P[0, b]
        for q in range(1, m):  # whole rows at a time: their elements go side by side
            for b in range(m):
                GP[i, b] += X[i, 1 + q] * P[q, b]
        gain[p + i] = root * _dot(GP[i], X[-1, 1:])
    for a in range(p):
        gain[a] = root * Ph[a]
        for b in range(a + 1):
            P[a, b] = P[b, a] = P[a, b] + W[a, b] - gain[a] * gain[b]
    for i in range(m - p):
        a = p + i
        for b in range(p):
            P[a, b] = P[b, a] = GP[i, b] - gain[a] * gain[b]
        for j in range(i + 1):
            b = p + j
            P[a, b] = P[b, a] = _dot(GP[i], G[j]) - gain[a] * gain[b]


@fused
def _dot(a, b):
    """Return Σ a·b over the length of a."""
    total = 0.0
    for q in range(len(a)):
        total += a[q] * b[q]
    return total


@fused
def merge(share, P, other, apart):
    """
    P ← (1−s) P + s P' + s (1−s) d dᵀ, the covariance of a mixture of two.

    Parameters
    ----------
    share : float
        s, the weight of the other.
    P, other : (m, w) arrays
    apart : (m,) array
        d, the difference of their means.
    """
    rest = 1.0 - share
    root = np.sqrt(share * rest)
    for a in range(len(apart)):
        for b in range(len(apart)):
            mine = rest * P[a, b] + share * other[a, b]
            P[a, b] = mine + (root * apart[a]) * (root * apart[b])


PART = 4  # lanes that are written out


@remembered
def ahead(n: int, p: int) -> Compiled:
    """
    Return ``ahead(D, X, u)``, `inlined`: state, output and their sensitivities over a sample.

    Parameters
    ----------
    n, p : int
        States and parameters.

    Returns
    -------
    callable
        ``D`` (n+1, n+1, `padded` 1+p) is what a sample makes of each state and of the torque
        (columns) in states and output, each with its derivatives by θ behind it; ``X`` (n+1,
        `padded` 1+p+n) x and y, and behind each its derivatives by ξ = [θ; x]; ``u`` the torque.
    """
    few = padded(1 + p)
    lines = ["def ahead(D, X, u):", f" s{n} = u"]
    lines += [f" s{j} = X[{j}, 0]" for j in range(n)]
    lines += [f" d{i}_{j} = D[{i}, {j}, 0]" for i in range(n + 1) for j in range(n)]
    for first in range(0, few, PART):
        lines += _part(n, [str(first + k) for k in range(PART)], sloped=True, indent=1)
    lines += [f" for b in range({few}, {padded(1 + p + n)}, {PART}):"]
    lines += _part(n, [f"b + {k}" for k in range(PART)], sloped=False, indent=2)
    return Compiled("\n".join(lines), inline=True, fused=True)


def _part(n: int, lanes: list[str], *, sloped: bool, indent: int) -> list[str]:
    """Return lines that take some lanes of all rows; lane 0 is what the others are slopes of."""
    read, write = [], []
    for k, lane in enumerate(lanes):
        read += [f"v{j}_{k} = X[{j}, {lane}]" for j in range(n)]
        for i in range(n + 1):
            terms = [f"D[{i}, {j}, {lane}] * s{j}" for j in range(n + 1) if sloped]
            terms += [f"d{i}_{j} * v{j}_{k}" for j in range(n) if lane != "0"]
            write.append(f"t{i}_{k} = {' + '.join(terms)}")
    write += [f"X[{i}, {lane}] = t{i}_{k}" for i in range(n + 1) for k, lane in enumerate(lanes)]
    return [" " * indent + line for line in read + write]


@remembered
def gather(n: int, p: int) -> Compiled:
    """
    Return ``gather(X, residual, H, g)``, `inlined`: H ← H + φφᵀ, g ← g + φ·residual.

    Parameters
    ----------
    n, p : int
        States and parameters.

    Returns
    -------
    callable
        φ = ∂y/∂ξ is in the last row of ``X``, as for `ahead`; ``H`` is (m, ≥ m), ``g`` (≥ m,).
    """
    size = range(p + n)
    lines = ["def gather(X, residual, H, g):"]
    lines += [f" f{b} = X[{n}, {1 + b}]" for b in size]
    lines += [f" g[{b}] += f{b} * residual" for b in size]
    lines += [f" for a in range({p + n}):", f"  f = X[{n}, 1 + a]"]
    lines += [f"  H[a, {b}] += f * f{b}" for b in size]
    return Compiled("\n".join(lines), inline=True, fused=True)
