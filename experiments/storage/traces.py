"""What trajectories are drawn from, with the rows of a run: a case that has rows has its trace.

A run's figures need a point in ten of every estimate, all estimates and the error after the fault,
and the residual; kept in memory they would be most of what a run takes.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.curves import Detail
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.storage.files import OutputError
from flexaxis.experiments.storage.schema import connect, row_files, said
from flexaxis.experiments.storage.store import OF_CASES


def packed(case: Case) -> bytes:
    """Return what a case is drawn from as bytes: a file of NumPy, without objects."""
    told: dict[str, Any] = {"estimator": case.estimator, "names": case.names}
    told |= {"changed": list(case.relative), "findings": list(case.detail.findings)}
    arrays: dict[str, Any] = {"curve": case.curve, "near": case.detail.near}
    if case.detail.residual is not None:
        arrays["residual"] = case.detail.residual
    arrays |= {f"of {name}": values for name, values in case.relative.items()}
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, told=np.array(json.dumps(told)), **arrays)
    return buffer.getvalue()


def unpacked(content: bytes) -> Case:
    """Return what `packed` was given, without its rows; what is damaged fails in several ways."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        told = json.loads(str(stored["told"]))
        detail = Detail(stored["near"], stored.get("residual"), tuple(told["findings"]))
        relative = {name: stored[f"of {name}"] for name in told["changed"]}
        return Case(told["estimator"], tuple(told["names"]), stored["curve"], relative, detail)


@dataclass(frozen=True)
class Traces:
    """All traces of a folder; read when they are asked for.

    Attributes
    ----------
    folder : Path, optional
        Without one there are none.
    codes : mapping of str to str
        Of estimators of users, by their text.
    seeds : sequence of int, optional
        Only of these.
    """

    folder: Path | None = None
    codes: Mapping[str, str | None] = field(default_factory=dict)
    seeds: Sequence[int] | None = None

    def find(self, key: str, estimator: str) -> dict[int, Case]:
        """Return the traces of an estimator on a scenario, by seed.

        Parameters
        ----------
        key : str
            Hash of the scenario.
        estimator : str

        Raises
        ------
        OutputError
            If one is damaged.
        """
        found: dict[int, Case] = {}
        where = OF_CASES.replace("ORDER BY rowid", "ORDER BY seed")
        given = (estimator, self.codes.get(estimator), key)
        query = f"SELECT seed, trace FROM traces WHERE {where}"
        for path in row_files(self.folder) if self.folder else ():
            with said(path), closing(connect(path)) as db:
                for seed, content in db.execute(query, given):
                    if self.seeds is None or seed in self.seeds:
                        found[seed] = _checked(path, content)
        return found


def _checked(path: Path, content: bytes) -> Case:
    try:
        return unpacked(content)
    except (KeyError, TypeError, ValueError, OSError, zipfile.BadZipFile) as error:
        raise OutputError(f"{path}: what its figures are drawn from is damaged: {error}") from error
