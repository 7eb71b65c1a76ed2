"""Every page is made here: one environment of templates, one base page, one style sheet.

A page extends `reporting/templates/page.html`; a template is named by its path in `experiments`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from flexaxis.experiments.reporting.cells import number, pair, settled, shade

if TYPE_CHECKING:
    from jinja2 import Environment
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Shown:
    """A figure as it stands in a page: under a title, with what there is to know of it below.

    The pages of runs and of studies each go through a list of functions that yield such.
    """

    title: str
    words: str
    figure: Figure


def render(template: str, content: Mapping[str, Any]) -> str:
    """Return a page as HTML: one file, readable without a network.

    Parameters
    ----------
    template : str
        Such as ``"reporting/templates/run.html"``.
    content : mapping of str to object
        What the template names; whatever text is in it is escaped. A name that is missing is an
        error.
    """
    return _environment().get_template(template).render(content)


def shown(figures: Iterable[Shown]) -> list[dict[str, str]]:
    """Return figures as a template takes them: `title`, `words`, and `svg` to put inside."""
    from flexaxis.experiments.reporting.figures import svg

    return [{"title": f.title, "words": f.words, "svg": svg(f.figure)} for f in figures]


@cache
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    found = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        loader=FunctionLoader(_source),
    )
    found.filters |= {"number": number, "pair": pair, "settled": settled, "shade": shade}
    return found


def _source(template: str) -> str:
    return (files("flexaxis.experiments") / template).read_text(encoding="utf-8")
