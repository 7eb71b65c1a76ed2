"""Generate the reference pages on commands, scenarios, estimators and scores from the code."""

import argparse
from pathlib import Path

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import in_a_line, options
from flexaxis.experiments.catalogue.find import GROUPS, find_scenario, scenario_names, suites
from flexaxis.experiments.cli import parser
from flexaxis.experiments.scoring.score_table import SCORES


def write(folder: Path) -> None:
    """Write all reference pages to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "commands": commands,
        "catalogue": catalogue,
        "estimators": estimators,
        "scores": scores,
    }
    for name, page in pages.items():
        text = "\n\n".join(page()) + "\n"
        target = folder / f"{name}.md"
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            target.write_text(text, encoding="utf-8")  # Sphinx re-reads each rewritten file


def table(heads, rows):
    """Return a Markdown table with the given headings and rows."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(
        f"| {' | '.join(str(c).replace('|', chr(92) + '|') for c in x)} |" for x in lines
    )


def commands():
    """Yield the sections of the commands page, with the help text of each command."""
    yield "# Commands"
    subs = next(a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
    for name, sub in subs.choices.items():
        yield f"## flexaxis {name}\n\n```text\n{sub.format_help()}```"


def catalogue():
    """Yield the sections of the catalogue page, with tables of the scenarios and suites."""
    yield "# Catalogue\n\nThe command `flexaxis show NAME` prints all settings of a scenario."
    scenarios = [find_scenario(name) for name in scenario_names()]
    for group, words in GROUPS.items():
        rows = [
            [f"`{s.name}`", s.difficulty or "", in_a_line(s)] for s in scenarios if s.group == group
        ]
        yield f"## {group.capitalize()}: {words}\n\n" + table(
            ["scenario", "expected", "content"], rows
        )
    rows = [[f"`{line['name']}`", line["card"]] for line in suites()]
    yield "## Suites\n\n" + table(["suite", "purpose"], rows)


def estimators():
    """Yield the sections of the estimators page, with an option table for each estimator."""
    yield "# Options of the estimators"
    for entry in REGISTRY.values():
        rows = [[f"`{name}`", f"`{value!r}`", x] for name, (value, x) in options(entry).items()]
        yield f"## {entry.name}\n\n{entry.summary}\n\n" + (
            table(["option", "default", "meaning"], rows) if rows else ""
        )


def scores():
    """Yield the scores page, with a table of the units and definitions of all scores."""
    rows = [[f"`{s.name}`", s.unit or "", s.better or "", s.words] for s in SCORES.values()]
    yield "# Scores\n\n" + table(["score", "unit", "better", "definition"], rows)
