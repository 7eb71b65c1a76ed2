"""How the charts of logs and demo name and mark estimators in HTML and SVG."""

from __future__ import annotations

from zlib import crc32

from flexaxis.experiments.reporting.styles import Style, style

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
