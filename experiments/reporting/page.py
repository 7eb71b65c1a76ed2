"""Pages: figures as SVG inside one HTML file that needs no network; one template under all of them.

Text in a figure stays text. Colours are variables of the style sheet, so that a page is dark at
night; an estimator has a class of its own, by which the script hides it.
"""

from __future__ import annotations

import html
import io
import json
import re
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from zlib import crc32

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from flexaxis.experiments.reporting.figures import NARROW, WIDE
from flexaxis.experiments.reporting.styles import (
    NINE,
    SETTINGS,
    VARIABLES,
    Style,
    assigned,
    look,
    styled,
)
from flexaxis.experiments.reporting.tables import SYMBOL, between, number, short

if TYPE_CHECKING:
    from jinja2 import Environment

_TAG = re.compile(r"""<g id=(?:"([^"]*)"|'([^']*)')>""")
_UNNAMED = re.compile(
    r' id="(?:figure|axes|patch|line2d|text|matplotlib|xtick|ytick|legend|QuadMesh|Poly|Line|Fill)'
    r'[\w.]*"'
)


def render(template: str, **content: Any) -> str:
    """Return a page as HTML.

    Parameters
    ----------
    template : str
        Path in `flexaxis.experiments`, such as ``"reporting/templates/run.html"``. It extends
        ``reporting/templates/page.html``, which needs a `title`, and `looks` of the estimators
        that the page can hide.
    **content
        What the template names. Text is escaped; a name that is missing is an error.
    """
    looks: Mapping[str, Style] = content.setdefault("looks", {})
    content["swatches"] = {name: swatch(name, looks) for name in looks}
    return environment().get_template(template).render(styles=NINE, **content)


def looks_of(names: Any) -> dict[str, Style]:
    """Return the looks of the estimators of a page, in the order of their names."""
    found = assigned(names)
    return {name: found[name] for name in dict.fromkeys(names)}


def drawn(draw: Callable[..., Figure], label: str, *args: Any, **options: Any) -> Markup:
    """Return a figure twice, for wide screens and for narrow ones: letters keep their size.

    Parameters
    ----------
    draw : callable
        A function of `figures` or `run_figures` with the keyword `width`.
    label : str
        What the figure shows, for those who cannot see it.
    *args, **options
        For `draw`.
    """
    sizes = (("wide", WIDE), ("narrow", NARROW))
    return Markup("").join(
        svg(draw(*args, width=width, **options), f"{slug(label)}-{kind}", label, kind)
        for kind, width in sizes
    )


def drawn_once(draw: Callable[..., Figure], label: str, *args: Any, **options: Any) -> Markup:
    """Return a figure once, small enough for every screen; several stand side by side."""
    return svg(draw(*args, width=430, **options), slug(label), label, "small")


def svg(figure: Figure, name: str, label: str = "", kind: str = "") -> Markup:
    """Return a figure as SVG for a page.

    Parameters
    ----------
    figure : Figure
    name : str
        Prefix of its ids, which no other figure of the page has.
    label : str
        What it shows; a figure without one is decoration.
    kind : str
        Class of the element.
    """
    buffer = io.StringIO()
    with mpl.rc_context(SETTINGS):
        metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
        figure.savefig(buffer, format="svg", transparent=True, metadata=metadata)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"(\.\d\d)\d+", r"\1", text)  # hundredths of a point
    text = re.sub("|".join(VARIABLES), lambda match: f"var(--{VARIABLES[match[0]]})", text)
    text = _UNNAMED.sub("", _TAG.sub(_opened, text))
    text = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{name}-", text)
    text = re.sub(r"\s*\n\s*", "\n", text).replace("'DejaVu Sans'", "system-ui")
    width = re.search(r'viewBox="0 0 ([\d.]+)', text)
    assert width is not None
    about = f'role="img" aria-label="{html.escape(label)}"' if label else 'aria-hidden="true"'
    # Points to pixels; a figure may grow by 15 %.
    head = f'<svg class="{kind}" {about} style="max-width:{float(width[1]) * 4 / 3 * 1.15:.0f}px" '
    return Markup(re.sub(r"^<svg .*?(?=viewBox=)", head, text, count=1, flags=re.DOTALL))


def _opened(match: re.Match[str]) -> str:
    """Return the opening of a group with its class and title, of an artist that has a tag."""
    text = html.unescape(match[1] or match[2])
    if not text.startswith("["):
        return match[0]
    estimator, tip = json.loads(text)
    title = f"<title>{html.escape(tip)}</title>" if tip else ""
    return f'<g class="{css_class(estimator)}">{title}' if estimator else f"<g>{title}"


@styled
def swatch(estimator: str, looks: Mapping[str, Style]) -> Markup:
    """Return a piece of the line of an estimator with its marker."""
    figure = Figure(figsize=(32 / 96, 13 / 96), layout="none")
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, 1), ylim=(0, 1))
    ax.set_axis_off()
    ax.plot([0.02, 0.5, 0.98], [0.5] * 3, **look(estimator, looks, markevery=[1]))
    return svg(figure, f"swatch-{slug(estimator)}", kind="swatch")


def slug(text: str) -> str:
    """Return a text as it may stand in an id."""
    return re.sub(r"\W+", "-", text).strip("-")


def css_class(estimator: str) -> str:
    """Return the class of an estimator in a page."""
    name = slug(estimator)
    return f"est-{name}" if name == estimator else f"est-{name}-{crc32(estimator.encode()):x}"


def symbols(text: str) -> Markup:
    """Return text with symbols as letter and index, such as f_m, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < f_m")
    Markup('1/<i>J</i><sub>a</sub> &lt; <i>f</i><sub>m</sub>')
    """
    typeset = SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", typeset))


def tone(value: float) -> str:
    """Return the style of a cell with a tone, 0 to 1; the colour-blind see the same order."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    letters = "#000" if value > 0.47 else "#fff"  # from there on black is easier to read
    return f"background:{to_hex(colormaps['cividis'](value))};color:{letters}"


@cache
def environment() -> Environment:
    """Return the environment of all templates."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def source(template: str) -> str:
        return (files("flexaxis.experiments") / template).read_text(encoding="utf-8")

    found = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        loader=FunctionLoader(source),
    )
    found.filters |= {"symbols": symbols, "slug": slug, "css_class": css_class, "tone": tone}
    found.filters |= {"number": number, "short": short, "between": between}
    return found
