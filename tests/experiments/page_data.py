"""What a page shows, read back from its text: tables, curves in values, what opens at a click."""

import base64
import json
import re
import zlib
from html import unescape

import numpy as np

UNITS = 10_000


def text_of(html):
    """The text of a page, with f_m for what is typeset."""
    plain = re.sub(r"<i>(.)</i><sub>(\w+)</sub>", r"\1_\2", html)
    return re.sub("<[^>]+>", "", plain)


def page_data(html):
    """The data of a page: everyone, aside, terms, and picks as HTML."""
    block = re.search(r'<script type="application/json" id="page-data">(.*?)</script>', html)[1]
    data = json.loads(block)
    data["picks"] = {
        name: zlib.decompress(base64.b64decode(text)).decode()
        for name, text in data["picks"].items()
    }
    return data


def charts_of(html):
    """The charts of a page by name, each a list of views with their panels and lines."""
    found = re.findall(r'<figure class="chart" id="([^"]*)"[^>]*>(.*?)</figure>', html, re.DOTALL)
    return {
        name: [_view(part) for part in _parts(body, '<div class="view"')] for name, body in found
    }


def lines(view, who):
    """The lines of an estimator in each panel of a view."""
    return [[line for line in panel["lines"] if line["who"] == who] for panel in view["panels"]]


def _parts(text, mark):
    return [mark + part for part in text.split(mark)[1:]]


def _data(text, *names):
    found = (re.search(rf' data-{name}="([^"]*)"', text) for name in names)
    return [unescape(hit[1]) if hit else "" for hit in found]


def _view(text):
    head = text[: text.index(">")]
    low, high, log = _data(head, "from", "to", "log")
    window = re.search(r'<p class="window">([^<]*)</p>', text)
    scale = float(low), float(high), bool(log)
    panels = [_panel(part, scale) for part in _parts(text, '<svg class="panel"')]
    return {"window": window[1] if window else "", "from": scale[0], "to": scale[1],
            "panels": panels, "text": text_of(text)}  # fmt: skip


def _panel(text, across):
    head = text[: text.index(">")]
    label, low, high, log = _data(head, "y", "from", "to", "log")
    up = float(low), float(high), bool(log)
    area = text[: text.index('<svg class="dots">')]
    own = [_line(part, across, up) for part in _parts(area, '<g class="line')]
    for band in re.findall(r'<path class="band[^>]*>', area):
        (who,), d = _data(band, "who"), re.search(r' d="([^"]*)"', band)[1]
        next(line for line in own if line["who"] == who)["band"] = d
    return {"y": label, "low": up[0], "high": up[1], "lines": own}


def _line(text, across, up):
    head = text[: text.index(">")]
    who, said, pick, points = _data(head, "who", "said", "pick", "points")
    found = {"who": who, "said": said, "pick": pick, "role": head.split()[2].strip('"')}
    if points:
        rows = [[float(v or "nan") for v in row.split(",")] for row in points.split(";")]
        return found | {
            "values": np.array(rows),
            "x": [r[0] for r in rows],
            "y": [r[1] for r in rows],
        }
    curve = re.search(r'<path class="curve" d="([^"]*)"', text)
    x, y = _walked(curve[1]) if curve else (np.empty(0), np.empty(0))
    return found | {"x": _value(x / UNITS, across), "y": _value(1 - y / UNITS, up)}


def _walked(d):
    """The points of a path, one after the other."""
    at, found = np.zeros(2), []
    for kind, pair in re.findall(r"([ML l])(-?\d+,-?\d+)", d):
        step = np.array(pair.split(","), float)
        at = at + step if kind == "l" else step
        found.append(at)
    return np.array(found).T


def _value(share, scale):
    low, high, log = scale
    return low * (high / low) ** share if log else low + (high - low) * share


def table(html, name):
    """Return heads and rows of a live table, cells as (value, text)."""
    body = re.search(rf'<table[^>]* data-name="{re.escape(name)}">(.*?)</table>', html, re.DOTALL)[
        1
    ]
    head = body.partition("<tbody>")[0].rpartition("<tr>")[2]
    heads = [_text(each) for each in re.findall(r"<th[^>]*>(.*?)</th>", head, re.DOTALL)]
    rows = re.findall(r"<tr[^>]*>(.*?)</tr>", body.partition("<tbody>")[2], re.DOTALL)
    return heads, [dict(zip(heads, _cells(row), strict=True)) for row in rows]


def _cells(row):
    found = re.findall(r"<td([^>]*)>(.*?)</td>", row, re.DOTALL)
    values = [re.search(r'data-value="([^"]*)"', attributes) for attributes, _ in found]
    return [
        (value[1] if value else None, _text(text))
        for value, (_, text) in zip(values, found, strict=True)
    ]


def _text(html):
    return " ".join(re.sub(r"<[^>]*>", "", html).split())
