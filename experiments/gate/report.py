"""A comparison in words, with the verdict first: for the terminal, Markdown, JSON and a page."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.files import REPORT, write_json, write_text
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import KIND, SIDES
from flexaxis.experiments.gate.verdict import ALPHA, BETTER, SAME, SILENT, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.reporting.page import comparison
from flexaxis.experiments.reporting.tables import between, short
from flexaxis.experiments.running.progress import LINE
from flexaxis.experiments.scoring.score_table import METRICS

Row = Mapping[str, Any]

COLUMNS = ("scenario", "score", "base", "candidate", "change", "interval", "verdict")

TEXTS = {
    # by score: more, less
    "lag": ("longer", "shorter"), "t10": ("longer", "shorter"), "else": ("larger", "smaller"),
    # noise beside a lag, by the verdict on the std
    SAME: "same noise", SLIGHT: "same noise", WORSE: "more noise", BETTER: "less noise",
    UNDECIDED: "noise undecided",
    # reasons for undecided
    "far": " (a run lies far on the other side)",
    "few": " (too few runs to exclude rare failures)", "": "",
    # lost runs
    "diverged": "{4} of {1} runs newly diverge, {5} no longer do",
    "never_settled": "{4} of {1} runs newly never settle, {5} settle again",
    # advice
    "unfair": "Not a fair comparison: the {0} estimates {1} too, which costs lag and noise with "
    "any method; the {2} holds them at nominal.",
    "scenarios": "Compare on scenarios that both are run on, and whose faults both estimate.",
    "seeds": "More seeds may decide: --max-seeds.",
    "tuned": "Tuned to the {0} of rpem-forgetting: base {1}, candidate {2}.",
}  # fmt: skip
"""All words that depend on a verdict."""

LEGEND = (
    "{seeds} seeds, paired. Change: candidate over base (geometric mean) in percent, as a factor "
    "beyond 2; with another unit, a difference. A std is about the mean of all runs.",
    "Interval: Student's t of paired log-ratios, at the level of Holm's procedure. A false worse "
    "or better anywhere has a probability of at most {percent:.2g} %.",
    "worse, better: the interval lies beyond the margin ({margins}), and enough runs show it. "
    "slight, same: it lies within.",
    "Lost runs: McNemar's exact test on the runs that one side alone lost, over all scenarios.",
    "Look {look} of {looks}; each has its share of the probability of error.",
)


OWN = ("base", "candidate", "seeds", "look", "looks", "failed", "gaps")


def as_dict(c: Comparison) -> dict[str, Any]:
    """Return the verdict with all tables, for the terminal, the page and compare.json.

    Returns
    -------
    dict
        ``verdict``, one word; ``headline``, one line; ``advice``, lines on what to do next;
        ``columns`` and ``rows``, what matters first, each with its cells as ``text``; ``legend``,
        at most five lines; ``lost``, verdicts on lost runs; ``base, candidate, seeds, look, looks,
        alpha, failed, gaps``; ``equal_noise``, both settings as tuned. The other keys of a row are
        those of `flexaxis.experiments.gate.verdict.judge`.
    """
    rows = c.rows[c.rows["verdict"] != SILENT]  # a bias that is not worse needs no row
    shown = json.loads(rows.to_json(orient="records", double_precision=15))
    margins = ", ".join(f"{name} {100 * margin:g} %" for name, margin in c.margins.items())
    about = {**vars(c), "seeds": len(c.seeds), "percent": 100 * ALPHA / c.looks, "margins": margins}
    return {
        "verdict": c.verdict, "command": LINE.get(), "alpha": ALPHA / c.looks,
        "headline": headline(c, shown),
        "advice": advice(c), "columns": COLUMNS,
        "rows": [row | {"text": cells(row)} for row in shown],
        "legend": [text.format(**about) for text in LEGEND[: 4 + (c.looks > 1)]],
        "lost": [way._asdict() for way in c.lost],
        "equal_noise": [asdict(side) for side in c.equal],
        **{name: getattr(c, name, None) or getattr(c.paired, name, None) for name in OWN},
    }  # fmt: skip


def headline(c: Comparison, shown: Sequence[Row]) -> str:
    """Return "WORSE: lag of f_m at fm_step-v1 is 17 times longer (12–23), same noise"."""
    own, clauses = [row for row in shown if row["verdict"] == c.verdict], []
    if own and c.verdict in {WORSE, BETTER}:
        std = {"metric": "std", **{key: own[0][key] for key in KIND}}
        beside = [TEXTS[row["verdict"]] for row in shown if row.items() >= std.items()]
        beside += ["at equal noise"] * bool(c.equal)
        clauses = [", ".join([sentence(own[0]), *beside * (own[0]["metric"] == "lag")])]
    elif own:
        clauses = [f"{len(own)} of {len(shown)} scores"]
    lost = [way for way in c.lost if way.newly or way.regained]
    clauses += [TEXTS[way.way].format(*way) for way in lost] + [gap.text for gap in c.paired.gaps]  # type: ignore[attr-defined]
    clauses += [f"the {side} failed in {n} runs" for side, n in c.paired.failed.items() if n]
    return f"{c.verdict.upper()}: {'; '.join(clauses) or 'no run has a score on both sides'}"


def _scaled(row: Row) -> tuple[Any, str]:
    """Return the change and the ends of its interval as they are shown, and their unit."""
    numbers = np.array([row["change"], *row["interval"]], float)
    if row["scale"] is not None:
        return numbers, METRICS[row["metric"]]
    return (100 * numbers, "%") if -0.5 < numbers[0] < 1 else (1 + numbers, "times")


def sentence(row: Row) -> str:
    """Return "lag of f_m at fm_step-v1 is 17 times longer (12–23)"."""
    numbers, unit = _scaled(row)
    numbers = abs(numbers ** np.sign(row["change"]) if unit == "times" else numbers)
    word = TEXTS.get(row["metric"], TEXTS["else"])[row["change"] < 0]
    what = f"{row['metric'].replace('_', ' ')} of {row['parameter']} at {row['scenario']}"
    return f"{what} is {short(numbers[0])} {unit} {word} ({between(numbers[1:])})"


def advice(c: Comparison) -> list[str]:
    """Return what limits the comparison, and what to do next."""
    names, lines = c.paired.estimated, []
    for fewer, more in permutations(names, 2):
        if rest := ", ".join(sorted(names[more] - names[fewer])):
            lines.append(TEXTS["unfair"].format(more, rest, fewer))  # type: ignore[attr-defined]
    if c.verdict == UNDECIDED:
        lines.append(TEXTS["scenarios" if c.paired.gaps else "seeds"])
    if c.equal:
        match = c.equal[0].match
        noise = "excess error" if match == "excess" else f"std of {match}"
        lines.append(TEXTS["tuned"].format(noise, c.base, c.candidate))  # type: ignore[attr-defined]
    return lines


def cells(row: Row) -> list[str]:
    """Return a verdict as the texts of a row, in the order of `COLUMNS`."""
    metric, (numbers, unit) = row["metric"].replace("_", " "), _scaled(row)
    change, low, high = map(short, numbers)
    values = (f"{short(row[side])} {METRICS[row['metric']]}".rstrip() for side in SIDES)
    some = f" ({row['pairs']} of {row['runs']} pairs)" * (row["pairs"] < row["runs"])
    within, word = f"{low} … {high} {unit}{some}", row["verdict"] + TEXTS[row["reason"]]
    score = f"{metric} {row['parameter']}"
    return [row["scenario"], score, *values, f"{change} {unit}", within, word]


def markdown(content: Mapping[str, Any]) -> str:
    """Return the comparison as Markdown, for a comment on a change."""
    table = [COLUMNS, ["---"] * len(COLUMNS), *(row["text"] for row in content["rows"])]
    lines = "\n".join(f"| {' | '.join(line)} |" for line in table)
    sides = "base `{base}`, candidate `{candidate}`".format(**content)
    legend = "\n".join(f"- {line}" for line in content["legend"])
    head = f"**flexaxis: {content['headline']}**"
    return "\n\n".join([head, *content["advice"], sides, lines, legend]) + "\n"


def write(folder: Path, content: Mapping[str, Any]) -> Path:
    """Write compare.json, verdict.md and report.html to a folder; return the report."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "verdict.md", markdown(content))
    write_text(folder / REPORT, comparison(content))
    write_json(folder / "compare.json", content)  # last: a folder without it is not complete
    return folder / REPORT
