"""List the catalogue: scenarios, suites and estimators.

example:
  flexaxis list
  flexaxis list scenarios --json
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

HELP = "list scenarios, suites and estimators"
GROUP = "what there is"
KINDS = ("scenarios", "suites", "estimators")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("kind", nargs="?", choices=KINDS, help="list only these")
    parser.add_argument("--json", action="store_true", help="print JSON")


def main(args: argparse.Namespace) -> int:
    """Print the catalogue."""
    from rich.console import Console
    from rich.table import Table

    from flexaxis.experiments.running.files import dumps

    found = {kind: rows for kind, rows in _catalogue().items() if args.kind in (None, kind)}
    if args.json:
        print(dumps(found))
        return 0
    for kind, rows in found.items():
        table = Table(title=kind, title_justify="left", box=None, pad_edge=False)
        table.add_column("name", no_wrap=True)
        if kind == "scenarios":
            table.add_column("expected", no_wrap=True)
        table.add_column("what it is")
        for cells in _grouped(rows) if kind == "scenarios" else _plain(rows):
            table.add_row(*cells)
        Console().print(table, *_below(rows), "")
    return 0


def _below(rows: list[dict[str, str]]) -> Iterator[str]:
    """Yield what is to be said of estimators: where their knobs are tuned."""
    for axis in sorted({row["tuned_for"] for row in rows if row.get("tuned_for")}):
        count = sum(row.get("tuned_for") == axis for row in rows)
        yield (
            f"The knobs of {count} of them are tuned for {axis}; on any other axis they have the "
            "defaults that `flexaxis show NAME` shows."
        )


def _plain(rows: list[dict[str, str]]) -> Iterator[tuple[str, ...]]:
    return ((row["name"], row["summary"]) for row in rows)


def _grouped(rows: list[dict[str, str]]) -> Iterator[tuple[str, ...]]:
    """Yield the cells of the scenarios, each group under its heading."""
    from flexaxis.experiments.catalogue.card import GROUPS

    for group, words in GROUPS.items():
        yield f"[bold]{group}[/bold]", "", f"[bold]{words}[/bold]"
        for row in rows:
            if row["group"] == group:
                yield f"  {row['name']}", row["difficulty"], row["content"]


def _catalogue() -> dict[str, list[dict[str, str]]]:
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.catalogue import find as catalogue

    return {
        "scenarios": [_scenario(name) for name in catalogue.scenario_names()],
        "suites": [
            {"name": name, "summary": catalogue.find_suite(name).card}
            for name in catalogue.suite_names()
        ],
        "estimators": [
            {
                "name": entry.name,
                "summary": entry.summary,
                "tuned_for": entry.tuning.axis if entry.tuning else "",
            }
            for entry in REGISTRY.values()
        ],
    }


def _scenario(name: str) -> dict[str, str]:
    from flexaxis.experiments.catalogue import card
    from flexaxis.experiments.catalogue import find as catalogue

    scenario = catalogue.find_scenario(name)
    return {
        "name": name,
        "group": scenario.group or "",
        "difficulty": scenario.difficulty or "",
        "content": card.in_a_line(scenario),
        "summary": scenario.card,
    }
