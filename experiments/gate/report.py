"""Write the result of a comparison for the terminal and as Markdown, JSON and HTML."""

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
    # comparatives for each score: for an increase, for a decrease
    "lag": ("longer", "shorter"), "t10": ("longer", "shorter"), "else": ("larger", "smaller"),
    # noise reported with a lag, keyed by the verdict on the std
    SAME: "same noise", SLIGHT: "same noise", WORSE: "more noise", BETTER: "less noise",
    UNDECIDED: "noise undecided",
    # reasons for the verdict "undecided"
    "far": " (at least one run is much worse)",
    "few": " (too few runs to exclude rare failures)", "": "",
    # lost runs
    "diverged": "{4} of {1} runs newly diverge, and {5} runs no longer diverge",
    "never_settled": "{4} of {1} runs no longer settle, and {5} runs newly settle",
    # advice
    "unfair": "The comparison is not fair: the {0} also estimates {1}, but the {2} uses the "
    "nominal values of {1}. Estimating more parameters increases the lag and the noise of any "
    "method.",
    "scenarios": "Compare the estimators on scenarios with faults in parameters that both of them "
    "can estimate.",
    "traded": "One estimator is faster, and the other has less noise. Use --match-std to compare "
    "the lags at equal noise.",
    "seeds": "Use --max-seeds to add more seeds, which can lead to a clear verdict.",
    "tuned": "Both estimators were tuned to the {0} of rpem-forgetting: base {1}, candidate {2}.",
}  # fmt: skip
"""Phrases for the headline and the advice in a comparison report."""

LEGEND = (
    "The results are based on {seeds} common seeds. The change is computed from the geometric mean "
    "of candidate/base, and shown in percent or as a factor. For a bias, the change is the "
    "difference candidate − base. A standard deviation (std) is computed around the mean of all "
    "runs.",
    "The interval of a change is Student's t interval for the mean log-ratio, at the confidence "
    "level that Holm's procedure determines. The probability of any false verdict "
    '"worse" or "better" is at most {percent:.2g} %.',
    'The verdict is "worse" or "better" if the interval lies outside the margin ({margins}) and '
    'enough runs confirm the change. The verdict is "slight" or "same" if the interval lies inside '
    "the margin.",
    "McNemar's exact test compares the numbers of runs that diverge or never settle.",
    "The result is interim analysis {look} of {looks}; each analysis uses an equal share of the "
    "probability of a false verdict.",
)


OWN = ("base", "candidate", "seeds", "look", "looks", "failed", "gaps")


def as_dict(c: Comparison) -> dict[str, Any]:
    """Return the verdict and all tables for the terminal, the HTML page and compare.json.

    Returns
    -------
    dict
        ``verdict`` is one word, ``headline`` is one line, and ``advice`` is a list of lines with
        suggestions. ``columns`` contains the headings of the score table. ``rows`` contains the
        rows of the score table, with the most important row first. The keys of a row are the
        columns from `flexaxis.experiments.gate.verdict.judge`, and ``text``, which contains the
        formatted table cells. ``legend`` contains at most five lines that explain the table.
        ``lost`` contains the verdicts on diverged and unsettled runs. ``equal_noise`` contains the
        tuned settings of both estimators. ``base, candidate, seeds, look, looks, alpha, failed,
        gaps`` describe the comparison.
    """
    rows = c.rows[c.rows["verdict"] != SILENT]  # omit biases that are not worse
    shown = json.loads(rows.to_json(orient="records", double_precision=15))
    margins = ", ".join(f"{name} {100 * margin:g} %" for name, margin in c.margins.items())
    about = {**vars(c), "seeds": len(c.seeds), "percent": 100 * ALPHA, "margins": margins}
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
    """Return a line such as "WORSE: lag of f_m on fm_step-v1 is 17 times longer, same noise"."""
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
    return f"{c.verdict.upper()}: {'; '.join(clauses) or 'the estimators have no common score'}"


def _scaled(row: Row) -> tuple[Any, str]:
    """Return an array (3,) of a score change and the ends of its interval, and the display unit."""
    numbers = np.array([row["change"], *row["interval"]], float)
    if row["scale"] is not None:
        return numbers, METRICS[row["metric"]]
    return (100 * numbers, "%") if -0.5 < numbers[0] < 1 else (1 + numbers, "times")


def sentence(row: Row) -> str:
    """Describe a change in words, such as "lag of f_m on fm_step-v1 is 17 times longer (12–23)"."""
    numbers, unit = _scaled(row)
    numbers = abs(numbers ** np.sign(row["change"]) if unit == "times" else numbers)
    word = TEXTS.get(row["metric"], TEXTS["else"])[row["change"] < 0]
    what = f"{row['metric'].replace('_', ' ')} of {row['parameter']} on {row['scenario']}"
    return f"{what} is {short(numbers[0])} {unit} {word} ({between(numbers[1:])})"


def advice(c: Comparison) -> list[str]:
    """Return lines that describe weaknesses of the comparison and suggest a next step."""
    names, lines = c.paired.estimated, []
    for fewer, more in permutations(names, 2):
        if rest := ", ".join(sorted(names[more] - names[fewer])):
            lines.append(TEXTS["unfair"].format(more, rest, fewer))  # type: ignore[attr-defined]
    found = {*zip(c.rows["metric"], c.rows["verdict"], strict=True)}
    if any({("lag", a), ("std", b)} <= found for a, b in permutations((BETTER, WORSE))):
        lines.append(TEXTS["traded"])
    if c.verdict == UNDECIDED:
        lines.append(TEXTS["scenarios" if c.paired.gaps else "seeds"])
    if c.equal:
        match = c.equal[0].match
        noise = "excess error" if match == "excess" else f"std of {match}"
        lines.append(TEXTS["tuned"].format(noise, c.base, c.candidate))  # type: ignore[attr-defined]
    return lines


def cells(row: Row) -> list[str]:
    """Return the formatted cells of a table row, in the order of `COLUMNS`."""
    metric, (numbers, unit) = row["metric"].replace("_", " "), _scaled(row)
    change, low, high = map(short, numbers)
    values = (f"{short(row[side])} {METRICS[row['metric']]}".rstrip() for side in SIDES)
    some = f" ({row['pairs']} of {row['runs']} pairs)" * (row["pairs"] < row["runs"])
    within, word = f"{low} … {high} {unit}{some}", row["verdict"] + TEXTS[row["reason"]]
    score = f"{metric} {row['parameter']}"
    return [row["scenario"], score, *values, f"{change} {unit}", within, word]


def markdown(content: Mapping[str, Any]) -> str:
    """Return the comparison as Markdown, for a comment on a pull request."""
    table = [COLUMNS, ["---"] * len(COLUMNS), *(row["text"] for row in content["rows"])]
    lines = "\n".join(f"| {' | '.join(line)} |" for line in table)
    sides = "base `{base}`, candidate `{candidate}`".format(**content)
    legend = "\n".join(f"- {line}" for line in content["legend"])
    head = f"**flexaxis: {content['headline']}**"
    return "\n\n".join([head, *content["advice"], sides, lines, legend]) + "\n"


def write(folder: Path, content: Mapping[str, Any]) -> Path:
    """Write compare.json, verdict.md and report.html to a folder; return the path of the report."""
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "verdict.md", markdown(content))
    write_text(folder / REPORT, comparison(content))
    write_json(folder / "compare.json", content)  # last, to mark the folder as complete
    return folder / REPORT
