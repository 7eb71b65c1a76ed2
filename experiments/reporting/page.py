"""Every page is made here: one environment of templates, one base page, one style sheet.

A page extends `reporting/templates/page.html`; a template is named by its path in `experiments`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from html import unescape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from flexaxis.experiments.reporting import looks, script
from flexaxis.experiments.reporting.cells import number, pair, settled
from flexaxis.experiments.reporting.charts import Chart, ChartError, Heat, Panel, Picks
from flexaxis.experiments.reporting.glossary import TERMS
from flexaxis.experiments.reporting.packing import packed

if TYPE_CHECKING:
    from jinja2 import Environment

DATA = "<!-- the data of this page -->"  # what is escaped cannot read so
# A letter with an index that is no part of a longer word; as in assets/dom.js.
CODE = re.compile(r"`([^`]+)`")
SYMBOL = re.compile(r"(?<![\w-])([A-Za-zΔθσψεμλτ])_([A-Za-z0-9]{1,3})(?![\w-])")


class Charted(dict[str, Any]):
    """A chart as a template sees it: `id`, `title`, `words`, and `html`, the place it is drawn."""

    def __init__(self, chart: Chart | Heat) -> None:
        place = chart.name or _slug(chart.title)
        html = Markup('<figure class="chart" id="{}"></figure>').format(place)
        super().__init__(id=place, title=chart.title, words=chart.words, html=html)
        self.chart = chart


def render(template: str, content: Mapping[str, Any]) -> str:
    """Return a page as HTML: one file, readable without a network, that asks for nothing.

    Parameters
    ----------
    template : str
        Such as ``"reporting/templates/run.html"``.
    content : mapping of str to object
        What the template names; whatever text is in it is escaped. A name that is missing is an
        error. Charts as `charted` returns them, and `Picks`, are found in it wherever they stand
        and put into the page's block of data. What stands under ``glossary``, by term, is shown by
        hover where something has that ``data-term``; estimators under ``aside`` are hidden first.

    Raises
    ------
    LookupError
        If something that the template names is missing.
    """
    from jinja2 import UndefinedError

    code = script.source()
    frame = {
        "script": Markup(code),
        "policy": script.policy(code),
        "data": DATA,
        "looks": looks.NINE,
    }
    try:
        text = _environment().get_template(template).render({**content, **frame})
    except UndefinedError as error:  # a key that a table from a file has not
        raise LookupError(str(error)) from error
    return text.replace(DATA, packed(_data(text, content)), 1)


def charted(charts: Iterable[Chart | Heat]) -> list[Charted]:
    """Return charts as a template takes them: `id`, `title`, `words`, and `html` to put inside."""
    return [Charted(chart) for chart in charts]


def symbols(text: str) -> Markup:
    """Return text with its symbols as letter and index, such as f_m, 1/J_a, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < pause_fm")
    Markup('1/<i>J</i><sub>a</sub> &lt; pause_fm')
    """
    typeset = SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(CODE.sub(r"<code>\1</code>", typeset))


def term(text: str, name: str = "") -> Markup:
    """Return a word with what it means behind it, by the glossary; `name` where it reads so."""
    known = name or text
    if known not in TERMS:
        raise ChartError(f"no term {known!r} in the glossary: give one of {', '.join(TERMS)}")
    return Markup('<dfn data-term="{}">{}</dfn>').format(known, text)


def look(estimator: str) -> Markup:
    """Return the place where the page draws how an estimator looks."""
    return Markup('<span class="look" data-look="{}"></span>').format(estimator)


def _data(text: str, content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page's code works on: charts, picks, looks, terms."""
    charts: dict[str, Chart | Heat] = {}
    picks: dict[str, Any] = {}
    for each in _within(content):
        if isinstance(each, Picks):
            picks |= each.found
        elif each["id"] not in charts:
            charts[each["id"]] = each.chart
        elif charts[each["id"]] is not each.chart:
            raise ChartError(f"two charts of a page are named {each['id']!r}: give one a `name`")
    drawn = [*charts.values(), *(chart for pick in picks.values() for chart in pick.charts)]
    return {
        "charts": charts,
        "picks": picks,
        "aside": list(content.get("aside", ())),
        "looks": looks.assigned([*_named(text), *_lines_of(drawn)]),
        "terms": {
            name: words
            for name, words in {**TERMS, **content.get("glossary", {})}.items()
            if f'data-term="{escape(name)}"' in text
        },
    }


def _within(content: Any) -> Iterator[Any]:
    """Yield every chart and every set of picks in what a page is given."""
    if isinstance(content, Charted | Picks):
        yield content
    elif isinstance(content, Mapping):
        for value in content.values():
            yield from _within(value)
    elif isinstance(content, list | tuple):
        for value in content:
            yield from _within(value)


def _named(text: str) -> list[str]:
    """Return the estimators that parts of the page are marked with."""
    return [unescape(name) for name in re.findall(r' data-(?:who|look)="([^"]*)"', text) if name]


def _lines_of(charts: Iterable[Chart | Heat]) -> Iterator[str]:
    for chart in charts:
        for panel in chart.panels:
            parts = panel.lines if isinstance(panel, Panel) else [panel]
            yield from (part.who for part in parts if part.who)


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "chart"


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    found = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        loader=FunctionLoader(_source),
    )
    found.filters |= {"number": number, "pair": pair, "settled": settled}
    found.filters |= {"symbols": symbols, "term": term, "look": look}
    return found


def _source(template: str) -> str:
    return (files("flexaxis.experiments") / template).read_text(encoding="utf-8")
