"""One folder of several: the shares of a study that were run apart."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from flexaxis.experiments.running import rows
from flexaxis.experiments.running.files import writing
from flexaxis.experiments.running.folder import (
    LOCK,
    STUDY,
    TRAJECTORIES,
    read_study,
    rows_name,
)
from flexaxis.experiments.running.lock import locked
from flexaxis.experiments.studies.definition import StudyError


@dataclass(frozen=True)
class Merged:
    """Cases in the new folder, and how many were there more than once."""

    cases: int
    doubles: int


def merge(folders: Sequence[Path], target: Path) -> Merged:
    """Copy the complete cases of all folders to a new one, each once; the first folder wins.

    Raises
    ------
    StudyError
        If the folders are of different studies, or the new one holds something already.
    OutputError
        If it cannot be written to.
    """
    studies = {folder: read_study(folder) for folder in folders}
    first = folders[0]
    for folder, study in studies.items():
        if study["identity"] != studies[first]["identity"]:
            raise StudyError(
                f"{folder} and {first} are of different studies: {study['name']} over "
                f"{study['axes']}, and {studies[first]['name']} over {studies[first]['axes']}, or "
                "of other scenarios. Merge what was run from one file"
            )
    with writing(target):
        target.mkdir(parents=True, exist_ok=True)
    with locked(target / LOCK):
        if rows.row_files(target):
            raise StudyError(f"{target} holds rows already: choose a new folder with -o")
        with writing(target):
            shutil.copyfile(first / STUDY, target / STUDY)
        return _copy(folders, target)


def _copy(folders: Sequence[Path], target: Path) -> Merged:
    seen: set[int] = set()
    doubles = 0
    with rows.RowFile(target / rows_name()) as file:
        for path in (path for folder in folders for path in rows.row_files(folder)):
            for block in rows.blocks(path):
                case = int(block[0][rows.ID], 16)
                doubles += case in seen
                if case not in seen:
                    file.append(b"".join(block))
                    seen.add(case)
    for folder in folders:
        for source in (folder / TRAJECTORIES).glob("*.nc"):
            with writing(target / TRAJECTORIES):
                (target / TRAJECTORIES).mkdir(exist_ok=True)
                shutil.copyfile(source, target / TRAJECTORIES / source.name)
    return Merged(len(seen), doubles)
