"""A chain of masses as a model, whatever their number."""

from collections.abc import Mapping, Sequence

from flexaxis.estimators.models.model import Model


def chain(
    name: str,
    masses: Sequence[str],
    springs: Mapping[str, str],
    nominal: Mapping[str, float],
    *,
    ratio: bool = False,
) -> Model:
    """
    Return masses with a spring from each to the next, of which the first may be a gear's.

    Parameters
    ----------
    name : str
    masses : sequence of str
        Their initials are those of the parameters J and f.
    springs : mapping of str to str
        Of each spring what its twist is called, and what ends the names of its k and d.
    nominal : mapping
    ratio : bool
        Whether the motor turns the first spring by r times its angle.
    """
    n, m, r = len(masses), [each[0] for each in masses], "r*" if ratio else ""
    ends = [*springs.values()]
    A = [["0"] * (2 * n - 1) for _ in range(2 * n - 1)]
    for i, end in enumerate(ends):  # between mass i and the next, whose speeds are these columns
        left, right, by = n - 1 + i, n + i, r if i == 0 else ""
        A[i][left], A[i][right] = by.rstrip("*") or "1", "-1"
        A[left][i], A[left][right] = f"-{by}k{end}/J_{m[i]}", f"{by}d{end}/J_{m[i]}"
        A[right][i], A[right][left] = f"k{end}/J_{m[i + 1]}", f"{by}d{end}/J_{m[i + 1]}"
    for i, mass in enumerate(m):
        d = [f"r^2*d{end}" if r and i == k == 0 else f"d{end}" for k, end in enumerate(ends)]
        d, f = d[max(i - 1, 0) : i + 1], f"f_{mass}"
        A[n - 1 + i][n - 1 + i] = f"-({' + '.join([f, *d] if d[1:] else [*d, f])})/J_{mass}"
    at_motor = ["0"] * (2 * n - 1)
    at_motor[n - 1] = "1"
    twists = [f"twist_{each}" if len(springs) > 1 else "twist" for each in springs]
    return Model(
        name=name,
        states=(*twists, *(f"speed_{each}" for each in masses)),
        A=tuple(map(tuple, A)),
        B=tuple("k_T/J_m" if each == "1" else each for each in at_motor),
        C=tuple(at_motor),
        nominal=dict(nominal),
        positive=(*(f"J_{mass}" for mass in m), *(f"k{end}" for end in ends)),
        nonnegative=(*(f"d{end}" for end in ends), *(f"f_{mass}" for mass in m)),
        nonzero=("k_T", "r") if ratio else ("k_T",),
        fixed=("r",) if ratio else (),
    )
