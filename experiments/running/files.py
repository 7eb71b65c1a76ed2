"""The folder of a run: scores.jsonl, summary.json, curves.nc, report.html.

While a run goes on its rows are appended to scores.part.jsonl, which becomes scores.jsonl when the
run is complete; an interrupted run leaves the part, and an older complete result stays.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Self

import numpy as np

from flexaxis.experiments.scoring.pooling import Curve
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.files import atomic

SCORES, PART, SUMMARY, CURVES, REPORT = (
    "scores.jsonl",
    "scores.part.jsonl",
    "summary.json",
    "curves.nc",
    "report.html",
)


class OutputError(FlexaxisError):
    """A result cannot be written or read."""


@dataclass(frozen=True)
class Results:
    """What a report is made of.

    Attributes
    ----------
    summary : dict
        As in summary.json: command, versions, seeds, scenarios, estimators, pooled rows.
    curves : list of Curve
        Trajectories of each estimator on each scenario.
    """

    summary: dict[str, Any]
    curves: list[Curve]


def dumps(content: Any) -> str:
    """Return strict JSON on one line; a number that is not finite is a programming error."""
    return json.dumps(content, allow_nan=False, ensure_ascii=False)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn a failure to write into one clear line that names the file and the reason."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written: {error.strerror or error}. "
            "Choose another place with -o, or make room"
        ) from error


class RowWriter:
    """Append rows to scores.part.jsonl; once all are there, `finish` makes it scores.jsonl.

    The folder is made if it is missing. A context manager: leaving it closes the file, and
    whatever was written stays.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            self._file: IO[str] = (folder / PART).open("w", encoding="utf-8")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def write(self, rows: Sequence[dict[str, Any]]) -> None:
        """Append rows and hand them to the system, so that a kill loses nothing."""
        with writing(self.folder / PART):
            self._file.write("".join(dumps(row) + "\n" for row in rows))
            self._file.flush()

    def finish(self) -> None:
        """Close the file and give it its final name."""
        with writing(self.folder / SCORES):
            self._file.close()
            os.replace(self.folder / PART, self.folder / SCORES)


@contextmanager
def new_file(path: Path) -> Iterator[Path]:
    """Give a path to write to; what is there at the end takes the place of `path` at once.

    Raises
    ------
    OutputError
        If it cannot be written; whatever was at `path` is still there.
    """
    with writing(path), atomic(path) as part:
        yield part


def write_text(path: Path, text: str) -> None:
    """Write a text file at once or not at all; errors as from `new_file`."""
    with new_file(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write strict JSON to be read by people too; errors as from `new_file`."""
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1)
    write_text(path, text + "\n")


def save(folder: Path, results: Results) -> None:
    """Write summary.json and curves.nc, each at once or not at all."""
    write_json(folder / SUMMARY, results.summary)
    with writing(folder / CURVES):
        _save_curves(folder / CURVES, results.curves)


def load(folder: Path) -> Results:
    """Return the results in a folder.

    Raises
    ------
    OutputError
        If a file is missing or damaged.
    """
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        return Results(summary, _load_curves(folder / CURVES))
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(
            f"{folder} holds no complete result ({SUMMARY} and {CURVES} are needed): {error}. "
            "Make one with `flexaxis run … -o FOLDER`"
        ) from error


_ARRAYS = ("truth", "low", "median", "high")


def _save_curves(path: Path, curves: Sequence[Curve]) -> None:
    from flexaxis.sim.netcdf import add, new_netcdf

    with new_netcdf(path) as file:
        for number, curve in enumerate(curves):
            group = file.create_group(str(number))
            group.attrs["scenario"], group.attrs["estimator"] = curve.scenario, curve.estimator
            group.attrs["names"] = json.dumps(curve.names)
            group.attrs["percentiles"] = "low 10, median 50, high 90; all over nominal"
            add(group, "time", ("time",), curve.time, units="s")
            for name in _ARRAYS:
                values = np.asarray(getattr(curve, name), np.float32)
                add(group, name, ("time", "estimate"), values)


def _load_curves(path: Path) -> list[Curve]:
    import h5py  # which finds a group at once; h5netcdf goes through all dimensions for each

    with h5py.File(path, "r") as file:
        return [
            Curve(
                scenario=group.attrs["scenario"],
                estimator=group.attrs["estimator"],
                names=tuple(json.loads(group.attrs["names"])),
                time=group["time"][:],
                **{name: group[name][:].astype(float) for name in _ARRAYS},
            )
            for _, group in sorted(file.items(), key=lambda item: int(item[0]))
        ]
