"""Pages: figures as SVG inside one HTML file that needs no network; one template under all of them.

Text in a figure stays text. Colours are variables of the style sheet, so that a page is dark at
night; an estimator has a class of its own, by which the script hides it.
"""

from __future__ import annotations

import html
import io
import json
import re
from collections.abc import Callable, Iterable
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from zlib import crc32

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from flexaxis.experiments.reporting import tables
from flexaxis.experiments.reporting.figures import PLAIN, Looks
from flexaxis.experiments.reporting.styles import NINE, SETTINGS, VARIABLES, assigned, look, styled

if TYPE_CHECKING:
    from jinja2 import Environment

_TAG = re.compile(r"""<g id=(?:"([^"]*)"|'([^']*)')>""")
_UNNAMED = re.compile(r' id="(?:[a-z]+_|[A-Z][A-Za-z]+_|xtick|ytick|legend|matplotlib)[\w.]*"')


def render(template: str, *, looks: Looks, **content: Any) -> str:
    """Return a page as HTML.

    Parameters
    ----------
    template : str
        Path in `flexaxis.experiments`, such as ``"reporting/templates/run.html"``. It extends
        ``reporting/templates/page.html``, which needs a `title`.
    looks : mapping of str to Style
        Of the estimators that the page can hide, from `looks_of`.
    **content
        What the template names. Text is escaped; a name that is missing is an error.
    """
    swatches = {name: _swatch(name, looks) for name in looks}
    page = environment().get_template(template)
    return page.render(styles=NINE, looks=looks, swatches=swatches, **content)


def looks_of(names: Iterable[str]) -> Looks:
    """Return the looks of the estimators of a page, in the order of their names."""
    unique = dict.fromkeys(names)
    looks = assigned(unique)
    return {name: looks[name] for name in unique}


def drawn(draw: Callable[..., Figure], label: str, *args: Any, **options: Any) -> Markup:
    """Return a figure as SVG for a page.

    Parameters
    ----------
    draw : callable
        A function of `figures`.
    label : str
        What the figure shows, for those who cannot see it; no other on the page has the same.
    *args, **options
        For `draw`.
    """
    return svg(draw(*args, **options), slug(label), f'role="img" aria-label="{escape(label)}"')


def svg(figure: Figure, name: str, attributes: str) -> Markup:
    """Return a figure as SVG; its ids begin with a name that no other figure has."""
    buffer = io.StringIO()
    with mpl.rc_context(SETTINGS):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<g id=[^>]*/>", "", text, flags=re.DOTALL)
    text = _UNNAMED.sub("", _TAG.sub(_opened, text))
    text = re.sub(r"<[^>]+>", _shorter, text)
    text = re.sub("|".join(VARIABLES), lambda match: f"var(--{VARIABLES[match[0]]})", text)
    text = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{name}-", text)
    text = (
        re.sub(r"\s*\n\s*", "\n", text).replace("'DejaVu Sans'", "system-ui").replace("xlink:", "")
    )
    return Markup(re.sub(r"^.*?<svg .*?(?=viewBox=)", f"<svg {attributes} ", text, flags=re.DOTALL))


def _shorter(element: re.Match[str]) -> str:
    """Return an element with hundredths of a point; a path has tenths, and lines without an L."""
    text = re.sub(r"(\.\d\d)\d+", r"\1", element[0])
    path = text.startswith("<path")
    return re.sub(r"\nL(?= )", "", re.sub(r"(\.\d)\d", r"\1", text)) if path else text


def _opened(match: re.Match[str]) -> str:
    """Return the opening of a group with its class and title, of an artist that has a tag."""
    text = html.unescape(match[1] or match[2])
    if not text.startswith("["):
        return match[0]
    estimator, tip = json.loads(text)
    title = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<g class="{css_class(estimator)}">{title}' if estimator else f"<g>{title}"


@styled
def _swatch(estimator: str, looks: Looks) -> Markup:
    """Return a piece of the line of an estimator with its marker."""
    figure = Figure(figsize=(32 / 96, 13 / 96), layout=PLAIN)
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, 1), ylim=(0, 1))
    ax.set_axis_off()
    ax.plot([0.02, 0.5, 0.98], [0.5] * 3, **look(estimator, looks) | {"markevery": [1]})
    name = f"swatch-{slug(estimator)}"
    return svg(figure, name, f'class="swatch" id="{name}" aria-hidden="true"')


def slug(text: str) -> str:
    """Return a text as it may stand in an id; two texts have different ones."""
    plain = re.sub(r"\W+", "-", text).strip("-")
    return plain if plain == text else f"{plain}-{crc32(text.encode()):x}"


def css_class(estimator: str) -> str:
    """Return the class of an estimator in a page."""
    return f"est-{slug(estimator)}"


def symbols(text: str) -> Markup:
    """Return text with symbols as letter and index, such as f_m, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < f_m")
    Markup('1/<i>J</i><sub>a</sub> &lt; <i>f</i><sub>m</sub>')
    """
    typeset = tables.SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", typeset))


@cache
def environment() -> Environment:
    """Return the environment of all templates."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    folder = files("flexaxis.experiments")
    loader = FunctionLoader(lambda name: (folder / name).read_text(encoding="utf-8"))
    environment = Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
        loader=loader,
    )
    environment.filters |= {"symbols": symbols, "slug": slug, "css_class": css_class}
    return environment
