"""Break a live axis in the browser, and watch who sees it first: two estimators, and theory.

The paper's method (A) races the recommended one (B). Press "worn gear f_m × 2": the upper diagram
shows how much of the fault each has still to find, and in grey what noise allows to anybody. Stop
the clock and step through it; turn λ, Δ, μ, noise and dry friction; put another estimator into the
race. "What was done" has every fault with what each said and how late, as CSV, and as a LESSON
that does it all again.

The page needs no network and is seen on this computer only; docs/demo.md says how a class sees it.
The address that is printed is the key to it: it holds a secret, new each time. With --record a
lesson is drawn into a file instead, without browser and display (`flexaxis demo --print-script`
prints the default one, to start from).

example:
  flexaxis demo
  flexaxis demo --estimator rpem-drift --estimator ekf --speed 2
  flexaxis demo flexaxis_lesson.toml
  flexaxis demo --record lesson.gif --script flexaxis_lesson.toml
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from flexaxis.experiments.commands.answers import SEED, at_most
from flexaxis.experiments.files import check_not_input
from flexaxis.experiments.running.progress import progress
from flexaxis.sim.errors import FlexaxisError

if TYPE_CHECKING:
    from flexaxis.experiments.demo.lesson import Lesson

HELP = "a live axis in the browser, or a lesson as GIF"
JSON = False


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "lesson", nargs="?", type=Path, metavar="LESSON.toml", help="what is to happen by itself"
    )
    parser.add_argument(
        "--estimator", action="append", metavar="E", help="give two; they race on the same data"
    )
    parser.add_argument(
        "--seed", type=at_most(SEED), help="of excitation and noise (default: the lesson's, or 0)"
    )
    parser.add_argument(
        "--speed", type=float, metavar="X", help="times real time (default: the lesson's, or 1)"
    )
    parser.add_argument(
        "--exaggerate", type=float, default=100.0, metavar="X", help="of the twist (default 100)"
    )
    parser.add_argument(
        "--port", type=int, metavar="N", help="this one or none (default 8080, or the next free)"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument("--record", type=Path, metavar="FILE.gif", help="draw into a file")
    parser.add_argument("--script", type=Path, metavar="LESSON.toml", help="what is recorded")
    parser.add_argument("--print-script", action="store_true", help="print the default lesson")


def main(args: argparse.Namespace) -> int:
    """Serve, or record."""
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        os.environ.setdefault("MUJOCO_GL", "egl")  # before the engine is imported
    from flexaxis.experiments.demo.lesson import default_lesson, load_lesson

    if args.print_script:
        print(default_lesson(), end="")
        return 0
    if args.lesson and args.script:
        raise FlexaxisError(f"give one lesson: {args.lesson}, or --script {args.script}")
    if args.speed is not None and not 0.05 <= args.speed <= 50:
        raise FlexaxisError(f"--speed {args.speed:g}: give a factor from 0.05 to 50")
    if args.seed is not None and args.seed < 0:
        raise FlexaxisError(f"--seed {args.seed}: give zero or more")
    path = args.lesson or args.script
    if args.record:
        check_not_input([path], args.record)
        return _record(args, load_lesson(path), path)
    if args.script:
        raise FlexaxisError(
            "--script is for --record FILE; in the browser: flexaxis demo LESSON.toml"
        )
    return _serve(args, load_lesson(path) if path else None)


def _serve(args: argparse.Namespace, lesson: Lesson | None) -> int:
    from flexaxis.experiments.demo.lesson import Player
    from flexaxis.experiments.demo.serve import serve
    from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession

    def warned(line: str) -> None:
        print(f"flexaxis: {line}", file=sys.stderr, flush=True)

    session = DemoSession(
        estimators=args.estimator or (lesson.estimators if lesson else DEFAULT_RACERS),
        seed=(lesson.seed if lesson else 0) if args.seed is None else args.seed,
    )
    serve(
        session,
        port=args.port,
        browser=not args.no_browser,
        speed=args.speed or (lesson.speed if lesson else 1.0),
        exaggerate=args.exaggerate,
        play=(lambda begun: Player(begun, lesson, warned).advance) if lesson else None,
        said=lambda line: print(line, flush=True),
        warned=warned,
    )
    return 0


def _record(args: argparse.Namespace, lesson: Lesson, path: Path | None) -> int:
    from flexaxis.experiments.demo.movie import record

    with progress(f"recording {args.record}", 1.0) as advance:
        record(
            lesson,
            args.record,
            estimators=args.estimator,
            seed=args.seed,
            exaggerate=args.exaggerate,
            advance=advance,
        )
    print(args.record)
    return 0
