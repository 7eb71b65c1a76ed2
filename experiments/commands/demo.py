"""Show the live axis in the browser: break it, turn the knobs, and watch two estimators follow.

The page needs no network and is seen on this computer only, unless --share. The address that is
printed is the key to it: it holds a secret, new each time. With --record a lesson is drawn into a
file instead, without browser and display; --script names a TOML file that says what happens when
(`flexaxis demo --print-script` prints the default one, to start from).

example:
  flexaxis demo
  flexaxis demo --estimator 'rpem-forgetting[forgetting=0.99]' --estimator ekf --speed 2
  flexaxis demo --record lesson.gif --script lesson.toml
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from flexaxis.experiments.building.consent import add_run_code

HELP = "a live axis in the browser, or a lesson as GIF or MP4"
GROUP = "teach"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--estimator", action="append", metavar="E", help="give two; they race on the same data"
    )
    parser.add_argument("--seed", type=int, default=0, help="of excitation and noise (default 0)")
    parser.add_argument("--speed", type=float, default=1.0, metavar="X", help="times real time")
    parser.add_argument(
        "--exaggerate", type=float, default=100.0, metavar="X", help="of the twist (default 100)"
    )
    parser.add_argument(
        "--port", type=int, metavar="N", help="this one or none (default 8080, or the next free)"
    )
    parser.add_argument("--no-browser", action="store_true", help="only print the address")
    parser.add_argument(
        "--share",
        action="store_true",
        help="let other computers that have the address watch AND press the buttons: no encryption",
    )
    parser.add_argument("--record", type=Path, metavar="FILE.gif|mp4", help="draw into a file")
    parser.add_argument("--script", type=Path, metavar="LESSON.toml", help="what is recorded")
    add_run_code(parser, "the estimators of LESSON.toml")
    parser.add_argument("--print-script", action="store_true", help="print the default lesson")


def main(args: argparse.Namespace) -> int:
    """Serve, or record."""
    if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ):
        os.environ.setdefault("MUJOCO_GL", "egl")  # before the engine is imported
    from flexaxis.experiments.demo.lesson import default_lesson, load_lesson
    from flexaxis.experiments.demo.session import DEFAULT_RACERS, DemoSession
    from flexaxis.experiments.running.outputs import spare
    from flexaxis.sim.errors import FlexaxisError

    if args.print_script:
        print(default_lesson(), end="")
        return 0
    if not 0.05 <= args.speed <= 50:
        raise FlexaxisError(f"--speed {args.speed:g}: give a factor from 0.05 to 50")
    if args.record:
        spare([args.script], args.record)
        return _record(args, load_lesson(args.script))
    if args.script:
        raise FlexaxisError("--script is for --record FILE; the live demo is run by its buttons")
    from flexaxis.experiments.demo.serve import serve

    session = DemoSession(estimators=args.estimator or DEFAULT_RACERS, seed=args.seed)
    serve(
        session,
        port=args.port,
        share=args.share,
        browser=not args.no_browser,
        speed=args.speed,
        exaggerate=args.exaggerate,
        said=lambda line: print(line, flush=True),
        warned=lambda line: print(f"flexaxis: {line}", file=sys.stderr, flush=True),
    )
    return 0


def _record(args: argparse.Namespace, lesson) -> int:  # type: ignore[no-untyped-def]
    from flexaxis.experiments.building.consent import require
    from flexaxis.experiments.demo.movie import record
    from flexaxis.experiments.running.progress import progress
    from flexaxis.experiments.studies.benchmark import command_line

    if not args.estimator:
        require(
            args.run_code,
            lesson.estimators,
            source=str(args.script),
            command=command_line(args.words),
        )
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
