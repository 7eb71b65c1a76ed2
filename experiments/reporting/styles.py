"""How estimators are drawn: nine styles of colour, dash and marker, given out per page.

Any two of the nine colours differ by ΔE*76 ≥ 20, also for a deuteranope, and have a contrast of 3
or more with what they are drawn on (WCAG 2.1, 1.4.11), in the light and in the dark variant;
``tests/experiments/test_styles.py`` measures it. Chosen once by a random search near named hues.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from zlib import crc32

from flexaxis.estimators import RECOMMENDED
from flexaxis.estimators.registry import REGISTRY


@dataclass(frozen=True)
class Style:
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
    Style(0, "#136CD1", "#4C9BFF", "", "o"),  # blue
    Style(1, "#D45302", "#E17529", "7 2", "s"),  # vermilion
    Style(2, "#237548", "#1F905D", "3 2", "D"),  # green
    Style(3, "#759C42", "#CDDF51", "9 2 2 2", "^"),  # olive
    Style(4, "#0E9EBA", "#39D5FF", "11 3", "v"),  # cyan
    Style(5, "#8D0C5A", "#BF4087", "", "*"),  # wine
    Style(6, "#6E3F0F", "#A36D33", "5 2 1 2 1 2", "P"),  # brown
    Style(7, "#8F2B9D", "#DD8AC9", "2 1.5", "X"),  # purple
    Style(8, "#898A8A", "#B0A9A2", "6 4", "<"),  # grey
)

# What most figures show; it looks the same on every page. The reference is blue and unbroken.
LEADING = ("rpem-forgetting", "rpem-drift", "ekf", "imm", "cusum-reset", RECOMMENDED, "frozen")
_PLACES = dict(zip(LEADING, (0, 1, 2, 3, 4, 5, 8), strict=True)) | {
    "base": 0, "candidate": 1, "A": 0, "B": 1, "k_T": 0, "1/J_a": 1, "f_m": 2, "f_c": 3,
    "another": 8,
}  # fmt: skip

_SHAPES = {
    "o": "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0z",
    "s": "M-3.5,-3.5h7v7h-7z",
    "D": "M0,-5L5,0L0,5L-5,0z",
    "^": "M0,-4.8L4.6,3.6H-4.6z",
    "v": "M0,4.8L4.6,-3.6H-4.6z",
    "P": "M-1.6,-4.6h3.2v3h3v3.2h-3v3h-3.2v-3h-3v-3.2h3z",
    "X": "M-4.6,-2.6l2,-2L0,-2l2.6,-2.6l2,2L2,0l2.6,2.6l-2,2L0,2l-2.6,2.6l-2,-2L-2,0z",
    "*": "M0,-5.4L1.4,-1.7H5.2L2.2,0.7L3.3,4.5L0,2.3L-3.3,4.5L-2.2,0.7L-5.2,-1.7H-1.4z",
    "<": "M-4.8,0L3.6,4.6V-4.6z",
}  # fmt: skip


def assigned(names: Iterable[str]) -> dict[str, Style]:
    """Return the styles of the estimators of one page, in the order of the registry.

    The leading ones have theirs; the others have what is left, by rank. Beyond nine, colours come
    again with the next dash and marker, hollow. Options in brackets do not change a style where the
    estimator is on the page only once.

    Parameters
    ----------
    names : iterable of str
        As typed.

    Examples
    --------
    >>> [(name, style.light) for name, style in assigned(["mine.py:Mine", "ekf"]).items()]
    [('ekf', '#237548'), ('mine.py:Mine', '#136CD1')]
    """
    ordered = sorted(dict.fromkeys(names), key=_rank)
    taken: dict[str, Style] = {}
    for name in ordered:
        place = _PLACES.get(_plain(name))
        if place is not None and NINE[place] not in taken.values():
            taken[name] = NINE[place]
    free = iter([style for style in NINE if style not in taken.values()] + _more())
    return {name: taken.get(name) or next(free) for name in ordered}


def style(estimator: str) -> Style:
    """Return the style of an estimator in a figure that is on no page: the same in all of them."""
    base = _plain(estimator)
    if base in _PLACES:
        return NINE[_PLACES[base]]
    if base in REGISTRY:
        others = [name for name in sorted(REGISTRY, key=_rank) if name not in LEADING]
        return [*(n for n in NINE if n.place not in _PLACES.values()), *_more()][others.index(base)]
    return _more()[sum(estimator.encode()) % (len(NINE) * (len(NINE) - 1))]


def css_class(who: str) -> str:
    """Return the class of an estimator in a page: letters and digits, whatever its name is."""
    return f"w{crc32(who.encode()):08x}" if who else ""


def phase(who: str) -> float:
    """Return where along a line the first marker of an estimator stands: a share of their gap."""
    return (style(who).place * 7) % 9 / 9


def rules(found: dict[str, Style]) -> str:
    """Return what a style sheet says of the estimators of a page."""
    return "\n".join(
        f".{css_class(who)} {{ --c: var(--style-{each.place}); --d: {each.dash or 'none'}; }}"
        for who, each in found.items()
    )


def marks(found: dict[str, Style]) -> str:
    """Return the markers of the estimators of a page, and that of lines of nobody, for ``use``."""
    own = (
        f'<path id="mark-{css_class(who)}" d="{_SHAPES[each.marker]}" '
        f'class="shape {css_class(who)}{" hollow" if each.hollow else ""}"/>'
        for who, each in found.items()
    )
    return f'<path id="mark" class="shape hollow" d="{_SHAPES["o"]}"/>{"".join(own)}'


def _more() -> list[Style]:
    """Return styles after the nine: their colours with another's dash and marker, hollow."""
    count = len(NINE)
    pairs = [(NINE[i], NINE[(i + turn) % count]) for turn in range(1, count) for i in range(count)]
    return [Style(a.place, a.light, a.dark, b.dash, b.marker, hollow=True) for a, b in pairs]


def _plain(name: str) -> str:
    return name.partition("[")[0]


def _rank(name: str) -> tuple[float, str]:
    entry = REGISTRY.get(_plain(name))
    return (entry.rank if entry else 90.0), name
