"""Symbols such as ``f_m`` in text: letter and index, in HTML and in SVG."""

from __future__ import annotations

import re

from markupsafe import Markup, escape

# A letter with an index that is no part of a longer word; as in assets/dom.js.
SYMBOL = re.compile(r"(?<![\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9θ]{1,3})(?![A-Za-z0-9_-])")
_CODE = re.compile(r"`([^`]+)`")
_SUNK = '<tspan font-style="italic">{}</tspan><tspan class="sub" dy="0.28em">{}</tspan>'
_RISEN = '<tspan dy="-0.21em">{}</tspan>'


def symbols(text: str) -> Markup:
    """Return text with its symbols as letter and index, such as f_m, 1/J_a, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < pause_fm")
    Markup('1/<i>J</i><sub>a</sub> &lt; pause_fm')
    """
    typeset = SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(_CODE.sub(r"<code>\1</code>", typeset))


def in_svg(text: str) -> Markup:
    """Return text for SVG with its symbols as letter and index.

    Examples
    --------
    >>> in_svg("lag [s]")
    Markup('lag [s]')
    """
    before, *parts = SYMBOL.split(text)
    found = [escape(before)]
    for letter, index, after in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        found.append(Markup(_SUNK).format(letter, index))
        found.append(Markup(_RISEN).format(after) if after else Markup())
    return Markup().join(found)
