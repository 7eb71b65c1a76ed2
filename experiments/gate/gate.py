"""Compare a candidate estimator with a base estimator, and add seeds if the result is undecided."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from flexaxis.experiments.comparison.tune import Tuned, equally_noisy
from flexaxis.experiments.files import summary_of
from flexaxis.experiments.gate.match_std import SEEDS, at_equal_noise
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
from flexaxis.experiments.running.progress import remark
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.runner import Runner, check_failures
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
        Estimators, in the format of the option `--estimator`. After tuning to equal noise, the
        specifications include the tuned options.
    seeds : list of int
        Seeds for which both estimators have runs.
    rows : DataFrame
        Table with one verdict per score, from `flexaxis.experiments.gate.verdict.judge`.
    lost : sequence of Lost
        One verdict on diverged runs, and one verdict on runs that never settle.
    paired : Paired
        Paired scores on which the verdicts are based.
    margins : mapping of metric to float
        Largest relative change in each score that counts as negligible.
    look, looks : int
        Number of the last interim analysis (look), counted from 1, and number of planned analyses.
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
        """Return the exit status: 1 if the candidate is worse, and otherwise 0 or 3.

        An undecided verdict leads to the exit status 3 if the candidate has missing runs, or more
        lost runs than the base. A run is lost if it fails, diverges or never settles.
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
    """Run two estimators, and compare either all their scores, or only their lags at equal noise.

    If the verdict is "undecided", the function doubles the number of seeds and repeats the
    analysis, until `max_seeds` seeds have been used. Each of K interim analyses has the
    significance level alpha/K (Bonferroni). Therefore repeated analyses do not increase the
    probability of a false verdict. The comparison skips scenarios on which at least one of the
    estimators cannot run.

    Parameters
    ----------
    base, candidate : str
        Estimators, in the format of the option `--estimator`.
    scenarios : sequence of Scenario
        Scenarios on which the estimators run.
    seeds : sequence of int
        Seeds of the first interim analysis.
    runner : Runner
        Runner that executes the runs.
    margins : mapping of metric to float
        Largest relative change in each score that counts as negligible.
    max_seeds : int
        Largest number of seeds.
    match_std : bool
        Whether to tune both estimators to equal noise and to compare only their lags.

    Raises
    ------
    FlexaxisError
        If the number of seeds is invalid, if the estimators have fewer than two runs in common, or
        if the noise cannot be matched.
    """
    looks, run = look_seeds(seeds, max_seeds), runner.rows
    left = [runner.misfits(scenarios, [text]) for text in (base, candidate)]
    gaps = [Gap(side, f"the {side} cannot run on {name}")
            for side, own, other in zip(SIDES, left, left[::-1], strict=True)
            for name in own if name not in other]  # fmt: skip
    readable = [s for s in scenarios if s.name not in {*left[0], *left[1]}]
    for name in left[0].keys() & left[1] if readable else ():
        remark(f"scenario {name} is omitted: {left[0][name]}")
    scenarios = readable or scenarios  # if none is left, running them raises the error
    equal: Sequence[Tuned] = ()
    if match_std:
        if used := {*SEEDS} & {*looks[-1]}:
            raise FlexaxisError(
                f"seed {min(used)} is reserved for tuning: use other seeds for the comparison, "
                "such as --seeds 1000:1032"
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
    """Return the seeds of each interim analysis; their number doubles each time, up to `most`.

    Examples
    --------
    >>> [len(look) for look in look_seeds(range(8), 40)]
    [8, 16, 32, 40]
    """
    if len(seeds) < 2 or 0 < most < len(seeds):
        raise FlexaxisError(
            "a comparison needs at least 2 seeds (32 are recommended), and the number of seeds "
            f"in --seeds ({len(seeds)}) must not exceed --max-seeds ({most})"
        )
    every, sizes = [*seeds, *range(seeds[-1] + 1, seeds[-1] + 1 + most)], [len(seeds)]
    while sizes[-1] < most:
        sizes.append(min(2 * sizes[-1], most))
    return [every[:size] for size in sizes]


def check_margins(margins: Mapping[str, float]) -> dict[str, float]:
    """Return the default margins, updated with `margins`; raise an error if an entry is invalid."""
    for metric, margin in margins.items():
        if metric not in METRICS or not 0 < margin < 1:
            raise FlexaxisError(
                f"--margin {metric}: give the name of a score and a margin between 0 and 100 %, "
                f"such as lag=2%.{did_you_mean(metric, METRICS)}"
            )
    return {**MARGINS, **margins}


def compare_runs(
    base: Path, candidate: Path, *, margins: Mapping[str, float] = MARGINS,
    estimators: Sequence[str | None] = (None, None), seeds: Sequence[int] | None = None,
) -> Comparison:  # fmt: skip
    """Compare two estimators from the results folders of two finished runs.

    Parameters
    ----------
    base, candidate : Path
        Results folders.
    margins : mapping of metric to float
        Largest relative change in each score that counts as negligible.
    estimators : sequence of str or None
        Estimator to compare from each folder, or None if the folder contains only one estimator.
    seeds : sequence of int, optional
        Seeds to compare (default: all common seeds).

    Raises
    ------
    FlexaxisError
        If the versions of flexaxis or of a scenario differ between the folders, if there are fewer
        than two common seeds, or if a folder contains several estimators and none is selected.
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
                f"{folder}: give the folder of a finished run, and use --base or --candidate to "
                f"choose an estimator in this folder. Its estimators are: {', '.join(texts)}"
            )
        names += chosen
        versions.append(summary_of(folder)["versions"])
        sides.append(table(frame[frame["estimator"] == chosen[0]]))
    old, new = (dict(zip(side["scenario"], side["hash"], strict=True)) for side in sides)
    if versions[0] != versions[1] or any(old[name] != new[name] for name in old.keys() & new):
        raise FlexaxisError(
            f"{base} and {candidate} contain results from different versions of flexaxis or of a "
            "scenario. Repeat both runs with the same version, or use `flexaxis compare --base … "
            "--candidate …`, which runs both estimators again"
        )
    paired = pair(*sides, margins)  # type: ignore[call-arg]
    common = sorted({*sides[0]["seed"]} & {*sides[1]["seed"]})
    return Comparison(*names, common, judge(paired), losses(paired), paired, margins)  # type: ignore[call-arg]
