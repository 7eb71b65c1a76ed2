r"""Check that an estimator keeps the rules that its scores rely on.

Shapes, finite numbers, step equals run, no look-ahead, gaps, and so on: each rule with its reason,
and with a hint where it is broken. The code that the estimator names is run.

exit status: 0 all rules hold, 1 a rule is broken, 2 it cannot be built, 70 its constructor crashed

example:
  flexaxis check my_estimator.py:Mine
  flexaxis check 'pipe:octave-cli -q my.m'
"""

from __future__ import annotations

import argparse

from flexaxis.experiments.commands.answers import answer

HELP = "check that an estimator keeps the rules"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("estimator", metavar="ESTIMATOR", help="as for `run --estimator`")


def main(args: argparse.Namespace) -> int:
    """Check every rule and say what was found."""
    from dataclasses import asdict

    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from flexaxis.experiments.check.check import check
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.estimators import parse

    found = check(parse(args.estimator), store=default_cache())
    status = int(any(finding.holds is False for finding in found))
    if args.json:
        rules = [asdict(finding) for finding in found]
        return answer(args, {"estimator": args.estimator, "rules": rules}, status)
    table = Table("rule", "", box=None, pad_edge=False)
    table.add_column("what was seen", overflow="fold")  # a path is of no use without its end
    told: set[str] = set()
    words = {True: "holds", False: "[red]BROKEN[/]", None: "not applicable"}
    for finding in found:
        seen = finding.seen
        if finding.raised and seen in told:
            seen = "the same"
        told.add(finding.seen)
        table.add_row(finding.rule, words[finding.holds], escape(seen))
    Console().print(table)
    for finding in found:
        if finding.holds is False and not finding.raised:  # what was raised says itself what to do
            print(f"\n{finding.rule}: {finding.reason}\n  hint: {finding.hint}")
    return status
