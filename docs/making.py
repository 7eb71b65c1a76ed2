"""What the scripts share that write the tables of the documentation.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`. The line below it names the
command that made it, and the version of flexaxis.
"""

import re
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[1]
MARK = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)
VERSION = f"flexaxis {version('flexaxis')}"


def write(page: Path, tables: Mapping[str, Callable[[], str]], words: Sequence[str] = ()) -> None:
    """Write the tables of a page that the command line names, or all of them."""
    if wrong := set(words) - set(tables):
        sys.exit(f"no table {min(wrong)!r}: {', '.join(tables)}")
    for name, _ in MARK.findall(page.read_text(encoding="utf-8")):
        if name in (words or tables):
            whole = f"<!-- table: {name} -->\n{tables[name]()}<!-- end -->"
            text = page.read_text(encoding="utf-8")
            text = MARK.sub(lambda m, n=name, w=whole: w if m[1] == n else m[0], text)
            page.write_text(text, encoding="utf-8")
            print(f"{page.relative_to(ROOT)}: {name}", flush=True)


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(_cell(c) for c in line)} |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
