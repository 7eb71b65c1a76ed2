"""What a page says, for tests: its text with plain symbols, and the data of its charts."""

import base64
import json
import re
import struct
import zlib


def text_of(html):
    """The text of a page, with f_m for what is typeset."""
    plain = re.sub(r"<i>(.)</i><sub>(\w+)</sub>", r"\1_\2", html)
    return re.sub("<[^>]+>", "", plain)


def charts_of(html):
    """The charts of a page by name, as the page's code sees them; arrays stay packed."""
    block = re.search(r'id="page-data">([^<]+)<', html)[1]
    raw = zlib.decompress(base64.b64decode(block))
    (length,) = struct.unpack("<I", raw[:4])
    return json.loads(raw[4 : 4 + length])["charts"]
