"""How estimators look: nine looks told apart by colour and dash and marker, given out per page.

Any two of the nine colours differ by ΔE*76 ≥ 20, also for a deuteranope (as simulated by Machado,
Oliveira and Fernandes, 2009, severity 1), and have a contrast of 3 or more with what they are drawn
on (WCAG 2.1, 1.4.11), in the light and in the dark variant. Chosen once by a random search that
stayed near the named hues; ``python -m flexaxis.experiments.reporting.looks`` prints the distances.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.registry import REGISTRY

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Look:
    """How an estimator is drawn.

    Attributes
    ----------
    place : int
        Which of the nine colours.
    light, dark : str
        The colour on a light and on a dark background.
    dash : str
        Lengths of strokes and gaps, in pixels of 1/96 inch; none is a full line.
    marker : str
        In matplotlib's letters.
    hollow : bool
        Whether the marker is an outline: beyond nine on a page.
    """

    place: int
    light: str
    dark: str
    dash: str
    marker: str
    hollow: bool = False


LIGHT_BACK, DARK_BACK = "#ffffff", "#16191d"
LIGHT_TEXT, DARK_TEXT = "#222222", "#e4e4e4"  # truth is drawn in these

NINE = (
    Look(0, "#136CD1", "#4C9BFF", "", "o"),  # blue
    Look(1, "#D45302", "#E17529", "7 2", "s"),  # vermilion
    Look(2, "#237548", "#1F905D", "3 2", "D"),  # green
    Look(3, "#759C42", "#CDDF51", "9 2 2 2", "^"),  # olive
    Look(4, "#0E9EBA", "#39D5FF", "11 3", "v"),  # cyan
    Look(5, "#8D0C5A", "#BF4087", "", "*"),  # wine
    Look(6, "#6E3F0F", "#A36D33", "5 2 1 2 1 2", "P"),  # brown
    Look(7, "#8F2B9D", "#DD8AC9", "2 1.5", "X"),  # purple
    Look(8, "#898A8A", "#B0A9A2", "6 4", "<"),  # grey
)

# Whom most figures show; they look the same on every page. The reference is blue and unbroken.
LEADING = (
    "rpem-forgetting",
    "rpem-drift",
    "ekf",
    "imm",
    "cusum-reset",
    "relocate",
    "imm-friction",
    "relocate-friction",
    "frozen",
)


def assigned(names: Iterable[str]) -> dict[str, Look]:
    """Return the looks of the estimators of one page, in the order of the registry.

    The leading ones have theirs; the others have what is left, by rank. Beyond nine, colours come
    again with the next dash and marker, hollow. Options in brackets do not change a look where the
    estimator is on the page only once.

    Parameters
    ----------
    names : iterable of str
        As typed.

    Examples
    --------
    >>> [(name, look.light) for name, look in assigned(["mine.py:Mine", "ekf"]).items()]
    [('ekf', '#237548'), ('mine.py:Mine', '#136CD1')]
    """
    ordered = sorted(dict.fromkeys(names), key=_rank)
    plain = [_plain(name) for name in ordered]
    taken: dict[str, Look] = {}
    for name, base in zip(ordered, plain, strict=True):
        look = NINE[LEADING.index(base)] if base in LEADING else None
        if look is not None and look not in taken.values():
            taken[name] = look
    free = iter([look for look in NINE if look not in taken.values()] + _more())
    found = {name: taken.get(name) or next(free) for name in ordered}
    return found


def look(estimator: str) -> Look:
    """Return the look of an estimator in a figure that is on no page: the same in all of them."""
    base = _plain(estimator)
    if base in LEADING:
        return NINE[LEADING.index(base)]
    if base in REGISTRY:
        others = [name for name in sorted(REGISTRY, key=_rank) if name not in LEADING]
        return _more()[others.index(base)]
    return _ROLES.get(estimator) or _more()[sum(estimator.encode()) % (len(NINE) * (len(NINE) - 1))]


_ROLES = {"base": NINE[0], "candidate": NINE[1]}


def _more() -> list[Look]:
    """Return looks after the nine: their colours with another's dash and marker, hollow."""
    count = len(NINE)
    pairs = [(NINE[i], NINE[(i + turn) % count]) for turn in range(1, count) for i in range(count)]
    return [Look(a.place, a.light, a.dark, b.dash, b.marker, hollow=True) for a, b in pairs]


def _plain(name: str) -> str:
    return name.partition("[")[0]


def _rank(name: str) -> tuple[float, str]:
    entry = REGISTRY.get(_plain(name))
    return (entry.rank if entry else 90.0), name


# D65 white, sRGB primaries (IEC 61966-2-1).
_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
# Machado, Oliveira and Fernandes (2009), table 1: deuteranopia, severity 1, on linear RGB.
_DEUTERANOPE = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)


def linear(colour: str) -> Array:
    """Return a colour such as ``"#0072B2"`` as linear RGB, 0 … 1."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def deuteranope(rgb: Array) -> Array:
    """Return linear RGB as a deuteranope sees it."""
    return np.clip(_DEUTERANOPE @ rgb, 0, 1)


def lab(rgb: Array) -> Array:
    """Return linear RGB as CIELAB 1976, for D65."""
    t = (_TO_XYZ @ rgb) / (_TO_XYZ @ np.ones(3))
    x, y, z = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def distances(colours: Sequence[str], *, as_deuteranope: bool = False) -> Array:
    """Return ΔE*76 between any two colours, shape (n, n)."""
    rgb = [linear(colour) for colour in colours]
    seen = np.array([lab(deuteranope(each) if as_deuteranope else each) for each in rgb])
    return np.linalg.norm(seen[:, None] - seen[None], axis=2)


def contrast(colour: str, back: str) -> float:
    """Return the contrast of two colours after WCAG 2.1: 1 for equal ones, 21 at most."""
    low, high = sorted(float(_TO_XYZ[1] @ linear(each)) for each in (colour, back))
    return (high + 0.05) / (low + 0.05)


def table() -> str:
    """Return the distances and contrasts as text, for a reader who wants to check."""
    lines = []
    for name, back in (("light", LIGHT_BACK), ("dark", DARK_BACK)):
        colours = [getattr(each, name) for each in NINE]
        normal, other = distances(colours), distances(colours, as_deuteranope=True)
        lines += ["", f"{name}, on {back}: ΔE*76, above the diagonal normal, below deuteranope"]
        lines += ["".join(f"{c:>9}" for c in ["", *colours, "contrast"])]
        mixed = np.triu(normal) + np.tril(other)
        for colour, row in zip(colours, mixed, strict=True):
            cells = [f"{v:9.1f}" if v else f"{'·':>9}" for v in row]
            lines += [f"{colour:>9}" + "".join(cells) + f"{contrast(colour, back):9.2f}"]
        above = np.triu_indices(len(NINE), 1)
        lines += [f"least: normal {normal[above].min():.1f}, deuteranope {other[above].min():.1f}"]
    return "\n".join(lines[1:])


if __name__ == "__main__":
    print(table())
