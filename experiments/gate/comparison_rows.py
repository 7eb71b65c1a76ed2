"""The rows of a comparison: what matters first, each as texts, with the line that runs it again."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from flexaxis.experiments.gate.decide import BETTER, SAME, SILENT, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.margins import METRICS
from flexaxis.experiments.gate.pairs import LOST
from flexaxis.experiments.gate.verdicts import Verdict
from flexaxis.experiments.gate.words import change_of, percent
from flexaxis.experiments.reporting.tables import number

COLUMNS = ("scenario", "score", "base", "candidate", "change", "interval [%]", "verdict")
ORDER = (WORSE, UNDECIDED, BETTER, SLIGHT, SAME, SILENT)


def ordered(verdicts: Sequence[Verdict]) -> list[Verdict]:
    """Return the verdicts with what matters first.

    No row is needed where no run was lost; a bias that is not worse stands beside the deviation.
    """
    shown = [v for v in verdicts if v.verdict != SILENT or v.base or v.candidate]
    shown = [v for v in shown if v.verdict != SILENT or v.metric in LOST]
    return sorted(shown, key=lambda v: ORDER.index(v.verdict))


def cells(v: Verdict) -> tuple[str, ...]:
    """Return a verdict as the texts of a row, in the order of `COLUMNS`."""
    if v.metric in LOST:
        runs = (f"{v.base:.0f} of {v.runs}", f"{v.candidate:.0f} of {v.runs}")
        more = f"{v.newly} new, {v.regained} back, p = {v.p:.2g}"
        return v.scenario, v.metric.replace("_", " "), *runs, "", more, _word(v)
    spread = "–"
    if v.interval and v.unit is None:
        spread = " … ".join(map(percent, v.interval))
    elif v.interval:
        spread = f"Δ {v.interval[0]:+.2g} … {v.interval[1]:+.2g} {v.unit}".rstrip()
    if v.pairs < v.runs:
        spread += f" ({v.pairs} of {v.runs} pairs)"
    change = "–" if v.change is None else change_of(v, v.change)
    values = [_with_unit(value, v.metric) for value in (v.base, v.candidate)]
    if v.bias is not None:
        values = [f"{x}, bias {number(b, 2)}" for x, b in zip(values, v.bias, strict=True)]
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
    said = f"{UNDECIDED}: {v.agreeing} runs can say {way} from {change_of(v, v.enough)} on"
    return f"{said}; {seeds}".rstrip("; ")


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
