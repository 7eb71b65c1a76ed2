"""The folder of a study, or of a run: what it is about, what is in it, and what may be added."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.building.code import is_given
from flexaxis.experiments.running.plan import Plan, expected
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.work import made_with
from flexaxis.experiments.storage.files import (
    COMPLETE,
    MADE,
    STUDY,
    SWEEP,
    TRAJECTORIES,
    StudyError,
    json_table,
    make_folder,
    no_study,
    write_json,
    writing,
)
from flexaxis.experiments.storage.schema import connect, file_of, row_files, said
from flexaxis.experiments.storage.store import Store, cases_in, done_in

OVERWRITE = "--overwrite"
"""The only word that removes anything."""


@contextmanager
def opened(
    plan: Plan, folder: Path, *, overwrite: bool = False, about: Mapping[str, Any] | None = None
) -> Iterator[Store]:
    """Give the file of rows of a folder, for a plan; others may add to the folder meanwhile.

    Parameters
    ----------
    plan : Plan
    folder : Path
        Made if it is missing.
    overwrite : bool
        Whether what is there is removed first; else rows are added to it.
    about : mapping, optional
        What else is to stand in study.json.

    Raises
    ------
    StudyError
        If it holds what rows of this do not go with.
    OutputError
        If it cannot be written to.
    """
    make_folder(folder)
    if overwrite:
        clear(folder)
    there = check(plan.study, folder)
    content = described(plan) | dict(about or {})
    write_json(folder / STUDY, _with_those_before(there, content) if there else content)
    with Store(folder / file_of(plan.shard), plan.study.axes) as store:
        yield store


def clear(folder: Path) -> None:
    """Remove a result and its rows; files of others stay. First goes what says it is complete."""
    rows = sorted(path.name for path in folder.glob("scores*"))
    with writing(folder):
        for name in (*COMPLETE, *rows, *MADE, TRAJECTORIES, SWEEP, STUDY):
            path = folder / name
            if path.is_dir():
                shutil.rmtree(path)
            path.unlink(missing_ok=True)


def done(folder: Path, plan: Plan) -> NDArray[np.uint64]:
    """Return the cases of the estimators of a plan, with their code, that a folder has; sorted."""
    found = [np.empty(0, np.uint64)]
    for path in row_files(folder):
        with said(path), closing(connect(path)) as db:
            found.append(done_in(db, plan.codes))
    return np.unique(np.concatenate(found))


def cases(folder: Path) -> int:
    """Return how many cases the files of rows in a folder have."""
    found = 0
    for path in row_files(folder):
        with said(path), closing(connect(path)) as db:
            found += cases_in(db)
    return found


def _with_those_before(there: Mapping[str, Any], content: dict[str, Any]) -> dict[str, Any]:
    """Return what study.json is to hold: what is added to a folder takes nothing from it."""
    for key in ("estimators", "seeds"):
        content[key] = list(dict.fromkeys([*there.get(key, []), *content[key]]))
    hashes = {entry["hash"] for entry in content["scenarios"]}
    before = [entry for entry in there["scenarios"] if entry["hash"] not in hashes]
    code = there["code"] | content["code"]
    return content | {"code": code, "scenarios": [*content["scenarios"], *before]}


def check(study: Study, folder: Path) -> dict[str, Any] | None:
    """Return what study.json of a folder with rows says, None where there are none.

    Raises
    ------
    StudyError
        If rows of the study do not go with those.
    """
    found = row_files(folder)
    if not found or not cases(folder):
        return None  # what was killed before its first row says nothing of those to come
    if not (folder / STUDY).exists():
        raise StudyError(
            f"{folder} holds {found[0].name}, which is not of a study: choose another folder with "
            "-o"
        )
    there = read_study(folder, whole=True)
    _check_axes(study, folder, there)
    if (made := there["made_with"]) != made_with():
        raise StudyError(
            f"{folder} was made with {made}; this is {made_with()}. Rows of both would be mixed: "
            f"choose another folder with -o, or remove what is there with {OVERWRITE}"
        )
    for text in study.estimators:
        if is_given(text) and text in there["estimators"]:
            raise StudyError(
                f"{folder} holds rows of {text}, a class of a session, of which nobody knows "
                f'whether it is what they were made with: put it in a file and give "path/file.py:'
                f'{text}", or remove what is there with overwrite=True'
            )
    return there


def _check_axes(study: Study, folder: Path, there: Mapping[str, Any]) -> None:
    before = _axes(there["axes"], there["streams"])
    if before != (mine := _axes(study.axes, study.streams)):
        raise StudyError(
            f"{folder} holds rows over {before}, and this is over {mine}: choose another folder "
            f"with -o, or remove what is there with {OVERWRITE}. (Scenarios, estimators, seeds and "
            "values on the same axes may be added, other axes may not)"
        )
    names = {entry["hash"]: entry["definition"]["name"] for entry in there["scenarios"]}
    for scenario in study.scenarios:
        name = names.get(scenario.hash, scenario.name)
        if name != scenario.name:
            raise StudyError(
                f"{folder} has the scenario {scenario.name} under the name {name}, and its rows "
                "would go by two names: give it that name again, or choose another folder with -o"
            )


def _axes(axes: Sequence[str], streams: str) -> str:
    return f"{', '.join(sorted(axes))} with {streams} streams" if axes else "no axes"


def described(plan: Plan) -> dict[str, Any]:
    """Return what study.json holds."""
    study = plan.study
    codes = {entry.method: entry.code for v in plan.variants for entry in v.entries}
    return {
        "name": study.name,
        "scenarios": [{"hash": s.hash, "definition": s.resolved()} for s in study.scenarios],
        "estimators": list(study.estimators),
        "seeds": list(study.seeds),
        "axes": list(study.axes),
        "streams": study.streams,
        "points": len(study.points),
        "made_with": made_with(),
        "code": {text: code for text, code in codes.items() if code},
        "asked": {
            "scenarios": [s.hash for s in study.scenarios],
            "estimators": list(study.estimators),
            "seeds": list(study.seeds),
            "hashes": sorted(variant.hash for variant in plan.variants),
            "cases": expected(plan),
        },
    }


def read_study(folder: Path, *, whole: bool = False) -> dict[str, Any]:
    """Return what study.json holds: of what was asked for last, or of the `whole` folder.

    Raises
    ------
    StudyError
        If there is none, or it is damaged.
    """
    try:
        content = json_table(folder / STUDY, StudyError)
        [*map(str, content["axes"])]
        for entry in content["scenarios"]:
            entry["hash"], entry["definition"]["name"]
        return content if whole else _narrowed(content)
    except (StudyError, KeyError, TypeError, AttributeError) as error:
        raise no_study(folder, error) from error


def _narrowed(content: dict[str, Any]) -> dict[str, Any]:
    asked = content["asked"]
    if not asked["estimators"]:  # as of a comparison
        return content
    mine = {entry["hash"]: entry for entry in content["scenarios"]}
    narrowed = {key: asked[key] for key in ("estimators", "seeds")}
    return content | narrowed | {"scenarios": [mine[key] for key in asked["scenarios"]]}
