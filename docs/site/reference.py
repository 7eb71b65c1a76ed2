"""Reference pages made from what there is: commands, scenarios, estimators, scores, the paper.

Nothing here is typed twice: a new command, scenario, estimator or score is on its page with the
next build.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

import yaml
from pages import ROOT

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import card
from flexaxis.experiments.catalogue import find as catalogue
from flexaxis.experiments.catalogue.names import GROUPS as CATALOGUE
from flexaxis.experiments.catalogue.names import suite_card
from flexaxis.experiments.cli import GROUPS, commands, group_of, parser
from flexaxis.experiments.scoring.score_table import SCORES, Score
from flexaxis.sim.scenario import Scenario

FENCE = "`" * 5


def write(folder: Path) -> None:
    """Write all pages of reference into a folder of sources."""
    (folder / "reference").mkdir(parents=True, exist_ok=True)
    pages = {
        "commands": command_page(),
        "scenarios": scenario_page(),
        "estimators": estimator_page(),
        "scores": score_page(),
        "citation": citation_page(),
        **{f"scenarios-{group}": group_page(group) for group in CATALOGUE},
    }
    for name, text in pages.items():
        (folder / "reference" / f"{name}.md").write_text(text, encoding="utf-8")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(
        f"| {' | '.join(c.replace('|', chr(92) + '|') for c in line)} |" for line in lines
    )


def block(text: str, language: str = "text") -> str:
    """Return text as a block of code."""
    return f"{FENCE}{language}\n{text.rstrip()}\n{FENCE}"


def folded(title: str, text: str) -> str:
    """Return text that opens with a click."""
    return f"<details><summary>{title}</summary>\n\n{text}\n\n</details>"


def command_page() -> str:
    """Return what `--help` says, of all commands by what they are for."""
    known, top = commands(), parser()
    subs = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction)).choices
    parts = [
        "# All commands",
        "What `flexaxis --help` and `flexaxis COMMAND --help` say. Results go to stdout, progress "
        "to stderr; with `--json` there is only JSON on stdout ([JSON](../json.md)).",
        str(top.epilog).partition("exit status:")[2].join(["## Exit status\n\n```text\n", "```"]),
    ]
    for group in GROUPS.values():
        names = [name for name, module in known.items() if group == group_of(module)]
        rows = [[f"[`{n}`](#flexaxis-{n})", known[n].HELP] for n in names]
        parts += [f"## To {group}" if group in VERBS else f"## {group.capitalize()}"]
        parts += [table(["command", "what it does"], rows)]
        for name in names:
            parts += [f"### flexaxis {name}", block(_help(subs[name]))]
    return "\n\n".join(parts) + "\n"


VERBS = ("look", "run", "judge", "teach")


def _help(sub: argparse.ArgumentParser) -> str:
    """Return the help of a command as 96 columns show it, whatever terminal builds the site."""
    sub.formatter_class = partial(argparse.RawDescriptionHelpFormatter, width=96)
    return sub.format_help()


def scenario_page() -> str:
    """Return the groups of the catalogue, each with its scenarios in a line, and the suites."""
    parts = [
        "# All scenarios",
        "All of the catalogue, as `flexaxis list` and `flexaxis show NAME` have it. How one is "
        "written: [Scenarios](../scenarios.md).",
        toctree(f"scenarios-{group}" for group in CATALOGUE),
    ]
    for group, names in _by_group().items():
        rows = [
            [f"[`{n}`](scenarios-{group}.md#{n})", s.difficulty or "", card.in_a_line(s)]
            for n, s in names.items()
        ]
        head = f"## {group.capitalize()}: {CATALOGUE[group]}"
        parts += [head, table(["scenario", "expected", "content"], rows)]
    suites = [[f"`{name}`", suite_card(name)] for name in catalogue.suite_names()]
    return "\n\n".join([*parts, "## Suites", table(["suite", "what it is for"], suites)]) + "\n"


def group_page(group: str) -> str:
    """Return the cards of the scenarios of a group, each with its TOML."""
    parts = [f"# {group.capitalize()}: {CATALOGUE[group]}"]
    for name, scenario in _by_group()[group].items():
        facts = [[f"*{key}*", words] for key, words in card.reference_card(scenario).items()]
        parts += [f"## {name}", scenario.card, table(["", ""], facts[1:])]
        parts += [folded("all its values", block(scenario.to_toml(), "toml"))]
    return "\n\n".join(parts) + "\n"


def _by_group() -> dict[str, dict[str, Scenario]]:
    found = {name: catalogue.find_scenario(name) for name in catalogue.scenario_names()}
    groups = {name: (s.group or "") for name, s in found.items()}
    return {g: {n: found[n] for n in found if groups[n] == g} for g in CATALOGUE}


def estimator_page() -> str:
    """Return all estimators of the registry: summary, knob, tuning, options."""
    rows = [[f"[`{e.name}`](#{e.name})", e.summary] for e in REGISTRY.values()]
    parts = [
        "# All estimators",
        "All that `flexaxis list estimators` knows. An option is given in brackets, "
        "`--estimator 'rpem-forgetting[forgetting=0.99]'`; how they compare: "
        "[Scores](../scores.md#the-estimators).",
        table(["estimator", "what it is"], rows),
    ]
    for entry in REGISTRY.values():
        words = [f"## {entry.name}", entry.summary]
        if knob := entry.turning:
            words += [f"Its knob, which buys speed with noise: `{knob.label}`."]
        if entry.tuning:
            words += [f"By default tuned for the axis `{entry.tuning.axis}`."]
        if entry.laws:
            words += ["It can be asked to identify parameters of friction and other laws."]
        options = [[f"`{name}`", f"`{value!r}`"] for name, value in entry.options.items()]
        words += [table(["option", "default"], options) if options else "It has no options."]
        words += [f"Made in `{_home(entry.factory)}`."]
        parts += words
    return "\n\n".join(parts) + "\n"


def _home(factory: Callable[..., object]) -> str:
    """Return the module that makes an estimator, also where options of another are fixed."""
    return factory.func.__module__ if isinstance(factory, partial) else factory.__module__


def score_page() -> str:
    """Return all scores of the table, each with its unit and how it is pooled."""
    parts = [
        "# All scores",
        "The table `SCORES`, from which rows, summaries, reports and files are made. Why they "
        "are as they are: [Scores](../scores.md).",
    ]
    rows = [[f"[`{s.name}`](#{s.name})", s.unit or "", s.better or ""] for s in SCORES.values()]
    parts += [table(["score", "unit", "better"], rows)]
    for score in SCORES.values():
        parts += [f"## {score.name}", score.words, table(["", ""], _facts(score))]
    return "\n\n".join(parts) + "\n"


def _facts(score: Score) -> list[list[str]]:
    facts = [["*unit*", score.unit or "a plain number"]]
    if score.better:
        facts += [["*better*", f"{score.better} is better"]]
    facts += [["*over seeds*", "pooled" if score.pool else "of one run only, not pooled"]]
    if score.heading:
        facts += [["*in reports*", score.heading]]
    for name, unit in score.parts.items():
        facts += [[f"*part* `{name}`", unit or "a plain number"]]
    if score.margin is not None:
        facts += [["*in `compare`*", f"a change below {score.margin:.0%} does not matter"]]
    return facts


def citation_page() -> str:
    """Return how to cite, from CITATION.cff."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    told = yaml.safe_load(text)
    papers = [
        f"- {' and '.join(_person(a) for a in r['authors'])}, *{r['title']}*, "
        f"{r['institution']['name']}"
        for r in told["references"]
    ]
    return "\n\n".join(
        [
            "# Citing flexaxis",
            told["message"],
            f"- {told['authors'][0]['name']}, *{told['title']}*, version {told['version']}, "
            f"{told['license']}\n" + "\n".join(papers),
            "`flexaxis paper` checks every claim of the paper and draws its figures. "
            "`CITATION.cff`, which reference managers read:",
            block(text, "yaml"),
        ]
    )


def _person(author: dict[str, str]) -> str:
    return f"{author['given-names']} {author['family-names']}"


def toctree(names: Iterable[str], *, caption: str = "", hidden: bool = True, depth: int = 1) -> str:
    """Return a table of contents for Sphinx."""
    options = [f":maxdepth: {depth}", *([":hidden:"] if hidden else [])]
    options += [f":caption: {caption}"] if caption else []
    return "\n".join(["```{toctree}", *options, "", *names, "```"])
