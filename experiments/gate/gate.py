"""Compare a candidate with a base on common seeds, and add seeds if the result is undecided."""

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
"""Name of the default suite for comparisons."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of a comparison.

    Attributes
    ----------
    base, candidate : str
        Estimators, written as for the option `--estimator`. After tuning to equal noise, the texts
        include the tuned options.
    seeds : list of int
        Common seeds of both estimators.
    rows : DataFrame
        One verdict per score, from `flexaxis.experiments.gate.verdict.judge`.
    lost : sequence of Lost
        One verdict for each kind of lost run.
    paired : Paired
        Paired scores on which the verdicts are based.
    margins : mapping of metric to float
        Largest relative change of each score that counts as negligible.
    look, looks : int
        Number of the last look (interim analysis), counted from 1, and number of planned looks.
    equal : sequence of Tuned
        Tuned settings of both estimators, if the comparison is at equal noise.
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
        """The overall verdict, which is "worse" or "undecided" if candidate runs are missing."""
        word = overall(self.rows["verdict"], self.lost)
        sides = {gap.side for gap in self.paired.gaps}
        short = "candidate" in sides or ("base" in sides and word in {SLIGHT, SAME})
        return UNDECIDED if short and word != WORSE else word

    def status(self) -> int:
        """Return the exit status, which is 1 if the candidate is worse, and otherwise 0 or 3.

        The status is 3 if the verdict is "undecided" and the candidate lacks runs or loses more
        runs than the base. Lost runs are failed, diverged or unsettled runs.
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
    """Run two estimators and judge every score, or the lags at equal noise if `match_std`.

    If `max_seeds` allows more seeds, further looks (interim analyses) double the number of seeds
    until the overall verdict is not "undecided" or all seeds have been used. Each of K looks has
    the level alpha/K (Bonferroni), so repeated looks do not increase the probability of a false
    verdict. The comparison skips scenarios on which one of the estimators cannot run.

    Parameters
    ----------
    base, candidate : str
        Estimators, written as for the option `--estimator`.
    scenarios : sequence of Scenario
        Scenarios on which the estimators run.
    seeds : sequence of int
        Seeds of the first look.
    runner : Runner
        Runner that runs the cases.
    margins : mapping of metric to float
        Largest relative change of each score that counts as negligible.
    max_seeds : int
        Largest number of seeds.
    match_std : bool
        Whether to tune both estimators to equal noise before the comparison.

    Raises
    ------
    FlexaxisError
        If there are fewer than two seeds or more seeds than a positive `max_seeds`, if base and
        candidate have fewer than two common runs, or if the noise cannot be matched.
    """
    looks, run = look_seeds(seeds, max_seeds), runner.rows
    left = [runner.misfits(scenarios, [text]) for text in (base, candidate)]
    gaps = [Gap(side, f"the {side} cannot run on {name}")
            for side, own, other in zip(SIDES, left, left[::-1], strict=True)
            for name in own if name not in other]  # fmt: skip
    readable = [s for s in scenarios if s.name not in {*left[0], *left[1]}]
    scenarios = readable or scenarios  # if none is left, running them raises the error
    equal: Sequence[Tuned] = ()
    if match_std:
        if used := {*SEEDS} & {*looks[-1]}:
            raise FlexaxisError(
                f"seed {min(used)} is a seed for tuning: compare on other seeds, such as "
                "--seeds 1000:1032"
            )
        equal = equally_noisy((base, candidate), scenarios, run, SEEDS[: max(2, len(seeds))])
        base, candidate = (side.setting for side in equal)
    for now in looks:
        frame = run(scenarios, [base, candidate], now)
        sides = [table(frame[frame["estimator"] == text]) for text in (base, candidate)]
        for side in sides:
            if side["failed"].all():  # report the crash instead of a verdict
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
    """Return the seeds of each look; the number of seeds doubles from look to look up to `most`.

    Examples
    --------
    >>> [len(look) for look in look_seeds(range(8), 40)]
    [8, 16, 32, 40]
    """
    if len(seeds) < 2 or 0 < most < len(seeds):
        raise FlexaxisError(
            f"give at least 2 seeds (32 are recommended), and no more --seeds ({len(seeds)}) than "
            f"--max-seeds ({most})"
        )
    every, sizes = [*seeds, *range(seeds[-1] + 1, seeds[-1] + 1 + most)], [len(seeds)]
    while sizes[-1] < most:
        sizes.append(min(2 * sizes[-1], most))
    return [every[:size] for size in sizes]


def check_margins(margins: Mapping[str, float]) -> dict[str, float]:
    """Return the default margins, updated with `margins`; raise an error for an invalid entry."""
    for metric, margin in margins.items():
        if metric not in METRICS or not 0 < margin < 1:
            raise FlexaxisError(
                f"--margin {metric}: give a score and a margin between 0 and 100 %, as in lag=2%."
                f"{did_you_mean(metric, METRICS)}"
            )
    return {**MARGINS, **margins}


def compare_runs(
    base: Path, candidate: Path, *, margins: Mapping[str, float] = MARGINS,
    estimators: Sequence[str | None] = (None, None), seeds: Sequence[int] | None = None,
) -> Comparison:  # fmt: skip
    """Compare two estimators from two finished runs on their common seeds.

    Parameters
    ----------
    base, candidate : Path
        Results folders.
    margins : mapping of metric to float
        Largest relative change of each score that counts as negligible.
    estimators : sequence of str or None
        Estimator in each folder; None if the folder contains only one estimator.
    seeds : sequence of int, optional
        Seeds to compare (default: all).

    Raises
    ------
    FlexaxisError
        If the versions differ, if a scenario differs, if there are fewer than two common seeds, or
        if the estimator of a folder is None although the folder contains several estimators.
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
                f"{folder}: give the folder of a finished run, and choose its estimator with "
                f"--base or --candidate. The folder contains: {', '.join(texts)}"
            )
        names += chosen
        versions.append(summary_of(folder)["versions"])
        sides.append(table(frame[frame["estimator"] == chosen[0]]))
    old, new = (dict(zip(side["scenario"], side["hash"], strict=True)) for side in sides)
    if versions[0] != versions[1] or any(old[name] != new[name] for name in old.keys() & new):
        raise FlexaxisError(
            f"{base} and {candidate} come from different versions of flexaxis or of a scenario. "
            "Run both again, or use `flexaxis compare --base … --candidate …`"
        )
    paired = pair(*sides, margins)  # type: ignore[call-arg]
    common = sorted({*sides[0]["seed"]} & {*sides[1]["seed"]})
    return Comparison(*names, common, judge(paired), losses(paired), paired, margins)  # type: ignore[call-arg]
