"""The gallery: every script of docs/gallery is run, and its figure shown above its code.

A script is a docstring, whose first line is the title, and code that leaves one figure open.
"""

from __future__ import annotations

import ast
import contextlib
import html
import io
import re
import runpy
import warnings
from dataclasses import dataclass
from pathlib import Path

from pages import ROOT

HERE = ROOT / "docs" / "gallery"
ORDER = (
    "signals",
    "fault",
    "tradeoff",
    "bench",
    "several",
    "study",
    "friction",
    "spectrum",
    "windup",
    "own",
    "verdict",
    "loop",
)
DPI = 110


@dataclass(frozen=True)
class Example:
    """A script: its name, title, words and code."""

    name: str
    title: str
    words: str
    code: str


def examples() -> list[Example]:
    """Return all scripts in their order; one without a place stands last."""
    paths = sorted(HERE.glob("*.py"), key=lambda p: (_place(p.stem), p.stem))
    return [_example(path) for path in paths]


def _place(name: str) -> int:
    return ORDER.index(name) if name in ORDER else len(ORDER)


def _example(path: Path) -> Example:
    text = path.read_text(encoding="utf-8")
    title, _, words = (ast.get_docstring(ast.parse(text)) or path.stem).partition("\n\n")
    code = re.sub(r'\A""".*?"""\s*', "", text, flags=re.DOTALL)
    return Example(path.stem, title.rstrip("."), words, code)


def write(folder: Path) -> None:
    """Run all scripts, and write page and figures into a folder of sources."""
    pictures = folder / "gallery"
    pictures.mkdir(exist_ok=True)
    known = examples()
    for each in known:
        draw(each, pictures / f"gallery-{each.name}.png")
    (folder / "gallery.md").write_text(page(known), encoding="utf-8")


def draw(example: Example, target: Path) -> None:
    """Run a script and save its figure.

    Raises
    ------
    RuntimeError
        If it leaves no figure, or more than one.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot

    pyplot.close("all")
    with warnings.catch_warnings(), contextlib.redirect_stderr(io.StringIO()):
        warnings.simplefilter("ignore")  # what a reader would see once in a terminal
        runpy.run_path(str(HERE / f"{example.name}.py"))
    if len(pyplot.get_fignums()) != 1:
        count = len(pyplot.get_fignums())
        raise RuntimeError(f"docs/gallery/{example.name}.py leaves {count} figures, not one")
    pyplot.gcf().savefig(target, dpi=DPI, bbox_inches="tight")
    pyplot.close("all")


def page(known: list[Example]) -> str:
    """Return the page: small pictures that lead to large ones, each with its code."""
    small = "\n".join(_small(each) for each in known)
    parts = [
        "# Gallery",
        "Figures, each with all of the code that makes it; they are drawn anew whenever this site "
        "is built.",
        f'<div class="gallery">\n{small}\n</div>',
        *map(_section, known),
    ]
    return "\n\n".join(parts) + "\n"


def _small(each: Example) -> str:
    title = html.escape(_plain(each.title))
    image = f'<img src="_images/gallery-{each.name}.png" alt="" loading="lazy">'
    return f'<a href="#{each.name}"><figure>{image}<figcaption>{title}</figcaption></figure></a>'


def _section(each: Example) -> str:
    image = f"![{_plain(each.title)}](gallery/gallery-{each.name}.png)"
    code = f"```python\n{each.code.rstrip()}\n```"
    return f"({each.name})=\n## {each.title}\n\n{each.words}\n\n{image}\n\n{code}"


def _plain(text: str) -> str:
    return re.sub(r"[`$]", "", text)
