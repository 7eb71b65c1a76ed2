"""Compare a candidate with a base: run both on common seeds, and add seeds until it is decided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from flexaxis.experiments.comparison.tune import Tuned, equally_noisy
from flexaxis.experiments.files import summary_of
from flexaxis.experiments.gate.equal_noise import SEEDS, at_equal_noise
from flexaxis.experiments.gate.pairs import SIDES, Gap, Paired, pair, table
from flexaxis.experiments.gate.verdict import (
    ALPHA,
    SAME,
    SLIGHT,
    UNDECIDED,
    WORSE,
    Lost,
    alarming,
    judge,
    losses,
    overall,
)
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.run import Runner, check_failures
from flexaxis.experiments.scoring.score_table import MARGINS, METRICS
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.scenario import Scenario

SUITE = "gate"
"""The suite on which estimators are compared by default."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    Attributes
    ----------
    base, candidate : str
        Texts as for `--estimator`; at equal noise as tuned.
    seeds : list of int
    rows : DataFrame
        A verdict a score, as from `flexaxis.experiments.gate.verdict.judge`.
    lost : sequence of Lost
        A verdict on each way to lose runs.
    paired : Paired
        What they are of.
    margins : mapping of metric to float
    look, looks : int
        At which look it was decided, of how many planned.
    equal : sequence of Tuned
        The settings of both, where they were tuned to one noise first.
    """

    base: str
    candidate: str
    seeds: list[int]
    rows: pd.DataFrame
    lost: Sequence[Lost]
    paired: Paired
    margins: Mapping[str, float]
    look: int = 1
    looks: int = 1
    equal: Sequence[Tuned] = ()

    @property
    def verdict(self) -> str:
        """The overall verdict: if runs of the candidate are missing, "worse" or "undecided"."""
        word = overall(self.rows["verdict"], self.lost)
        sides = {gap.side for gap in self.paired.gaps}
        short = "candidate" in sides or ("base" in sides and word in {SLIGHT, SAME})
        return UNDECIDED if short and word != WORSE else word

    def status(self) -> int:
        """Return the exit status: 1 worse; 3 undecided; else 0.

        Undecided is 3 only where somebody must look: candidate runs are newly lost or failed, or
        not there.
        """
        if self.verdict != UNDECIDED:
            return int(self.verdict == WORSE)
        failed = self.paired.failed
        newly = failed["candidate"] > failed["base"] or alarming(self.lost)
        return 3 * (newly or any(gap.must_look for gap in self.paired.gaps))


def compare(
    base: str, candidate: str, scenarios: Sequence[Scenario], seeds: Sequence[int],
    runner: Runner, *,
    margins: Mapping[str, float] = MARGINS, max_seeds: int = 0, match_std: bool = False,
) -> Comparison:  # fmt: skip
    """Run both estimators and judge every score, at equal noise if `match_std`.

    With more seeds allowed than the first look has, looks with twice as many follow until nothing
    is undecided, or the seeds are spent. K looks have alpha/K each (Bonferroni), so that looking
    again does not raise the rate of false alarms. Scenarios that one side cannot read are left out.

    Parameters
    ----------
    base, candidate : str
        Texts as for `--estimator`.
    scenarios : sequence of Scenario
    seeds : sequence of int
        Of the first look.
    runner : Runner
        Where the cases are run.
    margins : mapping of metric to float
        Changes that do not matter, as shares.
    max_seeds : int
        Seeds that may be spent.
    match_std : bool
        Whether to tune both to one noise first.

    Raises
    ------
    FlexaxisError
        If there are fewer than two seeds, more than `max_seeds`, or no common run; if noise cannot
        be equal.
    """
    looks, run = look_seeds(seeds, max_seeds), runner.rows
    left = [runner.misfits(scenarios, [text]) for text in (base, candidate)]
    gaps = [Gap(side, f"the {side} cannot read {name}")
            for side, own, other in zip(SIDES, left, left[::-1], strict=True)
            for name in own if name not in other]  # fmt: skip
    readable = [s for s in scenarios if s.name not in {*left[0], *left[1]}]
    scenarios = readable or scenarios  # running them tells why
    equal: Sequence[Tuned] = ()
    if match_std:
        if used := {*SEEDS} & {*looks[-1]}:
            raise FlexaxisError(
                f"seed {min(used)} is used for tuning: compare on others, such as --seeds 1000:1032"
            )
        equal = equally_noisy((base, candidate), scenarios, run, SEEDS[: max(2, len(seeds))])
        base, candidate = (side.setting for side in equal)
    for now in looks:
        frame = run(scenarios, [base, candidate], now)
        sides = [table(frame[frame["estimator"] == text]) for text in (base, candidate)]
        for side in sides:
            if side["failed"].all():  # a crash, and no verdict
                check_failures(side)
        paired = pair(*sides, margins)  # type: ignore[call-arg]
        if equal:
            paired = at_equal_noise(paired, *equal, scenarios=scenarios, run=run, seeds=now)
        paired = replace(paired, gaps=[*gaps, *paired.gaps])
        alpha = ALPHA / len(looks)
        rows, lost = judge(paired, alpha=alpha), losses(paired, alpha=alpha)
        if overall(rows["verdict"], lost) != UNDECIDED:
            break
    about = (paired, margins, looks.index(now) + 1, len(looks), equal)
    return Comparison(base, candidate, now, rows, lost, *about)


def look_seeds(seeds: Sequence[int], most: int) -> list[list[int]]:
    """Return the seeds of each look: the first ones, then twice as many, up to the most.

    Examples
    --------
    >>> [len(look) for look in look_seeds(range(8), 40)]
    [8, 16, 32, 40]
    """
    if len(seeds) < 2 or 0 < most < len(seeds):
        raise FlexaxisError(
            f"give at least 2 seeds, better 32, and no more --seeds ({len(seeds)}) than "
            f"--max-seeds ({most})"
        )
    every, sizes = [*seeds, *range(seeds[-1] + 1, seeds[-1] + 1 + most)], [len(seeds)]
    while sizes[-1] < most:
        sizes.append(min(2 * sizes[-1], most))
    return [every[:size] for size in sizes]


def check_margins(margins: Mapping[str, float]) -> dict[str, float]:
    """Return all margins, with some of them added or changed; refuse unknown scores."""
    for metric, margin in margins.items():
        if metric not in METRICS or not 0 < margin < 1:
            raise FlexaxisError(
                f"--margin {metric}: give a score and a share between 0 and 100 %, as in lag=2%."
                f"{did_you_mean(metric, METRICS)}"
            )
    return {**MARGINS, **margins}


def compare_runs(
    base: Path, candidate: Path, *, margins: Mapping[str, float] = MARGINS,
    estimators: Sequence[str | None] = (None, None), seeds: Sequence[int] | None = None,
) -> Comparison:  # fmt: skip
    """Compare an estimator of one finished run with one of another, on their common seeds.

    Parameters
    ----------
    base, candidate : Path
        Results folders.
    margins : mapping of metric to float
    estimators : sequence of str or None
        Which estimator of each folder; may be left out where there is only one.
    seeds : sequence of int, optional
        Only these.

    Raises
    ------
    FlexaxisError
        If the versions or the content of a scenario differ, the estimator is not clear, or fewer
        than two seeds are common.
    """
    sides, names, versions = [], [], []  # type: ignore[var-annotated]
    for folder, text in zip((base, candidate), estimators, strict=True):
        results = Results.load(folder)
        frame = results.frame
        frame = frame[frame["seed"].isin(frame["seed"] if seeds is None else seeds)]
        texts = [*frame["estimator"].unique()]
        chosen = [text] if text else texts
        if results.axes or len(chosen) > 1 or chosen[0] not in texts:
            raise FlexaxisError(
                f"{folder}: take a finished run, and name its estimator with --base or "
                f"--candidate. It holds: {', '.join(texts)}"
            )
        names += chosen
        versions.append(summary_of(folder)["versions"])
        sides.append(table(frame[frame["estimator"] == chosen[0]]))
    old, new = (dict(zip(side["scenario"], side["hash"], strict=True)) for side in sides)
    if versions[0] != versions[1] or any(old[name] != new[name] for name in old.keys() & new):
        raise FlexaxisError(
            f"{base} and {candidate} are of different versions of flexaxis, or of a scenario: run "
            "both again, or use `flexaxis compare --base … --candidate …`"
        )
    paired = pair(*sides, margins)  # type: ignore[call-arg]
    common = sorted({*sides[0]["seed"]} & {*sides[1]["seed"]})
    return Comparison(*names, common, judge(paired), losses(paired), paired, margins)  # type: ignore[call-arg]
