"""One folder of several: the shares of a study that were run apart."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.running import rows
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.files import new_file, writing
from flexaxis.experiments.running.folder import all_cases, read_study
from flexaxis.experiments.running.lock import locked
from flexaxis.experiments.running.names import LOCK, SCORES, STUDY, TRAJECTORIES
from flexaxis.experiments.running.sealed import write_sealed
from flexaxis.experiments.running.traces import trace_files
from flexaxis.sim.files import atomic


@dataclass(frozen=True)
class Merged:
    """What a new folder holds.

    Attributes
    ----------
    cases, doubles : int
        Cases, and how many were there more than once.
    missing : int or None
        Cases of the study that no folder had; None where that cannot be known, for the folders are
        of unlike estimators or seeds.
    makers : tuple of str
        With what they were made; more than one where shares were run by different versions or on
        different systems.
    """

    cases: int
    doubles: int
    missing: int | None
    makers: tuple[str, ...]


def merge(folders: Sequence[Path], target: Path) -> Merged:
    """Copy the complete cases of all folders to a new one, each once; the first folder wins.

    The same merge again copies nothing.

    Raises
    ------
    StudyError
        If the folders are of different studies, or of different code of an estimator, or the new
        one holds something else already.
    OutputError
        If it cannot be written to.
    """
    studies = {folder: read_study(folder) for folder in folders}
    content = _together(studies)
    with writing(target):
        target.mkdir(parents=True, exist_ok=True)
    with locked(target / LOCK):
        if rows.row_files(target):
            cases, doubles = _as_before(folders, target, content)
        else:
            cases, doubles = _made(folders, target, content)
    makers = dict.fromkeys(study.get("made_with", "unknown versions") for study in studies.values())
    missing = None if content["cases"] is None else max(0, content["cases"] - cases)
    return Merged(cases, doubles, missing, tuple(makers))


def _as_before(
    folders: Sequence[Path], target: Path, content: Mapping[str, Any]
) -> tuple[int, int]:
    """Take what is there for this merge if it is the same, as where its report was stopped."""
    found = [rows.done(folder) for folder in folders]
    mine = np.unique(np.concatenate(found))
    same = np.array_equal(mine, rows.done(target)) and (target / STUDY).exists()
    if not (same and read_study(target) == content):
        raise StudyError(f"{target} holds other rows already: choose a new folder with -o")
    return len(mine), sum(map(len, found)) - len(mine)


def _made(folders: Sequence[Path], target: Path, content: Mapping[str, Any]) -> tuple[int, int]:
    with new_file(target / SCORES) as part:
        found = _copy(folders, target, part)
        # Before the rows, which come all at once: rows without it are of no study.
        write_sealed(target / STUDY, content)
    return found


def _together(studies: Mapping[Path, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what study.json of the whole holds."""
    first, *others = studies
    content = dict(studies[first]) | {"cases": all_cases(list(studies.values()))}
    for folder in others:
        study = studies[folder]
        if study["identity"] != content["identity"]:
            raise StudyError(
                f"{folder} and {first} are of different studies: {study['name']} over "
                f"{study['axes']}, and {content['name']} over {content['axes']}, or "
                "of other scenarios. Merge what was run from one file"
            )
        _check_code(first, content, folder, study)
        for key in ("estimators", "seeds"):
            content[key] = list(dict.fromkeys([*content[key], *study[key]]))
        content["code"] = content.get("code", {}) | study.get("code", {})
    return content


def _check_code(
    first: Path, content: Mapping[str, Any], folder: Path, study: Mapping[str, Any]
) -> None:
    known = content.get("code", {})
    for text, digest in study.get("code", {}).items():
        if known.get(text, digest) != digest:
            raise StudyError(
                f"{folder} and {first} hold rows of {text} with different code (digests {digest} "
                f"and {known[text]}): run one of them again"
            )


def _copy(folders: Sequence[Path], target: Path, journal: Path) -> tuple[int, int]:
    seen: set[int] = set()
    doubles = 0
    for folder in folders:  # before the rows that they go with
        for source in [*(folder / TRAJECTORIES).glob("[!.]*.nc"), *trace_files(folder)]:
            place = target / source.parent.name / source.name
            with writing(place):
                place.parent.mkdir(exist_ok=True)
                with atomic(place) as part:
                    shutil.copyfile(source, part)
    with journal.open("wb") as file:
        for path in (path for folder in folders for path in rows.row_files(folder)):
            for block in rows.blocks(path):
                doubles += block.case in seen
                if block.case not in seen:
                    file.writelines(block.lines)
                    seen.add(block.case)
        file.flush()
        os.fsync(file.fileno())
    return len(seen), doubles
