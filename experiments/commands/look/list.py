"""List the catalogue: scenarios, suites and estimators.

example:
  flexaxis list
  flexaxis list scenarios --group steps
  flexaxis list --find friction --json
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from flexaxis.experiments.commands.answers import answer
from flexaxis.sim.errors import FlexaxisError

HELP = "list scenarios, suites and estimators"
KINDS = ("scenarios", "suites", "estimators")

NARROW = 72  # columns; in fewer, names leave no room for anything beside them

Line = dict[str, str]


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("kind", nargs="?", choices=KINDS, help="list only these")
    parser.add_argument("--group", metavar="GROUP", help="only scenarios of a group, such as steps")
    parser.add_argument("--find", metavar="TEXT", default="", help="only what has this text")


def main(args: argparse.Namespace) -> int:
    """Print the catalogue."""
    from flexaxis.experiments.catalogue.names import lines as lines_of
    from flexaxis.experiments.catalogue.names import scenario_lines

    if args.group and args.kind not in (None, "scenarios"):
        raise FlexaxisError(f"--group is of scenarios, and {args.kind} have none: leave it out")
    kind = "scenarios" if args.group else args.kind
    found = {each: lines_of(each, find=args.find) for each in KINDS if kind in (None, each)}
    if "scenarios" in found:
        found["scenarios"] = scenario_lines(group=args.group or "", find=args.find)
    if args.json:
        return answer(args, found)
    for each, lines in found.items():
        if lines:
            _print(each, lines)
    if not any(found.values()):
        print(f"nothing has {args.find!r} in its name or in what is said of it")
    return 0


def _print(kind: str, lines: list[Line]) -> None:
    from rich.console import Console
    from rich.table import Table

    if Console().width < NARROW:
        _print_narrow(kind, lines)
        return
    table = Table(title=kind, title_justify="left", box=None, pad_edge=False)
    table.add_column("name", no_wrap=True)
    if kind == "scenarios":
        table.add_column("expected", no_wrap=True)
    table.add_column("what it is")
    for cells in _grouped(lines) if kind == "scenarios" else _plain(lines):
        table.add_row(*cells)
    Console().print(table, *_below(lines), "")


def _print_narrow(kind: str, lines: list[Line]) -> None:
    """Print what each is below its name."""
    from rich.console import Console
    from rich.padding import Padding

    console = Console()
    console.print(f"[italic]{kind}[/]")
    for name, *more, text in _grouped(lines) if kind == "scenarios" else _plain(lines):
        console.print("  ".join(word for word in (name, *more) if word), highlight=False)
        console.print(Padding(text, (0, 0, 0, 4)))
    console.print(*_below(lines), "")


def _below(lines: list[Line]) -> Iterator[str]:
    """Yield what is to be said of estimators: where their knobs are tuned."""
    for axis in sorted({line["tuned_for"] for line in lines if line.get("tuned_for")}):
        count = sum(line.get("tuned_for") == axis for line in lines)
        yield (
            f"The knobs of {count} of them are tuned for {axis}; on any other axis they have the "
            "defaults that `flexaxis show NAME` shows."
        )


def _plain(lines: list[Line]) -> Iterator[tuple[str, ...]]:
    return ((line["name"], line["summary"]) for line in lines)


def _grouped(lines: list[Line]) -> Iterator[tuple[str, ...]]:
    """Yield the cells of the scenarios, each group that has some under its heading."""
    from flexaxis.experiments.catalogue.names import GROUPS

    for group, words in GROUPS.items():
        mine = [line for line in lines if line["group"] == group]
        if mine:
            yield f"[bold]{group}[/bold]", "", f"[bold]{words}[/bold]"
        for line in mine:
            yield f"  {line['name']}", line["difficulty"], line["content"]
