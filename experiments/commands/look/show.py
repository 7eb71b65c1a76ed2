"""Show a scenario, a suite or an estimator: all values written out.

A scenario is printed as its reference card and as TOML that can be edited and run from its path.

example:
  flexaxis show fm_step-v1
  flexaxis show fm_step-v1 > mine.toml       then: flexaxis run mine.toml
  flexaxis show rpem-forgetting
"""

from __future__ import annotations

import argparse

from flexaxis.experiments.commands.answers import answer

HELP = "show a scenario, suite or estimator with all its values"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("name", metavar="SCENARIO|SUITE|ESTIMATOR", help="its name, or a TOML path")


def main(args: argparse.Namespace) -> int:
    """Print what a name stands for."""
    from dataclasses import asdict

    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.catalogue import card
    from flexaxis.experiments.catalogue import find as catalogue

    if args.name in REGISTRY:
        entry = REGISTRY[args.name]
        knob = entry.turning
        content = {
            "name": entry.name,
            "summary": entry.summary,
            "options": dict(entry.options),
            "knob": knob and knob.label,
            "tuned": asdict(entry.tuning) if entry.tuning else None,
        }
        lines = [f"{entry.name}: {entry.summary}", "", "options and defaults:"]
        lines += [f"  {key} = {value}" for key, value in entry.options.items()] or ["  none"]
        lines += ["", f"knob that trades speed for variance: {knob.label if knob else 'none'}"]
        if knob and entry.tuning:
            values = ", ".join(str(entry.options[name]) for name in knob.names)
            lines += [f"  {values} as tuned for {entry.tuning.axis}"]
        if knob and entry.tuning and entry.default is not None:
            lines += [
                f"  {entry.default} on any other axis"
                + (", for 5 ms: a time constant of 1 s" if knob.transform == "1-" else ""),
            ]
        text = "\n".join(lines)
    elif args.name in catalogue.suite_names():
        content = asdict(catalogue.find_suite(args.name))
        text = "\n".join(f"{key}: {value}" for key, value in content.items())
    else:
        scenario = catalogue.find_scenario(args.name)
        content = scenario.resolved() | {"hash": scenario.hash}
        known = card.reference_card(scenario) | {"content hash": scenario.hash}
        of_card = [f"# {key}: {' '.join(value.split())}" for key, value in known.items()]
        text = "".join(f"{line}\n" for line in of_card)
        text += f"\n{scenario.to_toml()}"
    return answer(args, content, 0, text.rstrip())
