"""Every page is made here: one environment of templates, one base, one style sheet, one script.

A page extends `reporting/charts_old/templates/page.html`; a template is named by its path in
`experiments`.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import zlib
from collections.abc import Callable, Mapping
from functools import cache
from html import unescape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from flexaxis.experiments.reporting import styles
from flexaxis.experiments.reporting.charts_old import marks
from flexaxis.experiments.reporting.charts_old.charts import ChartError, Pick
from flexaxis.experiments.reporting.charts_old.drawing import drawn, swatch
from flexaxis.experiments.reporting.charts_old.tables import (
    TERMS,
    number,
    pair,
    symbols,
    tone_style,
)

if TYPE_CHECKING:
    from jinja2 import Environment

# What is escaped cannot read so: known only when the whole page is there.
DATA, RULES, MARKS = "<!-- data -->", "/* the estimators of this page */", "<!-- marks -->"
SCRIPT = ("dom", "state", "chart", "read", "table", "save", "pick", "bar", "start")
"""The parts of `assets/`, in order: each uses those before it, and `start` sets all up."""


def render(template: str, content: Mapping[str, Any]) -> str:
    """Return a page as HTML: one file, readable without a network, that asks for nothing.

    Parameters
    ----------
    template : str
        Such as ``"reporting/charts_old/templates/run.html"``.
    content : mapping of str to object
        What the template names; whatever text is in it is escaped. A name that is missing is an
        error. The filter ``drawn`` draws a chart. What stands under ``picks``, as from `packed`,
        opens by a click on what names it; what stands under ``glossary``, by term, is shown by
        hover where something has that ``data-term``; estimators under ``aside`` are hidden in
        charts at first.

    Raises
    ------
    LookupError
        If something that the template names is missing.
    ChartError
        If two charts of the page have the same name.
    """
    from jinja2 import UndefinedError

    code = source()
    frame = {"script": Markup(code), "policy": policy(code), "data": DATA, "styles": styles.NINE}
    try:
        text = _environment().get_template(template).render({**content, **frame})
    except UndefinedError as error:  # a key that a table from a file has not
        raise LookupError(str(error)) from error
    return _completed(text, content)


def _completed(text: str, content: Mapping[str, Any]) -> str:
    """Return a page with what is known only of all of it: who is drawn how, and the data."""
    places = re.findall(r'<figure class="chart" id="([^"]*)"', text)
    for place in places:
        if places.count(place) > 1:
            raise ChartError(f"two charts of a page are named {place!r}: give one a `name`")
    names = re.findall(r' data-(?:who|toggle)="([^"]+)"', text)
    found = styles.assigned(unescape(name) for name in names)
    aside = [name for name in content.get("aside", ()) if name in found]
    rules = marks.rules(found) + "".join(
        f"\nhtml:not(.scripted) svg .{marks.css_class(name)} {{ display: none; }}" for name in aside
    )
    terms = {**TERMS, **content.get("glossary", {})}
    data = {
        "picks": content.get("picks", {}),
        "aside": aside,
        "everyone": list(found),
        "terms": {n: w for n, w in terms.items() if f'data-term="{escape(n)}"' in text},
    }
    block = json.dumps(data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
    for place, what in ((RULES, rules), (MARKS, marks.marks(found)), (DATA, block)):
        text = text.replace(place, what, 1)
    return text


def packed(pick: Pick) -> str:
    """Return what opens at a click as HTML, deflated, in base64: the script unpacks it then."""
    html = _environment().get_template("reporting/charts_old/templates/pick.html").render(
        pick=pick, charts=[(c, drawn(c, f"pick-{i}")) for i, c in enumerate(pick.charts)]
    )  # fmt: skip
    return base64.b64encode(zlib.compress(html.encode(), 7)).decode()


def macros(template: str) -> Any:
    """Return the macros of a template, as functions that give HTML."""
    return _environment().get_template(template).module


def term(text: str, name: str = "") -> Markup:
    """Return a word with what it means behind it, by the glossary; `name` where it reads so."""
    known = name or text
    if known not in TERMS:
        raise ChartError(f"no term {known!r} in the glossary: give one of {', '.join(TERMS)}")
    return Markup('<dfn data-term="{}">{}</dfn>').format(known, text)


def source(changed: Callable[[str], str] = lambda text: text) -> str:
    """Return the script of a page.

    Parameters
    ----------
    changed : callable, optional
        What is to be done to the text, for a test that wants a feature dead.
    """
    folder = files("flexaxis.experiments.reporting.charts_old") / "assets"
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPT]
    return "(() => {\n" + '"use strict";\n' + changed("\n".join(parts)) + "\n})();"


def policy(script: str) -> str:
    """Return the Content-Security-Policy of a page with this script: it may ask for nothing.

    Styles stand in the page, pictures are data, no other script runs than this one.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return (
        "default-src 'none'; base-uri 'none'; form-action 'none'; "
        f"img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
    )


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    found = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        loader=FunctionLoader(_source),
    )
    found.filters |= {
        "number": number,
        "pair": pair,
        "symbols": symbols,
        "term": term,
        "tone_style": tone_style,
        "look": swatch,
        "drawn": drawn,
    }
    return found


def _source(template: str) -> str:
    return (files("flexaxis.experiments") / template).read_text(encoding="utf-8")
