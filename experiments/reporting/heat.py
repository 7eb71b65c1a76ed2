"""Maps of cells as tables with coloured cells: there without a script, and read by any reader."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from markupsafe import escape

from flexaxis.experiments.reporting.charts import Heat
from flexaxis.experiments.reporting.scales import Scale
from flexaxis.experiments.reporting.typeset import symbols

# After cividis (Nuñez, Anderton and Renslow, 2018): reads the same to the colour-blind.
STOPS = np.array([[0, 34, 78], [61, 78, 107], [124, 123, 120], [187, 173, 108], [254, 232, 56]])


def maps(heat: Heat) -> Iterator[str]:
    """Yield each map as a table with coloured cells."""
    scale = _tones(heat)
    heads = "".join(f'<th scope="col">{symbols(_name(x))}</th>' for x in heat.xs)
    for cells in heat.panels:
        rows = list(zip(heat.ys, np.asarray(cells.values), strict=True))[::-1]
        body = "".join(
            f'<tr><th scope="row">{symbols(_name(y))}</th>'
            f"{''.join(_cell(float(v), scale, heat.unit) for v in row)}</tr>"
            for y, row in rows
        )
        yield (
            f'<div class="view heat" data-who="{escape(cells.who)}" tabindex="0">'
            '<table class="heat">'
            f"<caption>{escape(cells.title or cells.who)}</caption><tbody>{body}</tbody><tfoot><tr>"
            f"<th>{symbols(f'{heat.y} ↑, {heat.x} →')}</th>{heads}</tr></tfoot></table></div>"
        )


def _name(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"


def _tones(heat: Heat) -> Scale:
    values = np.concatenate([np.ravel(cells.values) for cells in heat.panels] or [np.empty(0)])
    known = values[np.isfinite(values) & ((values > 0) | (not heat.log))]
    ends = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    return Scale(*ends, heat.log and known.size > 0)


def _cell(value: float, scale: Scale, unit: str) -> str:
    if not np.isfinite(value):
        return "<td></td>"
    share = float(np.clip(scale.share(value), 0, 1))
    return (
        f'<td class="{"dark" if share > 0.47 else "light"}" style="background:{_colour(share)}" '
        f'data-value="{value:.6g}" title="{value:.4g} {escape(unit)}">{value:.2g}</td>'
    )


def _colour(share: float) -> str:
    at = np.linspace(0, 1, len(STOPS))
    red, green, blue = (round(float(np.interp(share, at, column))) for column in STOPS.T)
    return f"rgb({red} {green} {blue})"


def legend(heat: Heat) -> str:
    """Return the scale of colours, with its ends."""
    scale, shades = _tones(heat), ", ".join(_colour(i / 8) for i in range(9))
    bar = f'<i class="shades" style="background:linear-gradient(90deg, {shades})"></i>'
    ends = f"{scale.low:.3g}", f"{scale.high:.3g}"
    unit = escape(heat.unit)
    return f'<span class="role">{ends[0]} {bar} {ends[1]} {unit}</span>'
