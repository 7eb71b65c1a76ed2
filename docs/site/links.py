"""Follow every link of a built site, and see that nothing is loaded from another host."""

from __future__ import annotations

import re
import urllib.request
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

OTHER_HOST = re.compile(r"(?:https?:)?//[\w.-]+\.\w+")
# What a style or a script may fetch: url(…), @import, and addresses in quotes.
IN_STYLE = re.compile(r"""(?:url\(\s*["']?|@import\s+["'])((?:https?:)?//[^"')\s]+)""")
IN_SCRIPT = re.compile(r"""["'`]((?:https?:)?//[\w.-]+\.\w+[^"'`\s]*)""")
NAMES = ("http://www.w3.org/",)
"""Addresses that are names, and that nobody fetches."""
LOADS = {
    "script": ("src",),
    "img": ("src", "srcset"),
    "iframe": ("src",),
    "source": ("src", "srcset"),
    "video": ("src", "poster"),
    "audio": ("src",),
    "embed": ("src",),
    "object": ("data",),
    "link": ("href",),
}
SAID_ONLY = {"canonical", "author", "license", "search", "index", "next", "prev", "help"}
"""Relations of <link> that say something and load nothing."""


@dataclass
class Page(HTMLParser):
    """What a page has and wants: ids, links, what it loads, its own styles and scripts."""

    path: Path
    ids: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    code: list[tuple[str, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._inside = ""
        self.feed(self.path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag names, links to or loads."""
        found = {name: value or "" for name, value in attrs}
        self.ids |= {found[key] for key in ("id", "name") if key in found}
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        if not (tag == "link" and set(found.get("rel", "").split()) & SAID_ONLY):
            self.loads += [found[key] for key in LOADS.get(tag, ()) if key in found]
        if "style" in found:
            self.code.append(("style", found["style"]))
        self._inside = tag if tag in ("style", "script") else ""

    def handle_endtag(self, tag: str) -> None:
        """Leave a style or a script."""
        self._inside = ""

    def handle_data(self, data: str) -> None:
        """Keep styles and scripts."""
        if self._inside:
            self.code.append((self._inside, data))


def check(folder: Path, *, external: bool = False) -> list[str]:
    """Return what is wrong with a built site, a line each.

    Parameters
    ----------
    folder : Path
        Of the site; its pages are all ``*.html`` below.
    external : bool
        Whether to ask other hosts for what is linked there; needs a network.
    """
    pages = {path.resolve(): Page(path) for path in sorted(folder.rglob("*.html"))}
    faults = [f for page in pages.values() for f in _broken(page, pages, folder)]
    faults += [f for page in pages.values() for f in _loaded(page, folder)]
    faults += [f for path in sorted(folder.rglob("*.[cj]s*")) for f in _file_loads(path, folder)]
    faults += _not_found(folder)
    return faults + (_unanswered(pages) if external else [])


def hosts(folder: Path) -> dict[str, set[str]]:
    """Return what other hosts the pages link to: address to pages."""
    found: dict[str, set[str]] = {}
    for path in sorted(folder.rglob("*.html")):
        for link in Page(path).links:
            if OTHER_HOST.match(link):
                found.setdefault(link, set()).add(path.relative_to(folder).as_posix())
    return found


def _broken(page: Page, pages: dict[Path, Page], folder: Path) -> Iterator[str]:
    here = page.path.relative_to(folder)
    for link in [*page.links, *page.loads]:
        if urlsplit(link).scheme or link.startswith("//"):
            continue
        place, _, anchor = link.partition("#")
        place = unquote(place.partition("?")[0])
        target = (page.path.parent / place).resolve() if place else page.path.resolve()
        if target.is_dir():
            target /= "index.html"
        if not target.exists():
            yield f"{here}: {link} leads nowhere"
        elif anchor and target in pages and unquote(anchor) not in pages[target].ids:
            yield f"{here}: {link} has no such place on its page"


def _loaded(page: Page, folder: Path) -> Iterator[str]:
    here = page.path.relative_to(folder)
    for address in page.loads:
        if OTHER_HOST.match(address):
            yield f"{here}: loads {address} from another host"
    for kind, text in page.code:
        yield from _in_text(text, kind, str(here))


def _file_loads(path: Path, folder: Path) -> Iterator[str]:
    kind = {".css": "style", ".js": "script"}.get(path.suffix, "")
    if kind and path.name != "searchindex.js":  # words of the pages, addresses among them
        text = path.read_text(encoding="utf-8")
        yield from _in_text(text, kind, str(path.relative_to(folder)))


def _in_text(text: str, kind: str, here: str) -> Iterator[str]:
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)  # remarks may name who wrote it
    for address in (IN_STYLE if kind == "style" else IN_SCRIPT).findall(text):
        if not address.startswith(NAMES):
            yield f"{here}: may load {address} from another host"


def _not_found(folder: Path) -> list[str]:
    """Return whether search has its index, as a script, so that it works in a file."""
    index = folder / "searchindex.js"
    if not index.exists() or not index.read_text("utf-8").startswith("Search.setIndex("):
        return ["searchindex.js: there is no index, and search finds nothing"]
    return []


def _unanswered(pages: dict[Path, Page]) -> list[str]:
    links = {link for page in pages.values() for link in page.links if OTHER_HOST.match(link)}
    return [f"{link}: {fault}" for link in sorted(links) if (fault := _asked(link))]


@lru_cache
def _asked(address: str) -> str:
    """Return what is wrong with an address of another host, nothing if it answers."""
    asking = urllib.request.Request(address, headers={"User-Agent": "flexaxis link check"})
    try:
        with urllib.request.urlopen(asking, timeout=20):
            return ""
    except (OSError, ValueError) as error:
        return str(error)
