"""Copy the pages of the repository to where Sphinx reads them, their links led to pages.

A link to a file of the repository that is no page, such as a module, leads to a page that shows it
(`sources.py`), so that the site is whole without a network and without the repository.
"""

from __future__ import annotations

import json
import posixpath
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from pages import ROOT, labs, written
from sources import page_of

LINK = re.compile(r"(?<!`)(!?)\[([^\]\[]*(?:\[[^\]]*\][^\]\[]*)*)\]\(([^()\s]+)\)")
CODE = re.compile(r"(```.*?```|`[^`\n]+`)", re.DOTALL)
PICTURES = (".png", ".gif", ".svg")


class Staged:
    """A folder of sources for Sphinx; `shown` has the files that are shown though no pages."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pages: Mapping[str, str] = written()
        self.shown: set[str] = set()

    def fill(self) -> None:
        """Write all pages that are files of the repository."""
        for path, name in self.pages.items():
            self._write(path, name)

    def _write(self, path: str, name: str) -> None:
        kind = Path(path).suffix
        target = self.folder / f"{name}{'.md' if kind == '.py' else kind}"
        target.parent.mkdir(parents=True, exist_ok=True)
        text = (ROOT / path).read_text(encoding="utf-8")
        if kind == ".ipynb":
            text = self._notebook(text, path)
        elif kind == ".py":
            text = lab_page(text, path)
        else:
            text = self.rewritten(text, path)
        target.write_text(text, encoding="utf-8")

    def _notebook(self, text: str, path: str) -> str:
        book = json.loads(text)
        for cell in book["cells"]:
            if cell["cell_type"] == "markdown":
                cell["source"] = self.rewritten("".join(cell["source"]), path)
        book["metadata"].setdefault("language_info", {})["pygments_lexer"] = "ipython3"
        return json.dumps(book)

    def rewritten(self, text: str, path: str) -> str:
        """Return Markdown of a file of the repository with its links as they are on the site."""
        parts = CODE.split(text)
        parts[::2] = [LINK.sub(self._link(path), part) for part in parts[::2]]
        return "".join(self._spans(parts, path))

    def _spans(self, parts: list[str], path: str) -> list[str]:
        """Links around code, `[`x`](y)`, are cut by CODE: their ends are led on here."""
        tail = re.compile(r"^([^\[\]`]*\]\()([^()\s]+)(\))")
        for place in range(2, len(parts), 2):
            parts[place] = tail.sub(
                lambda m: m[1] + self._target(m[2], path, picture=False) + m[3], parts[place]
            )
        return parts

    def _link(self, path: str) -> Callable[[re.Match[str]], str]:
        return lambda m: f"{m[1]}[{m[2]}]({self._target(m[3], path, picture=bool(m[1]))})"

    def _target(self, target: str, path: str, *, picture: bool) -> str:
        """Return where a link of a file leads to on the site."""
        if re.match(r"[a-z]+:", target) or target.startswith("#"):
            return target
        place, _, anchor = target.partition("#")
        file = posixpath.normpath(posixpath.join(posixpath.dirname(path), place))
        if not (ROOT / file).exists():
            raise FileNotFoundError(f"{path}: its link to {target} leads nowhere")
        if picture or Path(file).suffix in PICTURES:
            found = self._picture(file)
        else:
            found = self._page(file)
        here = posixpath.dirname(self.pages.get(path, page_of(path)))
        return posixpath.relpath(found, here or ".") + (f"#{anchor}" if anchor else "")

    def _picture(self, file: str) -> str:
        target = self.folder / "images" / Path(file).name
        target.parent.mkdir(exist_ok=True)
        shutil.copyfile(ROOT / file, target)
        return f"images/{target.name}"

    def _page(self, file: str) -> str:
        if file == "docs":
            return "index.md"
        if file in self.pages:
            return self.pages[file] + (".ipynb" if file.endswith(".ipynb") else ".md")
        self.shown.add(file)
        return f"{page_of(file)}.md"


def lab_page(text: str, path: str) -> str:
    """Return a lab as a page: a heading a cell, its first remarks as prose, its code as code."""
    head, *cells = re.split(r"^# %% ?", text, flags=re.MULTILINE)
    title = head.strip().strip('"').rstrip(".")
    said = f"# {title}\n\nRun it whole with `python {path}`, or cell by cell in an editor."
    return "\n\n".join([said, *map(_cell, cells)]) + f"\n\n{_neighbours(path)}\n"


def _cell(text: str) -> str:
    title, _, rest = text.partition("\n")
    lines = rest.splitlines()
    first = next((i for i, line in enumerate(lines) if not line.startswith("#")), len(lines))
    prose = "\n".join(line.removeprefix("#").removeprefix(" ") for line in lines[:first])
    code = "\n".join(lines[first:]).strip("\n")
    return f"## {title}\n\n{prose}\n\n" + (f"```python\n{code}\n```" if code else "")


def _neighbours(path: str) -> str:
    known = labs()
    place = known.index(path)
    near = [p for p in (place - 1, place + 1) if 0 <= p < len(known)]
    links = [f"[Lab {p + 1}]({Path(known[p]).stem}.md)" for p in near]
    return f"All labs, and answers: [Eight labs](index.md). Beside this one: {', '.join(links)}."
