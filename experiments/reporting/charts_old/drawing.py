"""Charts as HTML and SVG: there as soon as the page is, at any width, without a script.

A panel is an ``svg`` as wide as its place. In it lies a second one of `UNITS` × `UNITS`, stretched
over the first though its strokes are not, with bands and lines; markers, ticks and words stand at
per cent of the width beside it. What reads a chart (`assets/chart.js`) has its values from there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from flexaxis.experiments.reporting.charts_old import marks
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line
from flexaxis.experiments.reporting.charts_old.scales import Scale, across, upward
from flexaxis.experiments.reporting.charts_old.shapes import UNITS, path, places, runs, units
from flexaxis.experiments.reporting.charts_old.tables import in_svg, symbols

Array = NDArray[np.float64]

HIGH = {True: 300, False: 165}  # pixels of a panel: of one that is alone, of one of several
MANY = 150  # points from which on markers would be a blot, and are dots
SPARSE = 4  # markers along a line: they tell it from others where colours do not
WORD = 1.35  # per cent of a narrow view that a letter takes
ORDER = ("data", "estimate", "bound", "truth")  # truth and bounds are seen upon estimates


def drawn(chart: Chart, place: str = "", *, high: int | None = None) -> Markup:
    """Return a chart as a figure.

    Parameters
    ----------
    chart : Chart
    place : str
        Its name in the page; by default its own, or its title's.
    high : int, optional
        Pixels of a panel; by default as many as pages give it.
    """
    views = "".join(_view(chart, name, x, high) for name, x in across(chart))
    place = place or chart.name or re.sub(r"[^a-z0-9]+", "-", chart.title.lower()).strip("-")
    return Markup(
        f'<figure class="chart" id="{escape(place)}" data-title="{escape(chart.title)}" '
        f'data-x="{escape(chart.x)}"><div class="views">{views}</div>'
        '<div class="legend" role="group" aria-label="Curves: press to hide everywhere">'
        f"{_legend(chart)}</div></figure>"
    )


def swatch(who: str, *, kind: str = "line", role: str = "") -> Markup:
    """Return a short piece of a line with its marker, for legends and tables."""
    line = "" if kind == "points" and not who else '<path d="M1,6H29"/>'
    marked = who or kind in {"points", "both"}
    mark = f'<use href="#{_marker(who)}" x="15" y="6"/>' if marked else ""
    css = f"swatch line {role} {marks.css_class(who)}"
    return Markup(f'<svg class="{css}" viewBox="0 0 30 12" aria-hidden="true">{line}{mark}</svg>')


def _marker(who: str) -> str:
    return f"mark-{marks.css_class(who)}" if who else "mark"


def _legend(chart: Chart) -> str:
    """Return a button an estimator, which hides it in the whole page; the rest is words."""
    found: dict[str, str] = {}
    for line in (line for panel in chart.panels for line in panel.lines):
        named = line.label if line.role != "estimate" and line.label else line.who or line.label
        if not named or named in found:
            continue
        piece = swatch(line.who, kind=line.kind, role=_role(chart, line))
        if named == line.who:
            said = line.who if line.pick and line.kind == "points" else line.label or line.who
            found[named] = (
                '<button type="button" class="who" aria-pressed="true" '
                f'data-toggle="{escape(line.who)}">{piece}<span>{symbols(said)}</span></button>'
            )
        else:
            found[named] = f'<span class="role">{piece}<span>{symbols(named)}</span></span>'
    return "".join(found.values())


def _role(chart: Chart, line: Line) -> str:
    """Return the class of a line: the bounds of a chart are numbered, to look different."""
    if line.role != "bound":
        return str(line.role)
    bounds = [n.label for p in chart.panels for n in p.lines if n.role == "bound"]
    return f"bound bound-{list(dict.fromkeys(bounds)).index(line.label) % 3}"


def _view(chart: Chart, name: str, x: Scale, high: int | None) -> str:
    high = high or HIGH[len(chart.panels) == 1]
    panels = "".join(_panel(chart, i, x, high) for i in range(len(chart.panels)))
    said = f'<p class="window">{escape(name)}</p>' if name else ""
    lines = [line for panel in chart.panels for line in panel.lines]
    about = (
        f"{chart.title}: {', '.join(p.y for p in chart.panels)} over {chart.x}, curves "
        f"{', '.join(filter(None, dict.fromkeys(n.label or n.who or n.role for n in lines)))}"
        f"{f', {name}' if name else ''}. The same values stand in the tables and can be saved."
    )
    origin = f' data-origin="{escape(x.origin)}"' if x.origin else ""
    return (
        f'<div class="view" role="group" aria-label="{escape(about)}" {_ends(x)}{origin}>{said}'
        f"{panels}</div>"
    )


def _ends(scale: Scale) -> str:
    log = ' data-log="yes"' if scale.log else ""
    return f'data-from="{scale.low:.7g}" data-to="{scale.high:.7g}"{log}'


def _panel(chart: Chart, place: int, x: Scale, high: int) -> str:
    panel, last = chart.panels[place], place == len(chart.panels) - 1
    y = upward(panel, x)
    lines = sorted(panel.lines, key=lambda line: ORDER.index(line.role))
    roles = [_role(chart, line) for line in lines]
    inner = [_grid(x, y, high), *_around(chart, x), *(_band(n, x, y) for n in lines)]
    inner += [_line(n, x, y, role) for n, role in zip(lines, roles, strict=True)]
    markers = [_markers(n, x, y, role) for n, role in zip(lines, roles, strict=True)]
    words = _text(panel.title, 'y="-7" class="panel-title"') if panel.title else ""
    if place == 0 and not panel.title:
        words = "".join(_remarks(chart, x))
    if last:
        words += _text(chart.x, f'x="50%" y="{high + 34}" class="label"')
    return (
        f'<svg class="panel" height="{high}" data-y="{escape(panel.y)}" {_ends(y)}>'
        f'<svg class="area" viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none">'
        f"{''.join(inner)}</svg>{_ticks(x, y, high, written=last)}"
        f'<path class="axis" d="M0,0V{high}"/>'
        f'<line class="axis" x2="100%" y1="{high}" y2="{high}"/>'
        f'<text class="label" transform="translate(-49,{high // 2}) rotate(-90)">{in_svg(panel.y)}'
        f'</text><svg class="dots">{"".join(markers)}</svg>{words}</svg>'
    )


def _grid(x: Scale, y: Scale, high: int) -> str:
    across = "".join(f"M0,{UNITS * (1 - p):.0f}H{UNITS}" for p, _ in y.marks(high))
    up = "".join(f"M{UNITS * p:.0f},0V{UNITS}" for p, _ in x.marks())
    return f'<path class="grid" d="{across}"/><path class="grid x" d="{up}"/>'


def _ticks(x: Scale, y: Scale, high: int, *, written: bool) -> str:
    """Return what stands at the ticks of y, and in the last panel at those of x."""
    up = [f'<text y="{100 - 100 * p:.1f}%">{escape(text)}</text>' for p, text in y.marks(high)]
    below = [f'<text x="{100 * p:.1f}%">{escape(text)}</text>' for p, text in x.marks()]
    found = f'<g class="up" transform="translate(-6)">{"".join(up)}</g>'
    if written:
        found += f'<g class="below" transform="translate(0,{high + 16})">{"".join(below)}</g>'
    return found


def _text(text: str, attributes: str) -> str:
    return f"<text {attributes}>{in_svg(text)}</text>"


def _around(chart: Chart, x: Scale) -> Iterator[str]:
    """Yield what is shaded, and the lines where something happens."""
    for begin, end, _ in chart.spans:
        a, b = units(x.share(np.clip([begin, end], x.low, x.high)))
        if b > a:
            yield f'<rect class="span" x="{a}" width="{b - a}" height="{UNITS}"/>'
    there = [at for at, _ in chart.marks if x.low <= at <= x.high]
    if there:
        d = "".join(f"M{place},0V{UNITS}" for place in units(x.share(there)))
        yield f'<path class="mark" d="{d}"/>'


def _remarks(chart: Chart, x: Scale) -> Iterator[str]:
    """Yield in words what happens where, above the first panel: no two upon each other."""
    spans = [(max(a, x.low), words) for a, b, words in chart.spans if b >= x.low]
    free = 0.0
    for at, words in sorted([*spans, *chart.marks]):
        if not words or not x.low <= at <= x.high:
            continue
        wide = WORD * len(words)
        place = min(max(100 * float(x.share(at)), free), max(100 - wide, 0.0))
        if place >= free - 0.01:
            yield _text(words, f'x="{place:.1f}%" y="-6" class="remark"')
            free = place + wide + 1


def _band(line: Line, x: Scale, y: Scale) -> str:
    if line.low is None or line.high is None or line.kind in {"points", "both"}:
        return ""
    a, low = places(line, line.low, x, y)
    _, high = places(line, line.high, x, y)
    parts = [
        f"{path(a[run], high[run])}{path(a[run][::-1], low[run][::-1]).replace('M', 'L', 1)}Z"
        for run in runs(a, low, high)
    ]
    css = marks.css_class(line.who)
    return f'<path class="band {css}" data-who="{escape(line.who)}" d="{"".join(parts)}"/>'


def _line(line: Line, x: Scale, y: Scale, role: str) -> str:
    inside = ""
    if line.kind != "points":
        a, b = places(line, line.y, x, y)
        d = "".join(path(a[r], b[r], steps=line.kind == "steps") for r in runs(a, b))
        inside = f'<path class="curve" d="{d}"/>' if d else ""
    if line.kind not in {"points", "both"}:
        return _group(line, role, inside)
    inside += _whiskers(line, x, y)
    if len(line.x) > MANY:
        spots = np.stack([UNITS * x.share(line.x), UNITS * (1 - y.share(line.y))], axis=1)
        there = np.rint(spots[np.isfinite(spots).all(axis=1)]).astype(int).tolist()
        inside += f'<path class="many" d="{"".join(f"M{a},{b}h0" for a, b in there)}"/>'
    return _group(line, role, inside, f' data-points="{_values(line)}"')


def _group(line: Line, role: str, inside: str, more: str = "") -> str:
    said = escape(line.label or line.who or line.role)
    pick = f' data-pick="{escape(line.pick)}"' if line.pick else ""
    return (
        f'<g class="line {role} {marks.css_class(line.who)}" data-who="{escape(line.who)}" '
        f'data-said="{said}"{pick}{more}>{inside}</g>'
    )


def _values(line: Line) -> str:
    """Return the values of points, for who reads them: x, y, and the ends of both."""
    sides = (line.x, line.y, line.low, line.high, line.x_low, line.x_high)
    columns = [np.full(len(line.x), np.nan) if side is None else side for side in sides]
    rows = np.stack(columns, axis=1).tolist()
    return ";".join(",".join("" if np.isnan(v) else f"{v:.6g}" for v in row) for row in rows)


def _whiskers(line: Line, x: Scale, y: Scale) -> str:
    a, b = UNITS * x.share(line.x), UNITS * (1 - y.share(line.y))
    ends = []
    if line.low is not None and line.high is not None:
        ends.append([a, UNITS * (1 - y.share(line.low)), a, UNITS * (1 - y.share(line.high))])
    if line.x_low is not None and line.x_high is not None:
        ends.append([UNITS * x.share(line.x_low), b, UNITS * x.share(line.x_high), b])
    rows = np.concatenate([np.stack(each, axis=1) for each in ends] or [np.empty((0, 4))])
    rows = np.rint(np.clip(rows[np.isfinite(rows).all(axis=1)], -9e4, 1e5)).astype(int)
    d = "".join(f"M{p},{q}L{r},{s}" for p, q, r, s in rows.tolist())
    faint = " faint" if len(line.x) > MANY else ""
    return f'<path class="whisker{faint}" d="{d}"/>' if d else ""


def _markers(line: Line, x: Scale, y: Scale, role: str) -> str:
    """Return the markers of points, or a few along a line of an estimator."""
    a, b = x.share(line.x), y.share(line.y)
    there = np.isfinite(a) & np.isfinite(b)
    if line.kind not in {"points", "both"}:
        if not line.who or there.sum() < 2 or line.kind == "steps" or line.role == "bound":
            return ""
        at = (np.arange(SPARSE) + marks.phase(line.who)) / SPARSE
        at = at[(at >= a[there].min()) & (at <= a[there].max())]
        a, b = at, np.interp(at, a[there], b[there])
    elif len(line.x) > MANY:
        return ""
    there = np.isfinite(a) & np.isfinite(b) & (a >= -1e-9) & (a <= 1 + 1e-9)
    href = _marker(line.who)
    uses = [
        f'<use href="#{href}" x="{100 * p:.2f}%" y="{100 - 100 * q:.2f}%"/>'
        for p, q in zip(a[there].tolist(), b[there].tolist(), strict=True)
    ]
    return _group(line, role, "".join(uses)) if uses else ""
