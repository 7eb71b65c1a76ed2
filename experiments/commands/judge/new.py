"""Write a template of an own estimator that works and can be changed.

In Python a class; in C or GNU Octave a program that answers over a pipe, by the end of FILE: .py,
.c or .m (docs/pipes.md has the protocol, for any other language).

example:
  flexaxis new my_estimator.py
  flexaxis check my_estimator.py:Mine
  cp my_estimator.py old.py   # before a change
  flexaxis compare --base old.py:Mine --candidate my_estimator.py:Mine fm_step-v1
  flexaxis new my_estimator.c
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands.answers import answer
from flexaxis.experiments.files import write_text
from flexaxis.sim.errors import FlexaxisError

HELP = "write a working template of an own estimator"
CLASS = "Mine"
TEMPLATES = {
    ".py": ("my_estimator.py",),
    ".c": ("my_estimator.c", "flexaxis.h"),
    ".m": ("my_estimator.m",),
}
"""What is written, by the end of its name: the first under the name that is given."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("path", type=Path, metavar="FILE.py|c|m")


def main(args: argparse.Namespace) -> int:
    """Write the template and say what comes next."""
    from importlib.resources import files

    _check(args.path)
    home = files("flexaxis.experiments.check") / "templates"
    written: list[Path] = []
    for source in TEMPLATES[args.path.suffix]:
        path = args.path if not written else args.path.with_name(source)
        text = (home / source).read_text(encoding="utf-8")
        if not path.exists():  # an include file may be there from the last one
            write_text(path, text.replace("my_estimator", args.path.stem))
        written.append(path)
    lines = _next(args.path)
    words = f"{args.path} estimates the motor friction f_m. Change it, then:"
    shown = (f"  {line}" for line in lines)
    return answer(args, {"files": written, "next": lines}, 0, words, *shown)


def _check(path: Path) -> None:
    """Refuse a name that no template is for, and one that is taken."""
    if path.suffix not in TEMPLATES or not path.stem.isidentifier():
        raise FlexaxisError(
            f"{path}: give a file that Python can import, such as my_estimator.py, or one in C or "
            "Octave, such as my_estimator.c or my_estimator.m"
        )
    if not path.parent.is_dir():
        raise FlexaxisError(f"{path}: there is no folder {path.parent}: make it first")
    if path.exists():
        raise FlexaxisError(f"{path} is there already; give another name")


def _next(path: Path) -> list[str]:
    """Return the lines to be typed next: a check, and the last version compared with this one.

    Both versions estimate the same parameters, so that the comparison is fair.
    """
    old = path.with_name(f"old{path.suffix}")
    build = f"cc -O2 -o {path.with_suffix('')} {path} -lm"
    if path.suffix == ".c":
        path, old = path.with_suffix(""), old.with_suffix("")
    check = f"flexaxis check {_text(path)}"
    compare = f"flexaxis compare --base {_text(old)} --candidate {_text(path)} fm_step-v1"
    return [*([build] if not path.suffix else []), check, f"cp {path} {old}", compare]


def _text(path: Path) -> str:
    """Return an estimator as for `--estimator`."""
    if path.suffix == ".m":
        return f"'pipe:octave-cli -q {path}'"
    return (
        f"{path}:{CLASS}" if path.suffix else f"pipe:{path if path.is_absolute() else f'./{path}'}"
    )
