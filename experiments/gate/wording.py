"""A comparison in words: the line on top, what it means, its rows with what matters first."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.gate.decide import BETTER, SAME, SILENT, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import LOST
from flexaxis.experiments.gate.verdicts import VERDICTS, Verdict
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.scoring.score_table import METRICS
from flexaxis.experiments.studies.tuning import EXCESS

LOST_WORDS = {"diverged": "diverge", "never_settled": "never settle"}

MEANING = {
    WORSE: "A regression: what is called worse is so by more than its margin, or more runs are "
    "lost than chance would lose.",
    BETTER: "An improvement by more than the margin, and nothing else is worse or undecided.",
    SLIGHT: "There is a difference, but all of it is smaller than the margins, which say what "
    "matters.",
    SAME: "Every difference is smaller than the margins, which say what matters.",
}


def headline(found: Comparison) -> str:
    """Return the verdict in a line: its word, the lost runs, then what each word is said of."""
    clauses = [f"{p} of {s} is not estimated" for s, p in found.paired.missing]
    clauses += [f"{p} of {s} is not matched" for s, p in found.unmatched]
    clauses += [
        f"{k.side} not run on {k.cases} cases of {k.scenario}" for k in found.paired.lacking
    ]
    clauses += _failed(found)
    clauses += [_lost(v) for v in found.verdicts if v.metric in LOST and (v.base or v.candidate)]
    for word in VERDICTS:
        for metric in METRICS:
            of_metric = [v for v in found.verdicts if v.metric == metric]
            said = [v for v in of_metric if v.verdict == word]
            if said:
                clauses.append(_scores(metric, word, said, len(of_metric)))
    clauses += _unlike(found)
    word = f"{found.verdict} at equal noise" if found.equal else found.verdict
    return f"{word}: {', '.join(clauses) or 'no run has a score on both sides'}"


def _unlike(found: Comparison) -> list[str]:
    """Return what each side estimates, where that is not the same."""
    base, candidate = found.paired.estimated
    if {*base} == {*candidate}:
        return []
    alone = " alone" if len(candidate) == 1 else ""
    return [f"candidate estimates {', '.join(candidate)}{alone}; the base {', '.join(base)}"]


def _failed(found: Comparison) -> list[str]:
    sides = zip(("base", "candidate"), found.paired.failed, strict=True)
    return [f"{side} failed in {count} run{'s'[: count != 1]}" for side, count in sides if count]


def _lost(v: Verdict) -> str:
    how = LOST_WORDS[v.metric]
    if not (v.newly or v.regained):
        return f"the same {v.base} of {v.runs} runs {how} on both sides"
    what = f"{v.newly} of {v.runs} runs newly {how}"
    return what + (f" and {v.regained} no longer do" if v.regained else "")


def _scores(metric: str, word: str, said: Sequence[Verdict], number: int) -> str:
    text = f"{metric.replace('_', ' ')} {word} in {len(said)} of {number} score{'s'[: number - 1]}"
    if word not in (WORSE, BETTER):
        return text
    most = max(said, key=lambda v: abs(v.change or 0.0) / (v.margin or 1.0))
    where = f"{most.parameter} in {most.scenario}, {change_of(most, most.change or 0.0)}"
    return f"{text} ({'most: ' if len(said) > 1 else ''}{where})"


def meaning(found: Comparison) -> str:
    """Return what the verdict means, what can be done, and what is not alike in the two."""
    return " ".join([_meaning(found), *_told(found)])


def _told(found: Comparison) -> list[str]:
    """Return what it makes of a verdict that one side estimates less than the other."""
    base, candidate = ({*names} for names in found.paired.estimated)
    if base == candidate or not (base < candidate or candidate < base):
        return []
    fewer, rest = (
        ("candidate", base - candidate) if candidate < base else ("base", candidate - base)
    )
    given = [name for names in found.paired.estimated for name in names if name in rest]
    return [
        f"The {fewer} holds {', '.join(dict.fromkeys(given))} at nominal, and the "
        "other estimates them as well, which costs lag and noise with any method: this compares "
        "more than methods."
    ]


def _meaning(found: Comparison) -> str:
    if found.verdict != UNDECIDED:
        return MEANING[found.verdict]
    if said := _not_compared(found):
        return said
    if found.must_look:
        return (
            f"{found.newly_lost} runs newly lost: too many to pass, too few to be sure. Look at "
            "them, or add seeds (--max-seeds)."
        )
    undecided = [v for v in found.verdicts if v.verdict == UNDECIDED]
    if undecided and all(v.metric not in LOST and v.pairs < 2 for v in undecided):
        return "Hardly a run is left that both sides finished: the scores cannot be compared."
    reasons = [text for text in (_far(undecided), _needed(undecided)) if text]
    return " ".join(["These seeds do not tell.", *reasons])


def _not_compared(found: Comparison) -> str:
    """Return where one side has nothing to compare, and what can be done."""
    if found.paired.lacking:
        what = ", ".join(dict.fromkeys(lack.scenario for lack in found.paired.lacking))
        return (
            f"Only one side was run on all of {what}, and of a scenario that is not run nothing is "
            "the same: run both there, or name the scenarios to compare on."
        )
    if found.paired.missing:
        what = ", ".join(dict.fromkeys(parameter for _, parameter in found.paired.missing))
        return (
            f"The candidate does not estimate all that changes ({what}): choose scenarios whose "
            "faults both estimate."
        )
    if found.unmatched:
        what = ", ".join(dict.fromkeys(scenario for scenario, _ in found.unmatched))
        return (
            f"The candidate is not as noisy as the base at any turn of its knob near {what}: "
            "`flexaxis tune --sweep` draws both over all of it."
        )
    return ""


def _far(undecided: Sequence[Verdict]) -> str:
    far = [v for v in undecided if v.reason == "far"]
    if not far:
        return ""
    return (
        f"What looks better in {far[0].metric.replace('_', ' ')} has a run far on the other side "
        f"(look at seed {far[0].worst_seed} of {far[0].worst_scenario})."
    )


def _needed(undecided: Sequence[Verdict]) -> str:
    needed = [v.seeds_needed for v in undecided]
    if not needed:
        return ""
    if None in needed:
        return "More seeds may (--max-seeds); for some scores it cannot be said how many."
    return f"About {max(n for n in needed if n is not None)} would (--max-seeds)."


def knobs(found: Comparison) -> str:
    """Return what knob each side got, where both were tuned to one noise; else nothing."""
    equal = found.equal
    if equal is None:
        return ""
    what = "the excess prediction error" if equal.match == EXCESS else f"the std of {equal.match}"
    sides = " and ".join(
        f"{name} {side.setting} ({side.ratio:.3f})"
        for name, side in (("base", equal.base), ("candidate", equal.candidate))
    )
    return (
        f"Tuned to {what} of {REFERENCE} on seeds {equal.seeds[0]} to {equal.seeds[-1]}: {sides} "
        "times its noise. What is left of a difference on the seeds compared is taken off."
        + (f" Not on {', '.join(equal.left_out)}, where none has it." if equal.left_out else "")
    )


def explanation(found: Comparison) -> str:
    """Return how the numbers are to be read."""
    text = (
        f"Seeds: {len(found.seeds)} common to both. Change: geometric mean of candidate/base; "
        "with a Δ the mean difference, in its unit, of what may be 0. A std is about the mean of "
        "all runs, the bias. "
        "Intervals: Student's t on paired log-ratios, each for its score alone, at the level that "
        f"Holm's procedure gives it; a false worse or better anywhere has a chance of at most "
        f"{100 * found.alpha:.3g} %, and of about twice that where runs fail rarely. Worse or "
        "better: the whole interval lies beyond the margin, and runs enough show it: what happens "
        "rarely may be in none of a few. Slight: there, but within the margin. Lost runs: exact "
        "test (McNemar's) on the runs that only one side lost, over all scenarios."
    )
    if found.looks > 1:
        text += f" Look {found.look} of {found.looks}, each with its share of the error."
    return text


def change_of(v: Verdict, change: float) -> str:
    """Return a change in per cent of the base, or with a Δ in its unit, as a difference.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> change_of(SimpleNamespace(unit="s"), 0.0213), change_of(SimpleNamespace(unit=None), 0.0213)
    ('Δ +0.021 s', '+2.1 %')
    """
    return f"{percent(change)} %" if v.unit is None else f"Δ {change:+.2g} {v.unit}".rstrip()


def percent(share: float) -> str:
    """Return a change in per cent, with its sign and two digits or more.

    Examples
    --------
    >>> percent(0.0213), percent(-0.5), percent(0.0), percent(300.0)
    ('+2.1', '-50', '0', '+3e+04')
    """
    value = 100 * share
    if value == 0:
        return "0"
    if abs(value) < 10:
        return f"{value:+.2g}"
    return f"{value:+.0f}" if abs(value) < 1e4 else f"{value:+.0e}"


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
