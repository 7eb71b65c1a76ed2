"""Run base and candidate on common seeds, look, and add seeds until it is decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from flexaxis.experiments.catalogue.find import find_suite, suite_names
from flexaxis.experiments.gate.decide import ALPHA, SAME, SLIGHT, UNDECIDED, WORSE
from flexaxis.experiments.gate.equal_noise import SEEDS, EqualNoise, at_one_noise, work
from flexaxis.experiments.gate.pairs import Lack, Paired, ScoreRows, pair, table
from flexaxis.experiments.gate.verdicts import (
    Verdict,
    alarming,
    by_metric,
    judge,
    newly_lost,
    overall,
)
from flexaxis.experiments.running.run import Runner, check_failures
from flexaxis.experiments.studies.bench import Bench, Runs
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

SUITE = "gate"
"""What is compared on where nothing is named."""


@dataclass(frozen=True)
class Question:
    """What is compared.

    Attributes
    ----------
    base, candidate : str
        Texts as for `--estimator`.
    scenarios : sequence of Scenario
    seeds : sequence of int
        Of the first look.
    margins : mapping of metric to float
    max_seeds : int
        Seeds that may be spent; more than those of the first look make the gate sequential.
    alpha : float
        Chance of any false alarm, at most, over all looks.
    equal : EqualNoise, optional
        The settings that `base` and `candidate` are; then noise is equal, and not judged.
    lacking : tuple of Lack
        Scenarios that were asked for besides, and that one side alone can read.
    """

    base: str
    candidate: str
    scenarios: Sequence[Scenario]
    seeds: Sequence[int]
    margins: Mapping[str, float]
    max_seeds: int = 0
    alpha: float = ALPHA
    equal: EqualNoise | None = None
    lacking: tuple[Lack, ...] = ()

    def looks(self) -> list[list[int]]:
        """Return the seeds of each look: the first ones, then twice as many, up to the most.

        The looks are fixed beforehand, so that each can have its share of `alpha`.
        """
        first, number = list(self.seeds), len(self.seeds)
        counts = look_counts(number, self.max_seeds)
        everything = first + [first[-1] + 1 + i for i in range(counts[-1] - number)]
        return [everything[:count] for count in counts]

    def most(self, *, match_std: bool = False) -> int:
        """Return how many cases it takes at most."""
        last, scenarios = len(self.looks()[-1]), len(self.scenarios)
        more = work(scenarios, len(self.seeds), last) if match_std else 0
        return last * scenarios * len({self.base, self.candidate}) + more


def default_seeds(names: Sequence[str]) -> int:
    """Return how many seeds a comparison has: those of the suites named, else of the gate's."""
    suites = [find_suite(name) for name in names if name in suite_names()]
    return max(suite.seeds for suite in suites or [find_suite(SUITE)])


def look_counts(first: int, most: int) -> list[int]:
    """Return how many seeds each look has: the first ones, then twice as many, up to the most.

    Examples
    --------
    >>> look_counts(8, 40), look_counts(32, 0)
    ([8, 16, 32, 40], [32])
    """
    counts = [first]
    while counts[-1] < most:
        counts.append(min(2 * counts[-1], most))
    return counts


@dataclass(frozen=True, eq=False)
class Comparison:
    """What came out.

    Attributes
    ----------
    base, candidate : str
    seeds : list of int
        Those used.
    look, looks : int
        At which look it was decided, of how many planned.
    alpha : float
        Chance of a false alarm at each look, at most.
    verdicts : list of Verdict
    paired : Paired
        What they are of. Where the candidate does not estimate what changes, or one side alone was
        run, nothing can be called the same, and where the candidate lacks it nothing better.
    equal : EqualNoise, optional
        The settings that both are, where they were tuned to one noise first.
    unmatched : tuple of (scenario, parameter)
        Where the candidate is as noisy as the base at no turn of its knob that was tried.
    """

    base: str
    candidate: str
    seeds: list[int]
    look: int
    looks: int
    alpha: float
    verdicts: list[Verdict]
    paired: Paired = field(default_factory=Paired)
    equal: EqualNoise | None = None
    unmatched: tuple[tuple[str, str], ...] = ()

    @property
    def verdict(self) -> str:
        """The one word: worse, undecided, better, slight or same."""
        word = overall(self.verdicts)
        if self.paired.missing or self.unmatched or self.lacks("candidate"):
            return word if word == WORSE else UNDECIDED
        return UNDECIDED if self.lacks("base") and word in {SLIGHT, SAME} else word

    def lacks(self, side: str) -> bool:
        """Return whether a side ("base", "candidate") was not run where the other was."""
        return any(lack.side == side for lack in self.paired.lacking)

    @property
    def newly_lost(self) -> int:
        """How many runs more the candidate lost than the base."""
        return newly_lost(self.verdicts)

    def status(self, *, strict: bool = False) -> int:
        """Return the exit status: 1 worse; 3 undecided, if `strict` or somebody must look; else 0.

        That is where two runs or more were newly lost, or a run newly failed, or rows of the
        candidate are not there.
        """
        if self.verdict == UNDECIDED:
            return 3 if strict or self.must_look else 0
        return int(self.verdict == WORSE)

    @property
    def must_look(self) -> bool:
        """Whether what is undecided may not pass."""
        base, candidate = self.paired.failed
        gone = any(k.side == "candidate" and not k.unreadable for k in self.paired.lacking)
        return alarming(self.verdicts) or candidate > base or gone

    def as_dict(self) -> dict[str, Any]:
        """Return what goes into compare.json."""
        paired = self.paired
        return {
            "verdict": self.verdict,
            "newly_lost": self.newly_lost,
            "missing": [list(kind) for kind in paired.missing],
            "lacking": [lack._asdict() for lack in paired.lacking],
            "failed": dict(zip(("base", "candidate"), paired.failed, strict=True)),
            "estimated": dict(zip(("base", "candidate"), map(list, paired.estimated), strict=True)),
            "equal_noise": self.equal and self.equal.as_dict(),
            "unmatched": [list(kind) for kind in self.unmatched],
            "by_metric": by_metric(self.verdicts),
            "base": self.base,
            "candidate": self.candidate,
            "seeds": self.seeds,
            "look": self.look,
            "looks": self.looks,
            "alpha": self.alpha,
            "rows": [asdict(v) for v in self.verdicts],
        }


def at_equal_noise(question: Question, bench: Bench) -> Question:
    """Return a question of the settings at which both are as noisy as the reference.

    Raises
    ------
    FlexaxisError
        As from `at_one_noise`, and where seeds are asked for that the tuning uses.
    """
    if used := set(SEEDS) & set(question.looks()[-1]):
        raise FlexaxisError(
            f"seeds: the knobs are tuned on seeds {SEEDS[0]} to {SEEDS[-1]}, and what was chosen "
            f"on {min(used)} cannot be judged there: give others, such as 1000:1032"
        )
    seeds = SEEDS[: max(2, len(question.seeds))]
    equal = at_one_noise(question.base, question.candidate, question.scenarios, bench, seeds)
    base, candidate = equal.base.setting, equal.candidate.setting
    return replace(question, base=base, candidate=candidate, equal=equal)


def compare(question: Question, bench: Bench, *, match_std: bool = False) -> Comparison:
    """Run both estimators and judge every score, if asked at equal noise.

    With more seeds allowed than the first look has, looks follow until a regression is found,
    nothing is undecided, or the seeds are spent. K looks have alpha/K each (Bonferroni), so that
    looking again does not raise the rate of false alarms.

    Parameters
    ----------
    question : Question
    bench : Bench
        Where the cases are run.

    Raises
    ------
    FlexaxisError
        If there are fewer than two seeds, more than `max_seeds`, or nothing in common; else as
        from `Bench.runs`.
    """
    if len(question.seeds) < 2:
        raise FlexaxisError("one seed has no spread: give at least 2 seeds, better 32")
    if question.max_seeds and question.max_seeds < len(question.seeds):
        raise FlexaxisError(
            f"--max-seeds {question.max_seeds} is less than the {len(question.seeds)} seeds to "
            "begin with: give more, or fewer of those"
        )
    if match_std:
        question = at_equal_noise(question, bench)
    looks, both = question.looks(), (question.base, question.candidate)
    for number, seeds in enumerate(looks, start=1):
        runs = bench.with_failed(question.scenarios, both, seeds)
        base, candidate = (rows_of(runs, text) for text in both)
        for side in (base, candidate):
            if side["failed"].all():  # a crash, and no verdict
                check_failures(side)
        paired = pair(base, candidate, question.margins)
        paired = replace(paired, lacking=(*question.lacking, *paired.lacking))
        unmatched: tuple[tuple[str, str], ...] = ()
        if question.equal is not None:
            paired, unmatched = question.equal.apply(paired, question.scenarios, bench, seeds)
        found = Comparison(
            *both,
            seeds=seeds,
            look=number,
            looks=len(looks),
            alpha=question.alpha / len(looks),
            verdicts=judge(paired, question.margins, alpha=question.alpha / len(looks)),
            paired=paired,
            equal=question.equal,
            unmatched=unmatched,
        )
        if overall(found.verdicts) != UNDECIDED:
            break
    return found


def ask(  # noqa: PLR0917
    base: str,
    candidate: str,
    scenarios: Sequence[Scenario],
    seeds: Sequence[int],
    margins: Mapping[str, float],
    max_seeds: int = 0,
    *,
    runner: Runner,
) -> tuple[Question, dict[str, str]]:
    """Return a question on the scenarios that both can read, and why others are left out.

    Parameters as in `Question`; the runner makes the estimators.
    """
    left = {side: runner.misfits(scenarios, [text])
            for side, text in (("base", base), ("candidate", candidate))}  # fmt: skip
    alone = tuple(
        Lack(name, side, len(seeds), unreadable=True)
        for (side, mine), other in zip(left.items(), list(left.values())[::-1], strict=True)
        for name in mine
        if name not in other
    )
    why = left["base"] | left["candidate"]
    kept = [s for s in scenarios if s.name not in why]
    if not kept:  # who runs them is told why
        kept, alone, why = list(scenarios), (), {}
    return Question(base, candidate, kept, seeds, margins, max_seeds, lacking=alone), why


def rows_of(found: Mapping[tuple[str, str], Runs], estimator: str) -> ScoreRows:
    """Return the rows of one estimator by scenario, seed and parameter.

    Parameters
    ----------
    found : mapping
        As from `Bench.runs`.
    estimator : str
    """
    return table(
        row for (_, text), runs in found.items() if text == estimator for run in runs for row in run
    )
