"""One folder of several: shares that were run apart."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.storage.files import (
    STUDY,
    TRAJECTORIES,
    StudyError,
    make_folder,
    write_json,
    writing,
)
from flexaxis.experiments.storage.schema import file_of, row_files
from flexaxis.experiments.storage.store import Store
from flexaxis.sim.storage.atomic_files import atomic


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
    """Add the cases of all folders to one, each once; the first folder wins.

    Raises
    ------
    StudyError
        If the folders are of different studies, or the new one holds another one.
    OutputError
        If it cannot be written to.
    """
    studies = {folder: read_study(folder, whole=True) for folder in folders}
    make_folder(target)
    if (target / STUDY).exists():
        studies = {target: read_study(target, whole=True)} | studies
    content = _together(studies)
    write_json(target / STUDY, content)  # before the rows, which without it are of no study
    found = 0
    with Store(target / file_of(), content["axes"]) as store:
        for folder in folders:
            _copy_trajectories(folder, target)
            found += sum(cases for cases in _taken(store, folder))
        total = store.cases
    makers = dict.fromkeys(study["made_with"] for study in studies.values())
    wanted = content["asked"]["cases"]
    missing = None if wanted is None else max(0, wanted - total)
    return Merged(total, max(0, found - total), missing, tuple(makers))


def _taken(store: Store, folder: Path) -> Iterator[int]:
    """Add the rows of a folder, and yield the numbers of cases in its files."""
    for path in row_files(folder):
        yield store.take(path)


def _together(studies: Mapping[Path, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what study.json of the whole holds."""
    first, *others = studies
    content = {k: v for k, v in studies[first].items() if k not in {"identity", "seal"}}
    asked = dict(content.pop("asked"))
    for folder in others:
        study = studies[folder]
        if _identity(study) != _identity(content):
            raise StudyError(
                f"{folder} and {first} are of different studies: {study['name']} over "
                f"{study['axes']}, and {content['name']} over {content['axes']}, or "
                "of other scenarios. Merge what was run from one file"
            )
        _check_code(first, content, folder, study)
        its = study["asked"]
        if its != asked:
            asked = {
                k: list(dict.fromkeys([*v, *its[k]])) for k, v in asked.items() if k != "cases"
            }
            asked["cases"] = _all_cases(content, asked)
        for key in ("estimators", "seeds"):
            content[key] = list(dict.fromkeys([*content[key], *study[key]]))
        content["code"] |= study["code"]
    return content | {"asked": asked}


def _all_cases(study: Mapping[str, Any], asked: Mapping[str, Any]) -> int | None:
    """Return how many cases there are of all that was asked, where nothing is swept."""
    if study["axes"]:  # which estimator was run at which points is not told
        return None
    return len(asked["scenarios"]) * len(asked["estimators"]) * len(asked["seeds"])


def _identity(study: Mapping[str, Any]) -> Any:
    """Return what is alike in the shares of one study."""
    hashes = sorted(entry["hash"] for entry in study["scenarios"])
    return hashes, sorted(study["axes"]), study["streams"] if study["axes"] else None


def _check_code(
    first: Path, content: Mapping[str, Any], folder: Path, study: Mapping[str, Any]
) -> None:
    known = content["code"]
    for text, digest in study["code"].items():
        if known.get(text, digest) != digest:
            raise StudyError(
                f"{folder} and {first} hold rows of {text} with different code (digests {digest} "
                f"and {known[text]}): run one of them again"
            )


def _copy_trajectories(folder: Path, target: Path) -> None:
    for source in (folder / TRAJECTORIES).glob("[!.]*.nc"):
        place = target / TRAJECTORIES / source.name
        with writing(place):
            place.parent.mkdir(exist_ok=True)
            with atomic(place) as part:
                shutil.copyfile(source, part)
