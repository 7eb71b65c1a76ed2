"""The matplotlib settings of all figures, and nine styles (colour, dash pattern and marker).

The colour difference ΔE*76 between any two of the nine colours is at least 20, even for readers
with deuteranopia. The contrast between each colour and the background is at least 3 in light and
dark mode (WCAG 2.1, 1.4.11). The colours were found by a random search near named hues. If you
change a colour, compute the colour differences and the contrast again.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from zlib import crc32

import matplotlib as mpl

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.reporting.tables import SYMBOL


@dataclass(frozen=True)
class Style:
    """The style of the curves and markers of one estimator.

    Attributes
    ----------
    place : int
        Index of the colour, from 0 to 8.
    light, dark : str
        Colours for a light background and for a dark background.
    dash : str
        Dash pattern with the lengths of strokes and gaps in pixels (1/96 inch), separated by
        blanks. An empty text means a solid line.
    marker : str
        Marker code of matplotlib.
    hollow : bool
        True if the markers have no fill colour, as for the tenth and all further estimators on a
        page.
    """

    place: int
    light: str
    dark: str
    dash: str
    marker: str
    hollow: bool = False


# Colours of text, lines and backgrounds. On a page they become variables with a dark variant.
TEXT, MUTED, LINE, SOFT, BACK = "#222222", "#5c6066", "#dfe2e6", "#f4f5f7", "#ffffff"
DARK_BACK, DARK_TEXT = "#16191d", "#e4e4e4"

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

STYLES = [
    replace(one, dash=NINE[i - turn].dash, marker=NINE[i - turn].marker, hollow=turn > 0)
    for turn in range(len(NINE))
    for i, one in enumerate(NINE)
]
"""The nine styles, followed by variants with other dash patterns and hollow markers."""

# Indices of the fixed styles of common estimators and parameters. The reference is a solid blue
# line.
_PLACES = {
    "rpem-forgetting": 0, "rpem-drift": 1, "ekf": 2, "imm": 3, "cusum-reset": 4, RECOMMENDED: 5,
    "frozen": 8, "base": 0, "candidate": 1, "A": 0, "B": 1, "k_T": 0, "1/J_a": 1, "f_m": 2,
    "f_c": 3, "another": 8,
}  # fmt: skip

VARIABLES = {TEXT: "text", MUTED: "muted", LINE: "line", SOFT: "soft", BACK: "back"}
VARIABLES |= {style.light.lower(): f"style-{style.place}" for style in NINE}
"""Style sheet variables that replace the colours of a figure, keyed by colour."""

SETTINGS = mpl.rc_params_from_file(
    Path(__file__).parent / "figures.mplstyle", use_default_template=False
)


styled = mpl.rc_context(SETTINGS)
"""Decorator that applies the matplotlib settings `SETTINGS` during a function call."""


def tag(artist: Any, estimator: str = "", tip: str = "") -> Any:
    """Add an estimator name and a hover text to a matplotlib artist, and return the artist."""
    artist.set_gid(json.dumps([estimator, tip]))
    return artist


def look(estimator: str, looks: Mapping[str, Style]) -> dict[str, Any]:
    """Return the style of an estimator as matplotlib options for a line with markers.

    Parameters
    ----------
    estimator : str
        Name of the estimator.
    looks : mapping of str to Style
        Styles that the function `assigned` has returned. For estimators that are not in `looks`,
        the function `style` determines the style.
    """
    own = looks.get(estimator) or style(estimator)
    # matplotlib multiplies the lengths by the line width of 1.5
    dash = tuple(float(part) / 1.5 for part in own.dash.split())
    return {
        "color": own.light,
        "ls": (0, dash or None),
        "marker": own.marker,
        "mfc": BACK if own.hollow else own.light,
        "ms": 8 if own.marker == "*" else 5,
    }


def symbols(text: str) -> str:
    """Convert symbols such as f_m in a text to the math notation of matplotlib.

    Examples
    --------
    >>> symbols("1/J_a / nominal")
    '1/$J_{a}$ / nominal'
    """
    return SYMBOL.sub(r"$\1_{\2}$", text)


def assigned(names: Iterable[str]) -> dict[str, Style]:
    """Assign styles to the estimators of a page, and return the styles in the order of `names`.

    Common estimators have fixed styles. The other estimators get the remaining styles in the given
    order. If an estimator appears only once on the page, its options do not affect the style.

    Parameters
    ----------
    names : iterable of str
        Names of the estimators, with options in brackets.

    Examples
    --------
    >>> [(name, style.light) for name, style in assigned(["mine.py:Mine", "ekf"]).items()]
    [('mine.py:Mine', '#136CD1'), ('ekf', '#237548')]
    """
    unique, free, taken = dict.fromkeys(names), dict(enumerate(STYLES)), {}
    for name in sorted(unique, key=lambda name: (_base(name) not in _PLACES, "[" in name)):
        place = _PLACES.get(_base(name))
        taken[name] = free.pop(place if place in free else min(free))
    return {name: taken[name] for name in unique}


def style(estimator: str) -> Style:
    """Return the style of an estimator in a figure that is not part of a report page."""
    others = range(len(NINE), len(STYLES))
    return STYLES[_PLACES.get(_base(estimator), others[crc32(estimator.encode()) % len(others)])]


def _base(name: str) -> str:
    return name.partition("[")[0]
