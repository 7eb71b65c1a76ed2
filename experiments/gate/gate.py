"""Compare a candidate with a base: run both on common seeds, and add seeds until it is decided."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis.experiments.files import SUMMARY, OutputError, StudyError, json_table
from flexaxis.experiments.gate.equal_noise import SEEDS, EqualNoise, tuned
from flexaxis.experiments.gate.pairs import Lack, Paired, pair, table
from flexaxis.experiments.gate.verdict import (
    ALPHA,
    SAME,
    SLIGHT,
    UNDECIDED,
    WORSE,
    alarming,
    judge,
    overall,
)
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.run import Runner, check_failures
from flexaxis.experiments.running.store import ROWS
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
        A verdict a row, as from `flexaxis.experiments.gate.verdict.judge`.
    paired : Paired
        What they are of.
    margins : mapping of metric to float
    look, looks : int
        At which look it was decided, of how many planned.
    equal : EqualNoise, optional
        The settings of both, where they were tuned to one noise first.
    unmatched : sequence of (scenario, parameter)
        Where the candidate is as noisy as the base at no setting that was tried.
    """

    base: str
    candidate: str
    seeds: list[int]
    rows: pd.DataFrame
    paired: Paired
    margins: Mapping[str, float]
    look: int = 1
    looks: int = 1
    equal: EqualNoise | None = None
    unmatched: Sequence[tuple[str, str]] = ()

    @property
    def alpha(self) -> float:
        """Largest probability of a false alarm at this look."""
        return ALPHA / self.looks

    @property
    def verdict(self) -> str:
        """The one word. Without all of the candidate's runs, only "worse" can be said."""
        word, sides = overall(self.rows), {lack.side for lack in self.paired.lacking}
        incomplete = self.paired.missing or self.unmatched or "candidate" in sides
        if word != WORSE and (incomplete or ("base" in sides and word in {SLIGHT, SAME})):
            return UNDECIDED
        return word

    @property
    def newly_lost(self) -> int:
        """How many runs more the candidate lost than the base."""
        return int((self.rows["newly"] - self.rows["regained"]).clip(lower=0).sum())

    @property
    def must_look(self) -> bool:
        """Whether an undecided comparison may not pass: runs newly lost or failed, or missing."""
        failed = self.paired.failed
        gone = any(k.side == "candidate" and not k.unreadable for k in self.paired.lacking)
        return gone or failed["candidate"] > failed["base"] or alarming(self.rows)

    def status(self, *, strict: bool = False) -> int:
        """Return the exit status: 1 worse; 3 undecided, if `strict` or `must_look`; else 0."""
        if self.verdict == UNDECIDED:
            return 3 if strict or self.must_look else 0
        return int(self.verdict == WORSE)


def compare(
    base: str, candidate: str, scenarios: Sequence[Scenario], seeds: Sequence[int],
    runner: Runner, *,
    margins: Mapping[str, float] = MARGINS, max_seeds: int = 0, match_std: bool = False,
    traces: bool = False,
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
    match_std, traces : bool
        Whether to tune both to one noise first, and to keep what figures are drawn from.

    Raises
    ------
    FlexaxisError
        If there are fewer than two seeds, more than `max_seeds`, or no common run; if noise cannot
        be equal.
    """
    looks, run = look_seeds(seeds, max_seeds), partial(runner.rows, traces=traces)
    texts = {"base": base, "candidate": candidate}
    scenarios, lacking = _readable(runner, texts, scenarios, len(seeds))
    equal = None
    if match_std:
        if used := {*SEEDS} & {*looks[-1]}:
            raise FlexaxisError(
                f"seed {min(used)} is used for tuning (seeds {SEEDS[0]} to {SEEDS[-1]}): compare "
                "on others, such as --seeds 1000:1032"
            )
        equal = tuned(base, candidate, scenarios, run, SEEDS[: max(2, len(seeds))])
        base, candidate = equal.base.setting, equal.candidate.setting
    for now in looks:
        frame = run(scenarios, list(dict.fromkeys((base, candidate))), now)
        sides = [table(frame[frame["estimator"] == text]) for text in (base, candidate)]
        for side in sides:
            if side["failed"].all():  # a crash, and no verdict
                check_failures(side)
        paired = pair(sides[0], sides[1], margins)
        paired = replace(paired, lacking=[*lacking, *paired.lacking])
        unmatched: Sequence[tuple[str, str]] = ()
        if equal:
            paired, unmatched = equal.apply(paired, scenarios, run, now)
        rows = judge(paired, alpha=ALPHA / len(looks))
        if overall(rows) != UNDECIDED:
            break
    about = (paired, margins, looks.index(now) + 1, len(looks), equal, unmatched)
    return Comparison(base, candidate, now, rows, *about)


def look_seeds(seeds: Sequence[int], most: int) -> list[list[int]]:
    """Return the seeds of each look: the first ones, then twice as many, up to the most.

    Examples
    --------
    >>> [len(look) for look in look_seeds(range(8), 40)]
    [8, 16, 32, 40]
    """
    if len(seeds) < 2:
        raise FlexaxisError("one seed has no spread: give at least 2 seeds, better 32")
    if 0 < most < len(seeds):
        raise FlexaxisError(
            f"--max-seeds {most} is less than the {len(seeds)} seeds of the first look: give more, "
            "or fewer --seeds"
        )
    looks = [list(seeds)]
    while len(looks[-1]) < most:
        more = range(looks[-1][-1] + 1, looks[-1][-1] + 1 + most)
        looks.append([*looks[-1], *more][: min(2 * len(looks[-1]), most)])
    return looks


def _readable(
    runner: Runner, texts: Mapping[str, str], scenarios: Sequence[Scenario], seeds: int
) -> tuple[Sequence[Scenario], list[Lack]]:
    """Return the scenarios that both can read, and those that one side alone can read."""
    left = {side: {*runner.misfits(scenarios, [text])} for side, text in texts.items()}
    both = set.intersection(*left.values())
    lacks = [Lack(n, side, seeds, True) for side, names in left.items() for n in names - both]
    kept = [s for s in scenarios if not any(s.name in names for names in left.values())]
    return (kept, lacks) if kept else (scenarios, [])  # running them tells why


def check_margins(margins: Mapping[str, float]) -> dict[str, float]:
    """Return all margins, with some of them added or changed; refuse unknown scores."""
    for metric, margin in margins.items():
        if metric not in METRICS:
            raise FlexaxisError(
                f"--margin: unknown score {metric!r}.{did_you_mean(metric, METRICS)} "
                f"Scores: {', '.join(METRICS)}"
            )
        if not 0 < margin < 1:
            raise FlexaxisError(f"--margin: give a share between 0 and 100 %, as in {metric}=2%")
    return {**MARGINS, **margins}


def is_run(name: str) -> bool:
    """Return whether a name is the folder of a finished run."""
    return (Path(name) / ROWS).exists()


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
    sides, versions, names = [], [], []
    for folder, text in zip((base, candidate), estimators, strict=True):
        frame, known = _stored(folder)
        versions.append(known)
        names.append(_chosen(folder, text, [*frame["estimator"].unique()]))
        kept = frame["seed"].isin(frame["seed"] if seeds is None else seeds)
        sides.append(table(frame[kept & (frame["estimator"] == names[-1])]))
    hashes = (side.groupby(level="scenario")["hash"].first() for side in sides)
    both = pd.concat(hashes, axis=1, join="inner")
    if versions[0] != versions[1] or (both.iloc[:, 0] != both.iloc[:, 1]).any():
        raise FlexaxisError(
            f"{base} and {candidate} are of different versions of flexaxis, or of a scenario: run "
            "both again, or use `flexaxis compare --base … --candidate …`"
        )
    common = sides[0].index.unique("seed").intersection(sides[1].index.unique("seed"))
    if len(common) < 2:
        raise FlexaxisError(
            f"{base} and {candidate} have {len(common)} of the seeds in common: at least 2 are "
            "needed, better 32"
        )
    paired = pair(sides[0], sides[1], margins)
    return Comparison(names[0], names[1], sorted(common), judge(paired), paired, margins)


def _stored(folder: Path) -> tuple[pd.DataFrame, Any]:
    """Return the rows of a finished run, and the versions that made them."""
    try:
        results = Results.load(folder)
        if results.axes:
            raise StudyError("it is a study")
        return results.frame, json_table(folder / SUMMARY, OutputError)["versions"]
    except (OSError, StudyError, KeyError) as error:
        raise OutputError(
            f"{folder} holds no finished run (rows and {SUMMARY} are needed; a study is compared "
            f"with `flexaxis compare --base A --candidate B FILE.toml`): {error}"
        ) from error


def _chosen(folder: Path, text: str | None, names: Sequence[str]) -> str:
    """Return the estimator of a folder that is meant."""
    if text in names or (text is None and len(names) == 1):
        return text or names[0]
    hint = did_you_mean(text, names) if text else " Name one with --base or --candidate."
    raise FlexaxisError(f"{folder}: which estimator?{hint} It holds: {', '.join(names)}")
