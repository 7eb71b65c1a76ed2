"""List the catalogue: scenarios, suites and estimators.

example:
  flexaxis list
  flexaxis list scenarios --json
"""

from __future__ import annotations

import argparse

HELP = "list scenarios, suites and estimators"
KINDS = ("scenarios", "suites", "estimators")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("kind", nargs="?", choices=KINDS, help="list only these")
    parser.add_argument("--json", action="store_true", help="print JSON")


def main(args: argparse.Namespace) -> int:
    """Print the catalogue."""
    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.results import dumps

    found = {kind: rows for kind, rows in _catalogue().items() if args.kind in (None, kind)}
    if args.json:
        print(dumps(found))
        return 0
    for kind, rows in found.items():
        table = Table(title=kind, title_justify="left", box=None, pad_edge=False)
        table.add_column("name", no_wrap=True)
        table.add_column("what it is")
        for row in rows:
            table.add_row(row["name"], row["summary"])
        Console().print(table, "")
    return 0


def _catalogue() -> dict[str, list[dict[str, str]]]:
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments import catalogue

    return {
        "scenarios": [
            {"name": name, "summary": catalogue.find_scenario(name).card}
            for name in catalogue.scenario_names()
        ],
        "suites": [
            {"name": name, "summary": catalogue.find_suite(name).card}
            for name in catalogue.suite_names()
        ],
        "estimators": [
            {"name": entry.name, "summary": entry.summary} for entry in REGISTRY.values()
        ],
    }
