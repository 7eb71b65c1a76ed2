"""The folder of a study, or of a run: what is in it, who may write to it, what fits together.

study.json says what is studied; scores.jsonl, or scores-I-of-N.jsonl of each share, has the rows;
traces/ what the figures of a run are drawn from, trajectories/ estimates that were kept;
summary.json, curves.nc and report.html are made of these when all is done.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from flexaxis.experiments.building.code import digest
from flexaxis.experiments.running.errors import StudyError
from flexaxis.experiments.running.files import write_text, writing
from flexaxis.experiments.running.lock import locked
from flexaxis.experiments.running.plan import Plan, expected
from flexaxis.experiments.running.rows import row_files, share_of
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.traces import TRACES
from flexaxis.experiments.running.work import made_with

STUDY, SCORES, LOCK, TRAJECTORIES = "study.json", "scores.jsonl", ".lock", "trajectories"
REPORT = "report.html"
SUMMARY, CURVES, PREVIOUS, SWEEP = "summary.json", "curves.nc", "previous", "sweep"
COMPLETE = (SUMMARY, "compare.json", "tradeoff.json")
"""What is written last: a folder without any of these is not complete."""
COLUMNS = ".columns.h5"
MADE = (CURVES, REPORT, "verdict.md", "tradeoff.svg", COLUMNS)


def rows_name(shard: tuple[int, int] = (1, 1)) -> str:
    """Return the name of a share's file of rows."""
    mine, shares = shard
    return SCORES if shares == 1 else f"scores-{mine}-of-{shares}.jsonl"


@contextmanager
def opened(
    plan: Plan,
    folder: Path,
    *,
    resume: bool = False,
    replace: bool = False,
    about: Mapping[str, Any] | None = None,
) -> Iterator[Path]:
    """Take a folder for a plan, give its file of rows, and leave it to others at the end.

    Shares of one study may work side by side; anyone else is refused.

    Parameters
    ----------
    plan : Plan
    folder : Path
        Made if it is missing.
    resume : bool
        Whether rows may be there already, to go on from.
    replace : bool
        Whether a result that is there may make room: it is kept in the folder `previous` until
        the new one is complete (`completed`).
    about : mapping, optional
        What else is to stand in study.json.

    Raises
    ------
    StudyError
        If the folder holds something else or is in use, or holds rows and may not.
    OutputError
        If it cannot be written to.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        alone = plan.shard[1] == 1
        stack.enter_context(locked(folder / LOCK, shared=not alone))
        name = rows_name(plan.shard)
        if not alone:
            stack.enter_context(locked(folder / f".{name.removesuffix('.jsonl')}{LOCK}"))
        if replace and not resume:
            _set_aside(folder)
        check(plan.study, folder, plan.shard)
        rows = folder / name
        if not resume and rows.exists() and rows.stat().st_size:
            raise StudyError(
                f"{folder} holds rows of this study already: add --resume to go on with it, or "
                "choose another folder with -o"
            )
        content = described(plan)
        if _binds(folder, plan.shard):
            content = _with_those_before(folder, content)
        content |= dict(about or {})
        write_text(folder / STUDY, json.dumps(content, indent=1) + "\n")
        yield rows


def _with_those_before(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Return what study.json is to hold: what is added to a study takes nothing from it."""
    if not (folder / STUDY).exists():
        return content
    there = read_study(folder)
    for key in ("estimators", "seeds"):
        content[key] = list(dict.fromkeys([*there.get(key, []), *content[key]]))
    return content | {"code": there.get("code", {}) | content["code"]}


def _set_aside(folder: Path) -> None:
    """Move a complete result out of the way; rows of an unfinished one are given up.

    At every moment the old result is whole in one place at least: it is linked to the new place,
    that gets its name at once, and only then what is here goes. First what says that this is
    complete, and last study.json, which without rows does not count.
    """
    names = (*COMPLETE, *(path.name for path in row_files(folder)), *MADE, TRACES, SWEEP, STUDY)
    there = [path for name in names if (path := folder / name).exists()]
    staging = folder / f".{PREVIOUS}"
    with writing(folder):
        if there and there[0].name in COMPLETE:
            _remove(staging)  # of a process that was killed
            staging.mkdir()
            for path in there:
                _link(path, staging / path.name)
            _remove(folder / PREVIOUS)
            os.replace(staging, folder / PREVIOUS)
        for path in there:
            _remove(path)


def _link(source: Path, target: Path) -> None:
    """Give a file, or all files of a folder, a second name; where there are no links, copy it."""
    if source.is_dir():
        shutil.copytree(source, target, copy_function=_link_file)
    else:
        _link_file(source, target)


def _link_file(source: str | Path, target: str | Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def completed(folder: Path) -> None:
    """Remove what a complete result has replaced."""
    _remove(folder / PREVIOUS)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    with suppress(FileNotFoundError, IsADirectoryError, PermissionError):
        path.unlink()


def check(study: Study, folder: Path, shard: tuple[int, int] = (1, 1)) -> None:
    """Raise a StudyError if a folder holds anything that rows of a study do not go with."""
    if not _binds(folder, shard):
        return
    if not (folder / STUDY).exists():
        if found := row_files(folder):
            raise StudyError(
                f"{folder} holds {found[0].name}, which is not of a study: choose another folder "
                "with -o"
            )
        return
    there = read_study(folder)
    _check_identity(study, folder, there)
    _check_code(study, folder, there)
    _check_shares(folder, shard)


def _binds(folder: Path, shard: tuple[int, int]) -> bool:
    """Whether what a folder holds binds: it has rows, or another share is about to have some.

    What was killed may leave study.json without rows: that says nothing of those to come.
    """
    return shard[1] > 1 or any(path.stat().st_size for path in row_files(folder))


def _check_identity(study: Study, folder: Path, there: Mapping[str, Any]) -> None:
    mine = _scenarios(study)
    names = {entry["hash"]: entry["definition"]["name"] for entry in there["scenarios"]}
    if there["identity"] != study.identity:
        axes = _axes(study.axes, study.streams)
        raise StudyError(
            f"{folder} holds another study: of {_summary(there)}, and this is of "
            f"{', '.join(f'{name} ({key[:8]})' for key, name in mine.items())} over {axes}. Choose "
            "another folder with -o. (Estimators, seeds and values on the same axes may be added "
            "to a study, other axes and scenarios may not)"
        )
    for key, name in mine.items():
        if names[key] != name:
            raise StudyError(
                f"{folder} has the scenario {name} under the name {names[key]}, and its rows would "
                "go by two names: give it that name again, or choose another folder with -o"
            )


def _check_code(study: Study, folder: Path, there: Mapping[str, Any]) -> None:
    made = there.get("made_with", made_with())
    if made != made_with():
        raise StudyError(
            f"{folder} was made with {made}; this is {made_with()}. Rows of both would be mixed: "
            "choose another folder with -o, or go on there with what it was made with"
        )
    for text, known in there.get("code", {}).items():
        if text in study.estimators:
            check_code(text, known, folder)


def check_code(estimator: str, known: str | None, folder: Path) -> None:
    """Raise a StudyError if the code of an estimator is not that of its rows in a folder."""
    if digest(estimator) != known:
        raise StudyError(
            f"{folder} holds rows of {estimator} as its code was before (digest {known}, now "
            f"{digest(estimator)}). Rows of both would be mixed: choose another folder with -o"
        )


def _check_shares(folder: Path, shard: tuple[int, int]) -> None:
    others = {share_of(path) for path in row_files(folder)} - {None, shard[1]}
    if others and shard[1] > 1:
        raise StudyError(
            f"{folder} holds shares of {min(o for o in others if o)}, and this is one of "
            f"{shard[1]}: they overlap, so that cases would be run and counted twice. Give "
            "--shard with the same N, or choose another folder with -o"
        )


def _axes(axes: Sequence[str], streams: str) -> str:
    return f"{', '.join(axes)} with {streams} streams" if axes else "no axes"


def _scenarios(study: Study) -> dict[str, str]:
    return {scenario.hash: scenario.name for scenario in study.scenarios}


def _summary(content: Mapping[str, Any]) -> str:
    axes = _axes(content["axes"], content.get("streams", "own"))
    names = (f"{s['definition']['name']} ({s['hash'][:8]})" for s in content["scenarios"])
    return f"{', '.join(names)} over {axes}"


def described(plan: Plan) -> dict[str, Any]:
    """Return what study.json holds."""
    study = plan.study
    return {
        "name": study.name,
        "identity": study.identity,
        "scenarios": [{"hash": s.hash, "definition": s.resolved()} for s in study.scenarios],
        "estimators": list(study.estimators),
        "seeds": list(study.seeds),
        "axes": list(study.axes),
        "streams": study.streams,
        "points": len(study.points),
        "cases": expected(plan),
        "made_with": made_with(),
        "code": {text: digest(text) for text in study.estimators if digest(text)},
    }


def read_study(folder: Path) -> dict[str, Any]:
    """Return what study.json holds.

    Raises
    ------
    StudyError
        If there is none, or it is damaged.
    """
    try:
        content = json.loads((folder / STUDY).read_text(encoding="utf-8"))
        content["identity"], content["scenarios"], content["axes"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise StudyError(
            f"{folder} is not the folder of a run or a study ({STUDY} is missing or damaged). "
            "Make one with `flexaxis run … -o FOLDER` or `flexaxis study FILE.toml -o FOLDER`"
        ) from error
    return content
