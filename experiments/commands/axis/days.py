"""Simulate the daily logs of an axis that wears and warms, to practise `flexaxis trend` on.

Every day the axis makes the same test motion, and its log goes to a file of that day, with a
column `temp` [°C]. Friction follows the temperature (--warm) and, from a day on, grows until the
last one (--wear). The folder also gets axis.toml, what the owner knew before the first day: values
of data sheets, up to 5 % off; and truth.json. SCENARIO is what is driven, without its faults: by
default a published robot axis.

example:
  flexaxis days --wear f_c=+12% --from-day 30 --days 60 -o days/
  flexaxis identify days/2026-01-01.csv --model days/axis.toml -o axis.toml
  flexaxis trend days/ --model axis.toml --covariate temp -o trend/
  flexaxis days coulomb_fc_step-v1 --warm f_c=-1.5%/K --temperature 25 -o warm/
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from flexaxis.experiments.commands.answers import SEED, add_output, answer, at_most
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.options import add_style_options, style_of
from flexaxis.experiments.running.progress import progress

HELP = "simulate daily logs of an axis that wears and warms"
WARM = ("f_c=-1%/K", "f_m=-1%/K")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "scenario", nargs="?", default="wg_fc_step-v1", metavar="SCENARIO",
        help="catalogue name or TOML path; default: wg_fc_step-v1",
    )  # fmt: skip
    add_output(parser, "FOLDER", default=Path("days"))
    parser.add_argument("--days", type=at_most(10_000), default=60, help="default: 60")
    parser.add_argument(
        "--wear", action="append", default=[], metavar="NAME=±X%",
        help="by which a parameter has grown on the last day, such as f_c=+12%%; default: none",
    )  # fmt: skip
    parser.add_argument(
        "--from-day",
        type=at_most(10_000),
        default=30,
        metavar="D",
        help="on which wear begins; default: 30",
    )
    parser.add_argument(
        "--temperature", type=float, default=25.0, metavar="K",
        help="between the coldest and the warmest day; default: 25",
    )  # fmt: skip
    parser.add_argument(
        "--warm", action="append", metavar="NAME=±X%/K",
        help=f"by which a parameter follows the temperature; default: {', '.join(WARM)}"
        .replace("%", "%%"),
    )  # fmt: skip
    parser.add_argument(
        "--scatter", default="1%", metavar="X%",
        help="of those parameters from day to day, of unknown cause; default: 1%%",
    )  # fmt: skip
    parser.add_argument(
        "--duration",
        type=at_most(86400, float),
        default=20.0,
        metavar="S",
        help="of a test motion; default: 20 s",
    )
    parser.add_argument(
        "--seed", type=at_most(SEED), default=0, help="number of the set (default 0)"
    )
    add_style_options(parser)
    parser.set_defaults(counts=65536)


def main(args: argparse.Namespace) -> int:
    """Simulate and write the logs."""
    from flexaxis.experiments.catalogue.find import find_scenario
    from flexaxis.experiments.logs.days import Days, without_faults, write_days

    days = Days(
        days=args.days,
        wear=_parts("wear", args.wear),
        from_day=args.from_day,
        span=args.temperature,
        warm=_parts("warm", WARM if args.warm is None else args.warm),
        scatter=_part("scatter", args.scatter),
    )
    scenario = without_faults(find_scenario(args.scenario), args.duration)
    with progress(f"{args.days} days", args.days) as advance:
        for _ in write_days(args.output, scenario, days, seed=args.seed, style=style_of(args)):
            advance(1)
    model = args.output / "axis.toml"
    content = {"folder": args.output, "model": model, "days": args.days}
    content |= {"truth": args.output / "truth.json"}
    follow = f"flexaxis trend {args.output} --model {model} --covariate temp"
    return answer(args, content, 0, follow, args.output)


def _parts(option: str, texts: list[str] | tuple[str, ...]) -> dict[str, float]:

    found = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise LogError(f"--{option} {text}: write NAME=PERCENT, such as f_c=+12%")
        found[name.strip()] = _part(option, value)
    return found


def _part(option: str, text: str) -> float:
    """Return a percentage as a part: "+12%" is .12, "-1.5%/K" is −.015."""
    found = re.fullmatch(r"\s*([-+]?[\d.]+(?:e-?\d+)?)\s*%(?:\s*/\s*K)?\s*", text)
    try:
        return float(found[1]) / 100  # type: ignore[index]
    except (TypeError, ValueError):
        raise LogError(f"--{option} {text}: give a percentage, such as +12%") from None
