"""One folder of several: shares that were run apart, and folders of flexaxis 0.1."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.storage.files import (
    STUDY,
    TRAJECTORIES,
    StudyError,
    make_folder,
    read_rows,
    text_files,
    write_json,
    writing,
)
from flexaxis.experiments.storage.schema import file_of, row_files
from flexaxis.experiments.storage.store import Store
from flexaxis.sim.storage.atomic_files import atomic

AT_ONCE = 10_000  # rows of text


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
    makers = dict.fromkeys(study.get("made_with", "unknown versions") for study in studies.values())
    wanted = content.get("asked", {}).get("cases")
    missing = None if wanted is None else max(0, wanted - total)
    return Merged(total, max(0, found - total), missing, tuple(makers))


def _taken(store: Store, folder: Path) -> Iterator[int]:
    """Add the rows of a folder, and yield the numbers of cases in its files."""
    old = [] if any(folder.glob("*.sqlite")) else text_files(folder)
    for path in old:
        every, before = read_rows(path), store.cases
        while some := [_as_now(row) for row in islice(every, AT_ONCE)]:
            try:
                store.add(some)
            except StudyError:
                raise
            except ValueError as error:
                raise StudyError(f"{path}: {error}") from error
        yield store.cases - before
    for path in () if old else row_files(folder):
        yield store.take(path)


def _as_now(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of 0.1 with what such rows did not say."""
    failed = row.get("error") is not None
    return {"base": row.get("scenario"), "method": row.get("estimator"), "failed": failed} | row


def _together(studies: Mapping[Path, Mapping[str, Any]]) -> dict[str, Any]:
    """Return what study.json of the whole holds."""
    first, *others = studies
    content = {k: v for k, v in studies[first].items() if k not in {"identity", "seal"}}
    asked = dict(content.pop("asked", {}) or _asked(content))
    for folder in others:
        study = studies[folder]
        if _identity(study) != _identity(content):
            raise StudyError(
                f"{folder} and {first} are of different studies: {study['name']} over "
                f"{study['axes']}, and {content['name']} over {content['axes']}, or "
                "of other scenarios. Merge what was run from one file"
            )
        _check_code(first, content, folder, study)
        its = study.get("asked") or _asked(study)
        if its != asked:
            asked = {
                k: list(dict.fromkeys([*v, *its[k]])) for k, v in asked.items() if k != "cases"
            }
            asked["cases"] = _all_cases(content, asked)
        for key in ("estimators", "seeds"):
            content[key] = list(dict.fromkeys([*content[key], *study[key]]))
        content["code"] = content.get("code", {}) | study.get("code", {})
    return content | {"asked": asked}


def _asked(study: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was asked for in a folder of 0.1: all that it has."""
    found = {key: study.get(key, []) for key in ("estimators", "seeds")}
    hashes = [entry["hash"] for entry in study["scenarios"]]
    return found | {"scenarios": hashes, "cases": study.get("cases")}


def _all_cases(study: Mapping[str, Any], asked: Mapping[str, Any]) -> int | None:
    """Return how many cases there are of all that was asked, where nothing is swept."""
    if study["axes"]:  # which estimator was run at which points is not told
        return None
    return len(asked["scenarios"]) * len(asked["estimators"]) * len(asked["seeds"])


def _identity(study: Mapping[str, Any]) -> Any:
    """Return what is alike in the shares of one study."""
    hashes = sorted(entry["hash"] for entry in study["scenarios"])
    return hashes, sorted(study["axes"]), study.get("streams", "own") if study["axes"] else None


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


def _copy_trajectories(folder: Path, target: Path) -> None:
    for source in (folder / TRAJECTORIES).glob("[!.]*.nc"):
        place = target / TRAJECTORIES / source.name
        with writing(place):
            place.parent.mkdir(exist_ok=True)
            with atomic(place) as part:
                shutil.copyfile(source, part)
