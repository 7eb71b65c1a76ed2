"""Build the site of the documentation: `make site`, or `python docs/site/build.py`.

    python docs/site/build.py [-o FOLDER] [--external]

Pages are staged in build/site, and Sphinx builds them into FOLDER (results/site). A warning of
Sphinx, such as a reference that leads nowhere, or a page that no section has ends the build with
status 1. The build needs no network; `--external` lets Sphinx's linkcheck follow every address.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

import api
import gallery
import reference
import sources
from pages import ROOT, SECTIONS, labs, line_of, name_of, unplaced
from sphinx.cmd.build import main as sphinx
from staging import Staged

HERE, WORK = Path(__file__).parent, ROOT / "build" / "site"


def main() -> int:
    """Build, check, and say where it is."""
    args = options()
    began = time.monotonic()
    if args.output.exists() and not is_site(args.output):
        print(f"{args.output} is no site: name an empty folder, or one of a site", file=sys.stderr)
        return 2
    if lost := unplaced():
        print(f"no section of docs/site/pages.py has: {', '.join(lost)}", file=sys.stderr)
        return 1
    stage(WORK / "source")
    if status := run_sphinx("html", args.output):
        return status
    count = sum(1 for _ in args.output.rglob("*.html"))
    print(f"{count} pages in {time.monotonic() - began:.0f} s: {args.output / 'index.html'}")
    return run_sphinx("linkcheck", WORK / "linkcheck") if args.external else 0


def options() -> argparse.Namespace:
    """Return what is typed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results" / "site")
    parser.add_argument("--external", action="store_true", help="follow links to other hosts, too")
    return parser.parse_args()


def is_site(folder: Path) -> bool:
    """Return whether a folder may be replaced: it is empty, or Sphinx wrote it."""
    return folder.is_dir() and ((folder / ".buildinfo").exists() or not any(folder.iterdir()))


def stage(folder: Path) -> None:
    """Write all sources anew."""
    for each in folder.glob("*"):
        shutil.rmtree(each) if each.is_dir() else each.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    staged = Staged(folder)
    staged.fill()
    reference.write(folder)
    api.write(folder)
    gallery.write(folder)
    sources.write(folder, staged.shown)
    with (folder / "index.md").open("a", encoding="utf-8") as landing:
        landing.write("\n\n" + contents())
    with (folder / "labs" / "index.md").open("a", encoding="utf-8") as page:
        page.write("\n\n" + reference.toctree(f"/{name_of(lab)}" for lab in labs()))


def contents() -> str:
    """Return the navigation, which stands hidden on the first page."""
    trees = [reference.toctree(map(line_of, s.pages), caption=s.title, depth=2) for s in SECTIONS]
    return "\n\n".join(trees) + "\n"


def run_sphinx(builder: str, target: Path) -> int:
    """Run a builder of Sphinx on the staged sources; a warning is an error."""
    if target.exists():
        shutil.rmtree(target)
    words = ["-b", builder, "-c", str(HERE), "-d", str(WORK / "doctrees")]
    words += ["-W", "--keep-going", "-q", "-j", "2"]
    return int(sphinx([*words, str(WORK / "source"), str(target)]))


if __name__ == "__main__":
    raise SystemExit(main())
