"""Break a live axis in the browser, and watch which of two estimators finds it first.

The paper's method (A) races the recommended one (B). Press "motor friction f_m × 2": the diagram
on the right shows how much of the fault each has still to find, beside what the noise allows any
estimator. Pause and step; move λ, Δ and μ; add noise and dry friction; choose other estimators.

The page needs no network and is seen on this computer only; docs/demo.md says how a class sees it.

example:
  flexaxis demo
  flexaxis demo --estimator rpem-drift --estimator ekf --speed 2
  flexaxis demo flexaxis_lesson.toml
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands.answers import SEED, at_most
from flexaxis.sim.errors import FlexaxisError

HELP = "a live axis in the browser"
JSON = False


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "lesson", nargs="?", type=Path, metavar="LESSON.toml", help="what is done without a click"
    )
    parser.add_argument(
        "--estimator", action="append", metavar="E", help="give two; they race on the same data"
    )
    parser.add_argument(
        "--seed", type=at_most(SEED), help="of excitation and noise (default: the lesson's, or 0)"
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, metavar="X", help="times real time (default 1)"
    )
    parser.add_argument(
        "--exaggerate", type=float, default=100.0, metavar="X",
        help="magnification of the joint twist in the picture (default 100)",
    )  # fmt: skip
    parser.add_argument(
        "--port", type=int, metavar="N", help="this one or none (default 8080, or the next free)"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")


def main(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    from flexaxis.experiments.demo.serve import serve

    if not 0.25 <= args.speed <= 50:
        raise FlexaxisError(f"--speed {args.speed:g}: give a factor from 0.25 to 50")
    serve(
        args.estimator or (),
        lesson=args.lesson,
        seed=args.seed,
        speed=args.speed,
        exaggerate=args.exaggerate,
        port=args.port,
        browser=not args.no_browser,
    )
    return 0
