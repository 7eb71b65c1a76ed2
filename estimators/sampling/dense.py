"""A sampled model and its sensitivities over samples at one θ, in which only the torque differs."""

from flexaxis.estimators.sampling.compiler import Compiled, remembered
from flexaxis.estimators.sampling.symmetric import padded

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
