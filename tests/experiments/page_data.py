"""What a page was given to draw, read back from its text as its own code does."""

import base64
import json
import re
import struct
import zlib

import numpy as np


def page_data(html):
    """Return the block of data of a page, arrays as NumPy arrays."""
    text = re.search(r'<script type="text/plain" id="page-data">([^<]*)</script>', html)[1]
    block = zlib.decompress(base64.b64decode(text))
    (size,) = struct.unpack("<I", block[:4])
    return _plain(json.loads(block[4 : 4 + size]), block[4 + size :])


def _plain(value, heap):
    if isinstance(value, dict):
        if list(value) == ["array"]:
            return _array(heap, *value["array"])
        return {name: _plain(each, heap) for name, each in value.items()}
    return [_plain(each, heap) for each in value] if isinstance(value, list) else value


def _array(heap, *described):
    kind, offset, length, low, step = described
    if kind == "even":
        return low + step * np.arange(length)
    width = {"i2": 2, "f4": 4}[kind]
    raw = np.frombuffer(heap[offset : offset + width * length], np.uint8)
    raw = np.ascontiguousarray(raw.reshape(width, length).T).reshape(-1)
    if kind == "f4":
        return raw.view("<f4").astype(float)
    level = np.cumsum(raw.view("<i2"), dtype=np.int64).astype(np.int16)
    return np.where(level == -32768, np.nan, low + step * level.astype(float))


def lines(chart, who):
    """Return the lines of an estimator in each panel of a chart."""
    return [[x for x in panel["lines"] if x.get("who") == who] for panel in chart["panels"]]


def table(html, name):
    """Return heads and rows of a live table, cells as (value, text)."""
    body = re.search(rf'<table[^>]* data-name="{re.escape(name)}">(.*?)</table>', html, re.DOTALL)[
        1
    ]
    head = body.partition("<tbody>")[0].rpartition("<tr>")[2]  # groups of columns stand above
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
