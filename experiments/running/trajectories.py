"""Trajectories: the estimates of all cases of a study, or of the worst ones, as NetCDF files."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.running.estimate import estimates_file
from flexaxis.experiments.running.plan import Plan
from flexaxis.experiments.running.study import Unit
from flexaxis.experiments.running.work import Kept, run_unit
from flexaxis.experiments.storage.files import writing
from flexaxis.experiments.storage.names import TRAJECTORIES
from flexaxis.experiments.storage.schema import row_files
from flexaxis.experiments.storage.store import rows_in


def keep_all(folder: Path, kept: Iterable[Kept]) -> None:
    """Write estimates to FOLDER/trajectories/CASE.nc, in the form of `flexaxis estimate`.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    for each in kept:
        target = folder / TRAJECTORIES / f"{each.case}.nc"
        with writing(target):
            target.parent.mkdir(exist_ok=True)
        with estimates_file(target, each.names, len(each.theta)) as file:
            file["time"][:] = np.arange(len(each.theta)) * each.period
            file["theta"][:] = each.theta
            file.attrs.update(estimator=each.estimator, record_hash=each.hash, seed=each.seed)


def keep_worst(folder: Path, plan: Plan) -> None:
    """Run the worst case of each estimator at each point again, and write its estimates.

    The worst is one that diverged, else the one with the largest lag; where nothing changed, the
    one with the largest error.
    """
    for (variant, text), case in _worst(folder, plan).items():
        found = plan.variants[variant]
        if (folder / TRAJECTORIES / f"{case.id}.nc").exists():
            continue
        # An estimator that is no more in the study has its rows here still.
        entries = tuple(entry for entry in found.entries if entry.text == text)
        if entries:
            unit = Unit((dataclasses.replace(found, entries=entries),), (case.seed,))
            keep_all(folder, run_unit(unit, whole=True).kept)


@dataclass(frozen=True, order=True)
class _Ranked:
    badness: tuple[float, ...]
    id: str
    seed: int


def _worst(folder: Path, plan: Plan) -> dict[tuple[int, str], _Ranked]:
    numbers = {variant.hash: number for number, variant in enumerate(plan.variants)}
    found: dict[tuple[int, str], _Ranked] = {}
    for path in row_files(folder):
        for row in rows_in(path):
            if row["hash"] in numbers and row["error"] is None:
                key = numbers[row["hash"]], row["estimator"]
                ranked = _Ranked(_badness(row), row["case"], row["seed"])
                found[key] = max(found.get(key, ranked), ranked)
    return found


def _badness(row: Mapping[str, Any]) -> tuple[float, ...]:
    return tuple(
        math.inf if row["diverged"] else value or 0.0 for value in (row["lag"], row["std"])
    )
