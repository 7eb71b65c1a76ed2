"""Formulas as MathML, made with the site: no script, and no font from elsewhere.

MathML needs a font with mathematical tables, which many machines lack: STIX Two Math (Open Font
License, as `ziamath` brings it) is cut down to the signs that formulas use and put into the style.
"""

from __future__ import annotations

import base64
import io
import re
import string
from pathlib import Path
from typing import Any

import ziamath
from docutils import nodes
from fontTools import subset
from latex2mathml.converter import convert

TAG = re.compile(r"\\tag\{([^}]*)\}")
MATRIX = re.compile(r"(\\begin\{bmatrix\}.*?\\end\{bmatrix\})", re.DOTALL)
SIGNS = (
    string.printable.strip() + "√∑∏∫∂∞≈≤≥≠±−·…→←↦⇒′‖|⟨⟩∈×ˆ¯˙~̂̃̄̇"
    + "".join(map(chr, [*range(0x1D434, 0x1D468), 0x210E, *range(0x1D6E2, 0x1D71C)]))
    + "".join(map(chr, range(0x391, 0x3CA)))
)  # fmt: skip
STYLE = """/* The font: a part of STIX Two Math, SIL Open Font License 1.1, as said in it. */
@font-face {{ font-family: "Site Math"; src: url("data:font/woff;base64,{}"); }}
math {{ font-family: "Site Math", math; }}
"""


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx: formulas, and the style with their font."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.connect("build-finished", _write_style)
    app.add_css_file("math.css")
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def mathml(tex: str, *, display: bool) -> str:
    r"""Return a formula as MathML; `\tag{3, 4}` becomes a number at the right."""
    tag = TAG.search(tex)
    # In braces of its own, lest its brackets grow with the largest matrix of the line.
    plain = MATRIX.sub(r"{\1}", TAG.sub("", tex))
    found = convert(plain.strip(), display="block" if display else "inline")
    return found + (f'<span class="eqno">({tag[1]})</span>' if tag else "")


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(mathml(node.astext(), display=False))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    # Reached by the keyboard, for a wide formula scrolls.
    self.body.append('<div class="formula" tabindex="0">')
    self.body.append(f"{mathml(node.astext(), display=True)}</div>")
    raise nodes.SkipNode


def _write_style(app: Any, error: Exception | None) -> None:
    if error is None and app.builder.format == "html":
        text = STYLE.format(base64.b64encode(_font()).decode())
        (Path(app.outdir) / "_static" / "math.css").write_text(text, encoding="utf-8")


def _font() -> bytes:
    """Return the font with the signs of formulas only, and the larger ones that these grow to."""
    whole = Path(ziamath.__file__).with_name("fonts") / "STIXTwoMath-Regular.ttf"
    options = subset.Options(layout_features=["*"], flavor="woff", name_IDs=["*"])
    font = subset.load_font(str(whole), options)
    cutter = subset.Subsetter(options)
    cutter.populate(text=SIGNS)
    cutter.subset(font)
    with io.BytesIO() as file:
        subset.save_font(font, file, options)
        return file.getvalue()
