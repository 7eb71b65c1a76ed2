"""Create report pages with SVG figures; each page is one HTML file and needs no network connection.

All pages extend one template. Readers can select the text in a figure. The style sheet defines the
colours as variables, and has a dark mode. The curves of each estimator have a CSS class, so that
the page script can hide the curves.
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
    """Fill a template, and return the page as HTML.

    Parameters
    ----------
    template : str
        Path of a template in `flexaxis.experiments`, such as ``"reporting/templates/run.html"``.
        Each template extends ``reporting/templates/page.html``, which requires a `title`.
    looks : mapping of str to Style
        Styles, as returned by `styles.assigned`, of all estimators that readers can hide on the
        page.
    **content
        Values of the template variables. Special HTML characters in text values are escaped. If a
        template variable is missing, the function raises an error.
    """
    return TEMPLATES.get_template(template).render(styles=NINE, looks=looks, **content)


def comparison(verdict: Mapping[str, Any]) -> str:
    """Return the HTML page of a comparison, with the verdict and the changes in all scores.

    Parameters
    ----------
    verdict : mapping
        JSON object that `flexaxis compare --json` prints.
    """
    drawings = [drawn(figures.verdict_intervals, "change of each score", verdict["rows"])]
    lines = [("", list(map(tables.Cell, row["text"]))) for row in verdict["rows"]]
    table = tables.Table("all scores", verdict["columns"], lines, verdict["legend"])
    return render("reporting/templates/compare.html", title=verdict["headline"], verdict=verdict,
                  looks={}, figures=drawings, table=table)  # fmt: skip


def drawn(draw: Callable[..., Figure], label: str, *args: Any, **options: Any) -> Markup:
    """Draw a figure, and return the figure as SVG for a page.

    Parameters
    ----------
    draw : callable
        Function that draws the figure, such as a function of the module `figures`.
    label : str
        Description of the figure for screen readers. Each label must be unique on the page.
    *args, **options
        Arguments of the function `draw`.
    """
    buffer, name = io.StringIO(), slug(label)
    with mpl.rc_context(dict(SETTINGS) | {"svg.hashsalt": name}):  # unique ids
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
    """Replace the id that `styles.tag` gave an SVG group with a CSS class and a title."""
    text = html.unescape(group[1] or group[2])
    estimator, tip = json.loads(text) if text.startswith("[") else ("", "")
    title = f"<title>{escape(tip)}</title>" if tip else ""
    return f'<g class="est-{slug(estimator)}">{title}' if estimator else f"<g>{title}"


def slug(text: str) -> str:
    """Return a unique HTML id for a text."""
    plain = re.sub(r"\W+", "-", text).strip("-")
    return plain if plain == text else f"{plain}-{crc32(text.encode()):x}"


def symbols(text: str) -> Markup:
    """Convert a text to HTML, and format `code` and the subscripts of symbols such as f_m.

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
