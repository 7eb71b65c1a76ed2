"""Run some rows of a study again, and compare."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

from flexaxis.experiments.building.code import digest, require
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.study import EstimatorSetting, Unit, applies, find_point
from flexaxis.experiments.running.work import made_with, run_unit
from flexaxis.experiments.storage.schema import flat, nested, row_files
from flexaxis.experiments.storage.store import OF_ONE, cases_of, rows_in
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario, scenario_from

RELATIVE, ABSOLUTE = 1e-6, 1e-9  # what another machine or version may change in a number


@dataclass(frozen=True)
class Repeated:
    """A case that was run again.

    Attributes
    ----------
    case, what : str
        Its identity, and scenario, estimator and seed in words.
    exact : bool
        Whether it had to be identical: it was made here, with these versions.
    differences : tuple of str
        What is not as it was; empty where all is.
    """

    case: str
    what: str
    exact: bool
    differences: tuple[str, ...]


def verify(
    folder: Path,
    *,
    sample: int = 10,
    seed: int = 0,
    run_code: bool = False,
    command: str | None = None,
) -> Iterator[Repeated]:
    """Yield the verdicts on a random sample of the cases in a folder.

    Rows made on this machine with these versions must be identical but for `cost`; others agree
    within 1e-6 of the value or 1e-9.

    Parameters
    ----------
    folder : Path
    sample : int
        Number of cases, or all if there are fewer.
    seed : int
        Of the choice.
    run_code : bool
        Whether code may be run that the rows name as their estimators.
    command : str, optional
        The line that was typed, as for `building.code.require`.

    Raises
    ------
    StudyError
        If it is not the folder of a study.
    CodeRefused
        If a row names code that may not be run; then nothing is.
    """
    content = read_study(folder, whole=True)
    bases = [
        scenario_from(entry["definition"], source=str(folder)) for entry in content["scenarios"]
    ]
    chosen = _sample(folder, sample, Random(seed))
    named = list(dict.fromkeys(row["estimator"] for rows in chosen for row in rows))
    require(run_code, named, source=str(folder), command=command)
    for rows in chosen:
        yield _again(rows, bases)


def _sample(folder: Path, sample: int, random: Random) -> list[list[dict[str, Any]]]:
    """Return that many cases, each as likely as any other."""
    every = [(path, case) for path in row_files(folder) for case in cases_of(path)]
    chosen = random.sample(every, min(sample, len(every)))
    return [list(rows_in(path, OF_ONE, case)) for path, case in chosen]


def _again(rows: list[dict[str, Any]], bases: Sequence[Scenario]) -> Repeated:
    first = rows[0]
    what = f"{first['scenario']}, {first['estimator']}, seed {first['seed']}"
    cost = first["cost"]
    exact = cost["versions"] == made_with() and cost["host"] in {platform.node(), None}
    try:
        made = _run(first, bases)
    except ScenarioError as error:
        return Repeated(first["case"], what, exact, (str(error),))
    if len(made) != len(rows):
        return Repeated(first["case"], what, exact, (f"{len(rows)} rows were, {len(made)} are",))
    told = [
        f"{row['parameter'] or 'case'}: {text}"
        for row, other in zip(rows, made, strict=True)
        for text in differences(row, other, exact=exact)
    ]
    return Repeated(first["case"], what, exact, tuple(told))


def _run(row: Mapping[str, Any], bases: Sequence[Scenario]) -> list[dict[str, Any]]:
    axes = {key: value for key, value in row["axes"].items() if not applies(key, row["method"])}
    entry = EstimatorSetting(row["method"], row["estimator"], {}, digest(row["estimator"]))
    variant = find_point(bases, axes, row["hash"])
    if variant is None:
        raise ScenarioError(
            f"no scenario of the study gives the hash {row['hash'][:12]} of this row"
        )
    made = run_unit(Unit((replace(variant, entries=(entry,)),), (row["seed"],)))
    return [nested(flat(row)) for row in made.rows]


def differences(row: Any, other: Any, *, exact: bool, key: str = "") -> Iterator[str]:
    """Yield what differs between two rows, tables inside them included; `cost` may.

    Parameters
    ----------
    row, other : JSON values
    exact : bool
        Whether numbers must be the same to the last bit.
    key : str
        Where we are.
    """
    if isinstance(row, dict) and isinstance(other, dict):
        for name in sorted((row.keys() | other.keys()) - {"cost", "axes"}):
            inner = f"{key}.{name}" if key else name
            yield from differences(row.get(name), other.get(name), exact=exact, key=inner)
    elif not _same(row, other, exact):
        yield f"{key} was {row!r} and is {other!r}"


def _same(one: Any, other: Any, exact: bool) -> bool:
    if exact or not (isinstance(one, int | float) and isinstance(other, int | float)):
        return bool(one == other)
    return math.isclose(one, other, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
