"""A comparison in words, with the verdict first: for the terminal, Markdown, JSON and a page."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import rich.table

from flexaxis.experiments.files import REPORT, write_json, write_text
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import LOST
from flexaxis.experiments.gate.verdict import BETTER, ORDER, SAME, SILENT, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.reporting.page import comparison as comparison_page
from flexaxis.experiments.running.store import ROWS, Store
from flexaxis.experiments.scoring.curves import estimates, truth
from flexaxis.experiments.scoring.score_table import METRICS
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]

COLUMNS = ("scenario", "score", "base", "candidate", "change", "interval", "verdict")
STYLE = {WORSE: "red", BETTER: "green", UNDECIDED: "yellow"}

WORDS = {
    # by score: more, less
    "lag": ("longer", "shorter"), "t10": ("longer", "shorter"), "score": ("larger", "smaller"),
    # by way to lose a run: newly, no longer
    "diverged": ("newly diverge", "no longer diverge"),
    "never_settled": ("newly never settle", "settle again"),
    # noise beside a lag, by the verdict on the std
    SAME: "same noise", SLIGHT: "same noise", WORSE: "more noise", BETTER: "less noise",
    UNDECIDED: "noise undecided",
    # reasons for undecided
    "far": "a run lies far on the other side", "few": "too few runs to exclude rare failures",
}  # fmt: skip
"""All words that depend on a verdict."""

LEGEND = (
    "{seeds} seeds, paired. Change: candidate over base (geometric mean), × beyond a factor of 2; "
    "Δ is a difference. A std is about the mean of all runs.",
    "Interval: Student's t of paired log-ratios, at the level of Holm's procedure. A false worse "
    "or better anywhere has a probability of at most {percent:.2g} %.",
    "worse, better: the interval lies beyond the margin ({margins}), and enough runs show it. "
    "slight, same: it lies within.",
    "Lost runs: McNemar's exact test on the runs that one side alone lost, over all scenarios.",
    "Look {look} of {looks}; each has its share of the probability of error.",
)


def as_dict(comparison: Comparison, *, sources: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return all there is to say, as it goes to a terminal, a page and compare.json.

    Parameters
    ----------
    comparison : Comparison
    sources : mapping of str to str, optional
        Path of each scenario that is not in the catalogue.

    Returns
    -------
    dict
        ``verdict``, one word; ``headline``, one line; ``advice``, lines on what to do next;
        ``columns`` and ``rows``, what matters first, each with its cells as ``text``; ``legend``,
        at most five lines; ``worst``, the run to look at (``scenario, seed, command``); ``base,
        candidate, seeds, look, looks, alpha, newly_lost, failed, estimated, missing, lacking,
        unmatched, equal_noise``. The other keys of a row are those of
        `flexaxis.experiments.gate.verdict.judge`.
    """
    c, order = comparison, [*ORDER, SILENT]
    every = json.loads(c.rows.to_json(orient="records", double_precision=15))
    # No row is needed where no run was lost, nor for a bias that is not worse.
    shown = [row for row in every if row["verdict"] != SILENT or _lost(row)]
    shown.sort(key=lambda row: order.index(row["verdict"]))
    worst = max(shown or every, key=_harm)
    where, seed = worst["worst_scenario"], int(worst["worst_seed"])
    sides = [w for text in dict.fromkeys((c.base, c.candidate)) for w in ("--estimator", text)]
    words = ["flexaxis", "run", (sources or {}).get(where, where), *sides]
    command = shlex.join([*words, "--seeds", f"{seed}:{seed + 1}"])
    margins = ", ".join(f"{name} {100 * margin:g} %" for name, margin in c.margins.items())
    numbers = {"seeds": len(c.seeds), "percent": 100 * c.alpha, "margins": margins}
    legend = LEGEND[: 4 + (c.looks > 1)]
    return {
        "headline": headline(c, shown), "advice": advice(c, shown), "columns": COLUMNS,
        "rows": [row | {"text": cells(row)} for row in shown],
        "legend": [text.format(look=c.look, looks=c.looks, **numbers) for text in legend],
        "worst": {"scenario": where, "seed": seed, "command": command},
        "lacking": [lack._asdict() for lack in c.paired.lacking],
        "equal_noise": c.equal and asdict(c.equal),
        **{name: getattr(c, name) for name in OWN},
        **{name: getattr(c.paired, name) for name in ("failed", "estimated", "missing")},
    }  # fmt: skip


OWN = ("verdict", "base", "candidate", "seeds", "look", "looks", "alpha", "newly_lost", "unmatched")


def _lost(row: Row) -> bool:
    """Return whether a row counts lost runs, and there are any."""
    return row["metric"] in LOST and bool(row["base"] or row["candidate"])


def _harm(row: Row) -> tuple[bool, float, float]:
    """Return what orders rows by how bad they are: worse ones, lost runs, change over margin."""
    more = (row["newly"] or 0) - (row["regained"] or 0)
    return row["verdict"] == WORSE, max(more, 0), (row["change"] or 0.0) / (row["margin"] or 1.0)


def headline(c: Comparison, shown: Sequence[Row]) -> str:
    """Return "WORSE: lag of f_m at fm_step-v1 is 17 times longer (12–23), same noise"."""
    clauses = [f"{p} at {s} is not estimated by the candidate" for s, p in c.paired.missing]
    clauses += [f"noise of {p} at {s} is not matched" for s, p in c.unmatched]
    clauses += [f"{k.side} lacks {k.cases} cases of {k.scenario}" for k in c.paired.lacking]
    clauses += [f"{side} failed in {n} runs" for side, n in c.paired.failed.items() if n]
    told = [row for row in shown if _lost(row) and (row["newly"] or row["regained"])]
    told = told or [row for row in shown if _lost(row) and c.verdict == SAME]
    clauses += [_lost_sentence(row) for row in told]
    scores = [row for row in shown if row["metric"] not in LOST]
    own = [row for row in scores if row["verdict"] == c.verdict]
    if c.verdict in {WORSE, BETTER} and own:
        first = max(own, key=lambda row: abs(row["change"]) / row["margin"])
        more = f", and {len(own) - 1} more of {len(scores)} scores" if len(own) > 1 else ""
        clauses.append(_sentence(first) + _noise(c, first) + more)
    elif own:
        what = {UNDECIDED: "undecided", SLIGHT: "differ, within the margins"}.get(
            c.verdict, "agree"
        )
        clauses.append(f"{len(own)} of {len(scores)} scores {what}")
    return f"{c.verdict.upper()}: {'; '.join(clauses) or 'no run has a score on both sides'}"


def _lost_sentence(row: Row) -> str:
    words = WORDS[row["metric"]]
    both = zip((row["newly"], row["regained"]), words, strict=True)
    parts = [f"{count:.0f} {word}" for count, word in both if count]
    same = f"the same {row['base']:.0f} {words[0].removeprefix('newly ')} on both sides"
    return f"of {row['runs']} runs, {' and '.join(parts) or same}"


def _sentence(row: Row) -> str:
    """Return "lag of f_m at fm_step-v1 is 17 times longer (12–23)"."""
    change, ends, unit = row["change"], np.array(row["interval"]), row["unit"]
    word = WORDS.get(row["metric"], WORDS["score"])[change < 0]
    if unit is None and 0.5 < 1 + change < 2:
        change, ends, unit = 100 * change, 100 * ends, "%"
    elif unit is None:
        power = -1 if change < 0 else 1
        change, ends, unit = (1 + change) ** power, (1 + ends) ** power, "times"
    low, high = (_digits(end) for end in sorted(abs(ends)))
    name, within = row["metric"].replace("_", " "), f"{low}–{high}{' %' if unit == '%' else ''}"
    what = f"{name} of {row['parameter']} at {row['scenario']}"
    return f"{what} is {_digits(abs(change))} {unit} {word} ({within})"


def _noise(c: Comparison, row: Row) -> str:
    """Return what is known of the noise beside a lag."""
    if c.equal:
        return ", at equal noise"
    rows = c.rows.set_index(["scenario", "parameter", "metric"])["verdict"]
    std = rows.get((row["scenario"], row["parameter"], "std"))
    return f", {WORDS[std]}" if std and row["metric"] == "lag" else ""


def advice(c: Comparison, shown: Sequence[Row]) -> list[str]:
    """Return what limits the comparison, and what to do next."""
    lines, names = [], {side: {*each} for side, each in c.paired.estimated.items()}
    for fewer, more in permutations(names, 2):
        if rest := names[more] - names[fewer]:
            lines.append(
                f"Not a fair comparison: the {more} estimates {', '.join(sorted(rest))} too, which "
                f"costs lag and noise with any method; the {fewer} holds them at nominal."
            )
    scores = [r for r in shown if r["verdict"] == UNDECIDED and r["metric"] not in LOST]
    enough = max((row["seeds_needed"] or np.inf for row in scores), default=np.inf)
    if c.paired.missing or c.unmatched or c.paired.lacking:
        lines.append("Compare on scenarios that both are run on, and whose faults both estimate.")
    elif c.verdict == UNDECIDED:
        about = f"About {enough:.0f} seeds would decide" if enough < np.inf else "Add seeds"
        lines.append(f"{about} (--max-seeds), or look at the worst run.")
    if c.equal:
        what = "excess error" if c.equal.match == "excess" else f"std of {c.equal.match}"
        left = f" Not on {', '.join(c.equal.left_out)}." if c.equal.left_out else ""
        both = f"base {c.base}, candidate {c.candidate}"
        lines.append(f"Tuned to the {what} of rpem-forgetting: {both}.{left}")
    return lines


def cells(row: Row) -> list[str]:
    """Return a verdict as the texts of a row, in the order of `COLUMNS`."""
    needed, metric = row["seeds_needed"], row["metric"]
    why = [WORDS.get(row["reason"]), f"about {needed:.0f} seeds" if needed else None]
    word = f"{row['verdict']} ({'; '.join(str(text) for text in why if text)})"
    word, sides = word.replace(" ()", ""), (row["base"], row["candidate"])
    where = [row["scenario"], f"{metric.replace('_', ' ')} {row['parameter']}".strip()]
    if metric in LOST:
        runs = [f"{lost:.0f} of {row['runs']}" for lost in sides]
        more = f"{row['newly']:.0f} new, {row['regained']:.0f} back, p = {row['p']:.2g}"
        return [*where, *runs, "", more, word]
    if not row["pairs"]:
        return [*where, "–", "–", "–", f"no pairs of {row['runs']}", word]
    values = [f"{value:.3g} {METRICS[metric]}".rstrip() for value in sides]
    if row["bias"] is not None:
        values = [f"{v}, bias {b:.2g}" for v, b in zip(values, row["bias"], strict=True)]
    within = _change(row["interval"], row["unit"]) if row["pairs"] > 1 else "–"
    if row["pairs"] < row["runs"]:
        within += f" ({row['pairs']} of {row['runs']} pairs)"
    return [*where, *values, _change([row["change"]], row["unit"]), within, word]


def _change(changes: Sequence[float], unit: str | None) -> str:
    """Return changes as percent, as ratios beyond a factor of 2, or as differences.

    Examples
    --------
    >>> _change([0.0213], None), _change([11.0, 22.0], None), _change([0.02], "s")
    ('+2.1 %', '×12 … ×23', 'Δ +0.02 s')
    """
    if unit is not None:
        return f"Δ {' … '.join(f'{change:+.2g}' for change in changes)} {unit}".rstrip()
    if any(not 0.5 < 1 + change < 2 for change in changes):
        return " … ".join(f"×{_digits(1 + change)}" for change in changes)
    return " … ".join(f"{'+' if c > 0 else '−' if c < 0 else ''}{_digits(abs(100 * c))}"
                      for c in changes) + " %"  # fmt: skip


def _digits(value: float) -> str:
    """Return a number with two digits, or all before the point."""
    return f"{value:.0f}" if 10 <= value < 1e6 else f"{value:.2g}"


def terminal_table(content: Mapping[str, Any]) -> rich.table.Table:
    """Return the rows as a table for a terminal."""
    table = rich.table.Table(*COLUMNS, box=None, padding=(0, 1, 0, 0))
    for row in content["rows"]:
        table.add_row(*row["text"], style=STYLE.get(row["verdict"]))
    return table


def markdown(content: Mapping[str, Any]) -> str:
    """Return the comparison as Markdown, for a comment on a change."""
    table = [COLUMNS, ["---"] * len(COLUMNS), *(row["text"] for row in content["rows"])]
    lines = [" | ".join(text.replace("|", "\\|") for text in line) for line in table]
    head = [f"**flexaxis: {content['headline']}**", *content["advice"]]
    sides = f"base `{content['base']}`, candidate `{content['candidate']}`"
    legend = "\n".join(f"- {line}" for line in content["legend"])
    return "\n\n".join([*head, sides, "\n".join(f"| {line} |" for line in lines), legend]) + "\n"


def worst_run(
    folder: Path, content: Mapping[str, Any], scenario: Scenario
) -> dict[str, Any] | None:
    """Return the estimates of both sides in the worst run, None if no traces are stored.

    Parameters
    ----------
    folder : Path
        Folder of the comparison, which holds the traces.
    content : mapping
        As from `as_dict`.
    scenario : Scenario
        The scenario of the worst run.

    Returns
    -------
    dict or None
        ``parameter``, and over nominal ``time, base, candidate, truth`` (M,).
    """
    if not (folder / ROWS).exists():
        return None
    rows = [row for row in content["rows"] if row["worst_scenario"] == scenario.name]
    parameter = next((row["parameter"] for row in rows if row["parameter"]), scenario.identify[0])
    store = Store.read(folder)
    runs: dict[str, Any] = {"parameter": parameter}
    for side in ("base", "candidate"):
        case = store.traces(scenario.hash, content[side]).get(content["worst"]["seed"])
        if case is None or parameter not in case.names:
            return None
        values = estimates({0: case}, scenario, parameter)[0]
        runs |= {"time": values.index, side: values}
    return runs | {"truth": truth(scenario, parameter).loc[runs["time"]]}


def write(folder: Path, content: Mapping[str, Any], scenarios: Sequence[Scenario] = ()) -> Path:
    """Write compare.json, verdict.md and report.html to a folder; return the report.

    The page shows the worst run over time if it is of one of the scenarios.
    """
    known = {scenario.name: scenario for scenario in scenarios}
    scenario = known.get(content["worst"]["scenario"])
    worst = worst_run(folder, content, scenario) if scenario else None
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "verdict.md", markdown(content))
    write_text(folder / REPORT, comparison_page(content, worst))
    write_json(folder / "compare.json", dict(content))  # last: a folder without it is not complete
    return folder / REPORT
