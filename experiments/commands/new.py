"""Write a template of an own estimator that works and can be changed.

example:
  flexaxis new my_estimator.py
  flexaxis check my_estimator.py:Mine
  flexaxis compare --base relocate --candidate my_estimator.py:Mine --match-std fm_step-v1
"""

from __future__ import annotations

import argparse
from pathlib import Path

HELP = "write a working template of an own estimator"
GROUP = "judge"
CLASS = "Mine"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("path", type=Path, metavar="FILE.py")


def main(args: argparse.Namespace) -> int:
    """Write the template and say what comes next."""
    from importlib.resources import files

    from flexaxis.experiments.running.files import write_text
    from flexaxis.sim.errors import FlexaxisError

    path = args.path
    if path.suffix != ".py" or not path.stem.isidentifier():
        raise FlexaxisError(f"{path}: give a file that Python can import, such as my_estimator.py")
    if path.exists():
        raise FlexaxisError(f"{path} is there already; give another name")
    template = files("flexaxis.experiments.conformance") / "templates" / "my_estimator.py"
    write_text(path, template.read_text(encoding="utf-8"))
    print(f"{path} estimates the motor friction f_m. Change it, then:")
    print(f"  flexaxis check {path}:{CLASS}")
    print(f"  flexaxis tune {path}:{CLASS} --match f_m")
    print(f"  flexaxis compare --base relocate --candidate {path}:{CLASS} --match-std fm_step-v1")
    return 0
