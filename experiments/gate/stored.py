"""Compare two finished runs from their folders; refuses what cannot be compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis.experiments.gate.decide import ALPHA
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import LOST, Table, pair, table
from flexaxis.experiments.gate.verdicts import judge
from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.running.files import OutputError
from flexaxis.experiments.running.names import SCORES, SUMMARY
from flexaxis.experiments.running.sealed import read_sealed
from flexaxis.sim.errors import FlexaxisError, did_you_mean

KEYS = ("scenario", "hash", "seed", "parameter", "changed")


def is_run(name: str) -> bool:
    """Whether a name is the folder of a finished run."""
    return (Path(name) / SCORES).is_file()


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
        Folders with scores.jsonl and summary.json.
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
    common = sorted({seed for _, seed, _ in before} & {seed for _, seed, _ in after})
    if len(common) < 2:
        raise FlexaxisError(
            f"{base} and {candidate} have {len(common)} seeds in common"
            + ("" if seeds is None else f" of the {len(seeds)} that --seeds names")
            + ": at least 2 are needed, better 32"
        )
    paired = pair(before, after, margins)
    return Comparison(
        base=first,
        candidate=second,
        seeds=common,
        look=1,
        looks=1,
        alpha=alpha,
        verdicts=judge(paired, margins, alpha=alpha),
        missing=paired.missing,
        estimated=paired.estimated,
    )


def _load(folder: Path) -> tuple[dict[str, Any], Results]:
    results = Results(folder, {"axes": ()})
    try:
        summary = read_sealed(folder / SUMMARY, OutputError)
        summary["versions"].items()
        results.table.texts("estimator")  # damaged rows are found here
        return summary, results
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise OutputError(
            f"{folder} holds no complete result ({SCORES} and {SUMMARY} are needed): {error}"
        ) from error


def _rows(
    results: Results, estimator: str, seeds: Sequence[int] | None, metrics: Iterable[str]
) -> Table:
    """Return what is compared of one estimator."""
    where: dict[str, Any] = {"estimator": estimator, "error": None}
    if seeds is not None:
        where["seed"] = list(seeds)
    return table(Rows(results.select(where), (*KEYS, *LOST, *metrics)))


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


def _check_hashes(base: Path, candidate: Path, old: Table, new: Table) -> None:
    first, second = ({s: row["hash"] for (s, _, _), row in rows.items()} for rows in (old, new))
    for name in first.keys() & second.keys():
        if first[name] != second[name]:
            raise FlexaxisError(
                f"{base} and {candidate} have different scenarios under the name {name} (hash "
                f"{first[name][:12]} and {second[name][:12]}): run both again on one definition"
            )


def _chosen(folder: Path, given: str | None, results: Results) -> str:
    names = results.table.texts("estimator")
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
