"""Compare two finished runs from their folders; refuses what cannot be compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis.experiments.files import SUMMARY, OutputError, StudyError, json_table
from flexaxis.experiments.gate.decide import ALPHA
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import ScoreRows, pair, table
from flexaxis.experiments.gate.verdicts import judge
from flexaxis.experiments.reporting.old_results import Results
from flexaxis.experiments.running.store import ROWS
from flexaxis.experiments.studies.bench import nested
from flexaxis.sim.errors import FlexaxisError, did_you_mean


def is_run(name: str) -> bool:
    """Whether a name is the folder of a finished run."""
    return (Path(name) / ROWS).exists()


def compare_runs(
    base: Path,
    candidate: Path,
    margins: Mapping[str, float],
    *,
    estimators: tuple[str | None, str | None] = (None, None),
    seeds: Sequence[int] | None = None,
    alpha: float = ALPHA,
) -> Comparison:
    """Compare an estimator of one run with one of another, on the seeds common to both.

    Parameters
    ----------
    base, candidate : Path
        Folders with rows and summary.json.
    margins : mapping of metric to float
    estimators : (str or None, str or None)
        Which estimator of each folder; may be left out where there is only one.
    seeds : sequence of int, optional
        Only those of these that both folders have.
    alpha : float

    Raises
    ------
    FlexaxisError
        If versions or the content of a scenario differ, the estimator is not clear, or fewer than
        two seeds are common.
    """
    old, new = _load(base), _load(candidate)
    _check_versions(base, candidate, old[0], new[0])
    first = _chosen(base, estimators[0], old[1])
    second = _chosen(candidate, estimators[1], new[1])
    before = _rows(old[1], first, seeds, margins)
    after = _rows(new[1], second, seeds, margins)
    _check_hashes(base, candidate, before, after)
    common = before.index.unique("seed").intersection(after.index.unique("seed"))
    if len(common) < 2:
        raise FlexaxisError(
            f"{base} and {candidate} have {len(common)} seeds in common"
            + ("" if seeds is None else f" of the {len(seeds)} that --seeds names")
            + ": at least 2 are needed, better 32"
        )
    return compare_rows(before, after, margins, estimators=(first, second), alpha=alpha)


def compare_rows(
    base: ScoreRows,
    candidate: ScoreRows,
    margins: Mapping[str, float],
    *,
    estimators: tuple[str, str] = ("base", "candidate"),
    alpha: float = ALPHA,
) -> Comparison:
    """Compare rows, as from `table`, on the seeds common to both."""
    paired = pair(base, candidate, margins)
    return Comparison(
        *estimators,
        seeds=base.index.unique("seed")
        .intersection(candidate.index.unique("seed"))
        .sort_values()
        .tolist(),
        look=1,
        looks=1,
        alpha=alpha,
        verdicts=judge(paired, margins, alpha=alpha),
        paired=paired,
    )


def _load(folder: Path) -> tuple[dict[str, Any], Results]:
    try:
        results = Results.load(folder)
        if results.axes:
            raise OutputError(
                f"{folder} is a study: runs are compared, or two estimators on a scenario, as in "
                "`flexaxis compare --base A --candidate B FILE.toml` (docs/studies.md)"
            )
        return json_table(folder / SUMMARY, OutputError), results
    except (StudyError, OSError) as error:
        raise OutputError(f"{folder} holds no complete result: {error}") from error


def _rows(
    results: Results, estimator: str, seeds: Sequence[int] | None, metrics: Iterable[str]
) -> ScoreRows:
    """Return what is compared of one estimator."""
    where: dict[str, Any] = {"estimator": estimator}
    if seeds is not None:
        where["seed"] = list(seeds)
    del metrics
    return table(nested(results.select(where).frame))


def _check_versions(
    base: Path, candidate: Path, old: Mapping[str, Any], new: Mapping[str, Any]
) -> None:
    first, second = old["versions"], new["versions"]
    differ = [k for k in {*first, *second} if first.get(k) != second.get(k)]
    if differ:
        texts = [f"{k} {first.get(k)} and {second.get(k)}" for k in sorted(differ)]
        raise FlexaxisError(
            f"{base} and {candidate} were made by other versions ({', '.join(texts)}): run both "
            "again, or use `flexaxis compare --base … --candidate …`"
        )


def _check_hashes(base: Path, candidate: Path, old: ScoreRows, new: ScoreRows) -> None:
    first, second = (rows.groupby(level="scenario")["hash"].first() for rows in (old, new))
    for name in first.index.intersection(second.index):
        if first[name] != second[name]:
            raise FlexaxisError(
                f"{base} and {candidate} have different scenarios under the name {name} (hash "
                f"{first[name][:12]} and {second[name][:12]}): run both again on one definition"
            )


def _chosen(folder: Path, given: str | None, results: Results) -> str:
    names = list(results.frame["estimator"].unique())
    if given in names:
        return str(given)
    if given is None and len(names) == 1:
        return names[0]
    if given is None:
        raise FlexaxisError(
            f"{folder} holds {len(names)} estimators; say which with --base or --candidate: "
            f"{', '.join(names)}"
        )
    raise FlexaxisError(
        f"{folder} holds no estimator {given!r}.{did_you_mean(given, names)} "
        f"It holds: {', '.join(names)}"
    )
