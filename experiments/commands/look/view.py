"""Look at a run in 3-D: a window, or a picture with -o.

The twist of the joints is about a milliradian, so the angles of gear and arm are exaggerated; the
motor turns as it does. A record replays what happened; a scenario is simulated first.

example:
  flexaxis view fm_step-v1                         opens a window (needs a display)
  flexaxis view rec.nc --at 12.5 -o axis.png       one picture, without a display
"""

from __future__ import annotations

import argparse
from pathlib import Path

from flexaxis.experiments.commands.answers import SEED, add_output, answer, at_most
from flexaxis.experiments.storage.files import spare
from flexaxis.sim.errors import FlexaxisError

HELP = "look at a run in 3-D, in a window or as a picture"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("what", metavar="SCENARIO|RECORD.nc")
    parser.add_argument("--seed", type=at_most(SEED), default=0, help="of a scenario (default 0)")
    parser.add_argument("--at", type=float, default=0.0, metavar="T", help="start there [s]")
    parser.add_argument(
        "--exaggerate", type=float, default=100.0, metavar="X", help="of the twist (default 100)"
    )
    add_output(parser, "PICTURE.png")


def main(args: argparse.Namespace) -> int:
    """Show a run."""
    spare([args.what], args.output)
    _check(args)
    if args.output is not None:
        from flexaxis.experiments.demo.view import draw_offscreen

        draw_offscreen()  # before the engine is imported
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.demo.view import picture, window
    from flexaxis.sim.record import load_record
    from flexaxis.sim.simulate import simulate

    if args.what.endswith(".nc"):
        record = load_record(Path(args.what))
    else:
        record = simulate(find_scenario(args.what), [args.seed])[0]
    if args.at > record.time[-1]:
        raise FlexaxisError(
            f"--at {args.at:g}: the run ends at {record.time[-1]:g} s; give a time [s] before that"
        )
    if args.output is None:
        window(record, start=args.at, exaggerate=args.exaggerate)
    else:
        picture(record, args.output, at=args.at, exaggerate=args.exaggerate)
    return answer(args, {"picture": args.output}, 0, *filter(None, [args.output]))


def _check(args: argparse.Namespace) -> None:
    """Refuse numbers and names that no picture can be made of."""
    if not 0 <= args.at < float("inf"):
        raise FlexaxisError(f"--at {args.at:g}: give a time of the run [s], from 0 on")
    if not 0 <= args.exaggerate < float("inf"):
        raise FlexaxisError(
            f"--exaggerate {args.exaggerate:g}: give a finite factor, 0 or more; 1 draws the twist "
            "as it is"
        )
    if args.output is not None and args.output.suffix.lower() != ".png":
        raise FlexaxisError(
            f"-o {args.output}: a picture is written as PNG, so give a name that ends in .png, "
            f"such as {args.output.stem or 'axis'}.png"
        )
