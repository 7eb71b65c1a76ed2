"""Pages: figures as SVG inside one HTML file that needs no network; one template under all of them.

Text in a figure stays text. Colours are variables of the style sheet, so that a page is dark at
night; an estimator has a class of its own, by which the script hides it.
"""

import html
import io
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

import matplotlib as mpl
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from flexaxis.experiments.reporting import figures, tables
from flexaxis.experiments.reporting.figures import Looks
from flexaxis.experiments.reporting.styles import NINE, SETTINGS, VARIABLES

SIDES = ("base", "candidate")


def render(template: str, *, looks: Looks, **content: Any) -> str:
    """Return a page as HTML.

    Parameters
    ----------
    template : str
        Path in `flexaxis.experiments`, such as ``"reporting/templates/run.html"``. It extends
        ``reporting/templates/page.html``, which needs a `title`.
    looks : mapping of str to Style
        Of the estimators that the page can hide, as from `styles.assigned`.
    **content
        What the template names. Text is escaped; a name that is missing is an error.
    """
    return TEMPLATES.get_template(template).render(styles=NINE, looks=looks, **content)


def comparison(verdict: Mapping[str, Any]) -> str:
    """Return the page of a comparison: the verdict, changes with intervals, all scores.

    Parameters
    ----------
    verdict : mapping
        As `flexaxis compare --json` prints it.
    """
    drawings = [drawn(figures.verdict_intervals, "change of each score", verdict["rows"])]
    lines = [("", list(map(tables.Cell, row["text"]))) for row in verdict["rows"]]
    table = tables.Table("all scores", verdict["columns"], lines, verdict["legend"])
    return render("reporting/templates/compare.html", title=verdict["headline"], verdict=verdict,
                  looks={}, figures=drawings, table=table)  # fmt: skip


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
    buffer, name = io.StringIO(), slug(label)
    with mpl.rc_context(dict(SETTINGS) | {"svg.hashsalt": name}):  # no other figure has its ids
        figure = draw(*args, **options)
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->|<g id=[^>]*/>", "", text, flags=re.DOTALL)
    text = re.sub(r"""<g id=(?:"([^"]*)"|'([^']*)')>""", _opened, text)
    text = re.sub(r"<[^>]+>", lambda part: re.sub(r"(\.\d)\d+", r"\1", part[0]), text)
    text = re.sub("|".join(VARIABLES), lambda match: f"var(--{VARIABLES[match[0]]})", text)
    text = re.sub(r"\s*\n(?:L |\s*)", " ", text).replace("'DejaVu Sans'", "system-ui")
    head = f'<svg role="img" aria-label="{escape(label)}" '
    return Markup(head + re.sub(r"^.*?<svg .*?(?=viewBox=)", "", text, flags=re.DOTALL))


def _opened(group: re.Match[str]) -> str:
    """Return the opening of a group without id; of a tagged artist with its class and title."""
    text = html.unescape(group[1] or group[2])
    estimator, tip = json.loads(text) if text.startswith("[") else ("", "")
    title = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<g class="est-{slug(estimator)}">{title}' if estimator else f"<g>{title}"


def slug(text: str) -> str:
    """Return a text as an id of HTML; different texts have different ids."""
    plain = re.sub(r"\W+", "-", text).strip("-")
    return plain if plain == text else f"{plain}-{crc32(text.encode()):x}"


def symbols(text: str) -> Markup:
    """Return text with symbols as letter and index, such as f_m, and `code` as such.

    Examples
    --------
    >>> symbols("1/J_a < f_m")
    Markup('1/<i>J</i><sub>a</sub> &lt; <i>f</i><sub>m</sub>')
    """
    typeset = tables.SYMBOL.sub(r"<i>\1</i><sub>\2</sub>", str(escape(text)))
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", typeset))


TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parents[1]),
    autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined,
)  # fmt: skip
TEMPLATES.filters |= {"symbols": symbols, "slug": slug}
