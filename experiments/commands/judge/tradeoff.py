r"""Sweep each estimator over its own knob and compare at equal noise, with the bounds.

Any estimator can be made faster and noisier. Compared are whole curves, and lags where the standard
deviation of the parameter that changes is that of rpem-forgetting at its default, before the fault.
Where the sweep does not reach it, the knob is turned further; who is quieter at every setting has a
lag of at most what is shown, who is noisier of at least that. The last column is one number for all
faults: the score where the excess prediction error is equal. Writes tradeoff.json and tradeoff.svg.

example:
  flexaxis tradeoff fm_step-v1 kt_step-v1 --estimator rpem-forgetting --estimator glr
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from flexaxis.experiments.commands import options
from flexaxis.experiments.commands.answers import add_output, answer
from flexaxis.experiments.running.seeds import parse_seeds
from flexaxis.experiments.storage.files import write_json, write_text

HELP = "sweep estimators over their knobs: speed against variance, beside the bound"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="+", metavar="SUITE|SCENARIO")
    parser.add_argument("--estimator", action="append", metavar="E", help="repeat for several")
    parser.add_argument("--seeds", default="16", metavar="N or A:B", help="default: 16")
    options.add_jobs(parser, what="the lags do")
    options.add_resume(parser)
    options.add_time_limit(parser)
    add_output(parser, "DIR", default=Path("results/tradeoff"))


def main(args: argparse.Namespace) -> int:
    """Sweep, match and draw."""
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.comparison.ranking import overall
    from flexaxis.experiments.reporting.run_figures import speed_noise
    from flexaxis.experiments.reporting.terminal import equal_noise_table, show
    from flexaxis.experiments.reporting.words import faults_of, noise_of
    from flexaxis.experiments.running.bench import Bench
    from flexaxis.experiments.studies.sweep import TURNS, reference, settings, sweep, texts

    scenarios, *_ = select(args.names)
    known = args.estimator or ["rpem-forgetting", "rpem-drift", "ekf", "glr"]
    estimators = list(dict.fromkeys(known))
    seeds = parse_seeds(args.seeds)
    command = options.line(args)
    most = len(texts(settings(estimators, factors=TURNS))) * len(scenarios) * len(seeds)
    how = {"overwrite": args.overwrite, "about": {"command": command}}
    what = f"at most {most} cases"
    with (
        options.working(args, what, most) as (means, _),
        Bench(scenarios, args.output, means, **how) as bench,
    ):
        found = sweep(scenarios, estimators, seeds, bench)
        content = {
            "command": command,
            "seeds": seeds,
            "reference": reference(),
            **asdict(found),
            "overall": overall(found.at_excess),
        }
        path = args.output / "tradeoff.svg"
        points = faults_of(found.points)
        names = {name: name for name in points["fault"].unique()}
        speed_noise(points, estimators, names, noise_of(points)).savefig(path)
        write_json(args.output / "tradeoff.json", content)
    definitions = {s.name: s.resolved() for s in scenarios}
    table = equal_noise_table(content, definitions, len(seeds))
    return answer(args, content | {"figure": path}, 0, path, show=lambda: show(table))
