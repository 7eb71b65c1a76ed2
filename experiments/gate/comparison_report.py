"""A comparison as text, Markdown and HTML, with the runs on the worst seed drawn."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path

from rich.table import Table

from flexaxis.experiments.gate.decide import BETTER, SAME, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.lost import SILENT
from flexaxis.experiments.gate.pairs import LOST, METRICS
from flexaxis.experiments.gate.verdicts import Verdict
from flexaxis.experiments.gate.words import explanation, headline, knobs, meaning, percent
from flexaxis.experiments.reporting import figures, page
from flexaxis.experiments.reporting.cells import number
from flexaxis.experiments.running.case import case_id
from flexaxis.experiments.running.files import write_json, write_text, writing
from flexaxis.experiments.running.names import REPORT
from flexaxis.experiments.running.traces import Traces
from flexaxis.experiments.scoring.curves import curve_of
from flexaxis.sim.scenario import Scenario

JSON, MARKDOWN = "compare.json", "verdict.md"
COLUMNS = ("scenario", "score", "base", "candidate", "change", "interval [%]", "verdict")
_ORDER = (WORSE, UNDECIDED, BETTER, SLIGHT, SAME, SILENT)
_STYLE = {WORSE: "red", BETTER: "green", UNDECIDED: "yellow"}


def ordered(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the verdicts with what matters first; where no run was lost no row is needed."""
    shown = [v for v in verdicts if v.metric not in LOST or v.base or v.candidate]
    return sorted(shown, key=lambda v: _ORDER.index(v.verdict))


def cells(v: Verdict) -> tuple[str, ...]:
    """Return a verdict as the texts of a row, in the order of `COLUMNS`."""
    if v.metric in LOST:
        runs = (f"{v.base:.0f} of {v.runs}", f"{v.candidate:.0f} of {v.runs}")
        more = f"{v.newly} new, {v.regained} back, p = {v.p:.2g}"
        return v.scenario, v.metric.replace("_", " "), *runs, "", more, _word(v)
    spread = f"{percent(v.interval[0])} … {percent(v.interval[1])}" if v.interval else "–"
    if v.pairs < v.runs:
        spread += f" ({v.pairs} of {v.runs} pairs)"
    change = "–" if v.change is None else f"{percent(v.change)} %"
    values = (_with_unit(v.base, v.metric), _with_unit(v.candidate, v.metric))
    return v.scenario, f"{v.metric} {v.parameter}", *values, change, spread, _word(v)


def _with_unit(value: float | None, metric: str) -> str:
    return number(value) if value is None else f"{number(value)} {METRICS[metric]}".rstrip()


def _word(v: Verdict) -> str:
    if v.reason == "far":
        return f"{v.verdict}: a run lies far on the other side"
    if v.verdict != UNDECIDED:
        return v.verdict
    seeds = f"about {v.seeds_needed} seeds would do" if v.seeds_needed else ""
    if v.enough is None:
        return f"{UNDECIDED}, {seeds}".rstrip(", ")
    way = BETTER if v.enough < 0 else WORSE
    said = f"{UNDECIDED}: {v.agreeing} runs can say {way} from {percent(v.enough)} % on"
    return f"{said}; {seeds}".rstrip("; ")


def terminal_table(found: Comparison) -> Table:
    """Return the table for a terminal."""
    table = Table(*COLUMNS, box=None, padding=(0, 1, 0, 0), caption_justify="left")
    for v in ordered(found.verdicts):
        table.add_row(*cells(v), style=_STYLE.get(v.verdict))
    table.caption = explanation(found)
    return table


def markdown(found: Comparison) -> str:
    """Return the table as Markdown, for a comment on a change."""
    lines = [
        f"**flexaxis: {headline(found)}**",
        "",
        meaning(found),
        "",
        f"base {_code(found.base)}, candidate {_code(found.candidate)}",
        *(["", _cell(knobs(found))] if found.equal else []),
        "",
        f"| {' | '.join(COLUMNS)} |",
        f"|{'---|' * len(COLUMNS)}",
        *(f"| {' | '.join(map(_cell, cells(v)))} |" for v in ordered(found.verdicts)),
        "",
        explanation(found),
    ]
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Return a text as a cell of a table, as code if anything in it could be taken for markup."""
    plain = re.fullmatch(r"[\w ./+%(),=–…-]*", text) and "www." not in text
    return text if plain else _code(text).replace("|", r"\|")


def _code(text: str) -> str:
    """Return a text as Markdown code, in which nothing is markup, whatever it holds."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    edge = " " if "`" in line else ""
    return f"{fence}{edge}{line}{edge}{fence}"


def row_command(found: Comparison, v: Verdict, sources: Mapping[str, str]) -> str:
    """Return the line that runs base and candidate again where the candidate is worst."""
    estimators = dict.fromkeys((found.base, found.candidate))
    words = ["flexaxis", "run", sources.get(v.worst_scenario, v.worst_scenario)]
    words += [word for text in estimators for word in ("--estimator", text)]
    seed = found.seeds[0] if v.worst_seed is None else v.worst_seed
    return shlex.join([*words, "--seeds", f"{seed}:{seed + 1}"])


def worst(found: Comparison) -> Verdict:
    """Return the verdict to look at first: a lost run, else the change worst for its margin."""

    def harm(v: Verdict) -> tuple[bool, bool, float]:
        more = (v.newly or 0) - (v.regained or 0)
        return v.verdict == WORSE, more > 0, more or (v.change or 0.0) / (v.margin or 1.0)

    return max(ordered(found.verdicts) or found.verdicts, key=harm)


def write(
    folder: Path,
    found: Comparison,
    scenarios: Sequence[Scenario] = (),
    *,
    sources: Mapping[str, str] | None = None,
    command: str = "",
) -> Path:
    """Write compare.json, verdict.md and report.html to a folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    found : Comparison
    scenarios : sequence of Scenario
        What was run; without them nothing is drawn.
    sources : mapping of str to str
        Path of each scenario that is not in the catalogue.
    command : str
        The line that does all of it again.

    Returns
    -------
    Path
        The report.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / MARKDOWN, markdown(found))
    text = _page(found, scenarios, sources or {}, command, Traces.of(folder))
    write_text(folder / REPORT, text)
    # Last: a folder that has none is not complete.
    write_json(folder / JSON, found.as_dict() | {"command": command})
    return folder / REPORT


def _page(
    found: Comparison,
    scenarios: Sequence[Scenario],
    sources: Mapping[str, str],
    command: str,
    traces: Traces,
) -> str:
    focus = worst(found)
    content = {
        "found": found,
        "headline": headline(found),
        "meaning": meaning(found),
        "knobs": knobs(found),
        "explanation": explanation(found),
        "columns": COLUMNS,
        "rows": [
            (v.verdict, cells(v), row_command(found, v, sources)) for v in ordered(found.verdicts)
        ],
        "focus": focus,
        "focus_cells": cells(focus),
        "figure": _drawn(found, focus, {s.name: s for s in scenarios}, traces),
        "command": command,
    }
    return page.render("gate/templates/compare.html", content)


def _drawn(
    found: Comparison, focus: Verdict, scenarios: Mapping[str, Scenario], traces: Traces
) -> str | None:
    """Return the figure of both runs on the worst seed as SVG."""
    scenario = scenarios.get(focus.worst_scenario)
    if scenario is None:
        return None
    sides = {"base": found.base, "candidate": found.candidate}
    curves = []
    for side, text in sides.items():
        case = case_id(scenario.hash, text, focus.worst_seed)
        known = [t for t in traces.find(scenario.hash, text) if t.case == case]
        if not known:
            return None
        curves.append(curve_of(scenario, side, known[0].names, [known[0].curve]))
    labels = {side: f"{side}: {text}" for side, text in sides.items()}
    return figures.svg(figures.trajectories(curves, scenario, labels=labels))
