"""The folder of a study: study.json, rows, trajectories, report.html; who may write to it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from flexaxis.experiments.running.files import write_text, writing
from flexaxis.experiments.running.lock import locked
from flexaxis.experiments.running.rows import row_files
from flexaxis.experiments.studies.definition import Study, StudyError

STUDY, LOCK, REPORT, TRAJECTORIES = "study.json", ".lock", "report.html", "trajectories"


def rows_name(shard: tuple[int, int] = (1, 1)) -> str:
    """Return the name of a share's file of rows."""
    mine, shares = shard
    return "rows.jsonl" if shares == 1 else f"rows-{mine}-of-{shares}.jsonl"


@contextmanager
def opened(
    study: Study, folder: Path, *, shard: tuple[int, int] = (1, 1), resume: bool = False
) -> Iterator[Path]:
    """Take a folder for a study, give its file of rows, and leave it to others at the end.

    Shares of one study may work side by side; anyone else is refused.

    Raises
    ------
    StudyError
        If the folder holds something else or is in use, or holds rows and `resume` is not set.
    OutputError
        If it cannot be written to.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        alone = shard[1] == 1
        stack.enter_context(locked(folder / LOCK, shared=not alone))
        if not alone:
            stack.enter_context(locked((folder / f".{rows_name(shard)}").with_suffix(LOCK)))
        check(study, folder)
        rows = folder / rows_name(shard)
        if not resume and rows.exists() and rows.stat().st_size:
            raise StudyError(
                f"{folder} holds rows of this study already: add --resume to go on with it, or "
                "choose another folder with -o"
            )
        write_text(folder / STUDY, json.dumps(described(study), indent=1) + "\n")
        yield rows


def check(study: Study, folder: Path) -> None:
    """Refuse a folder with rows of anything but this study."""
    if not (folder / STUDY).exists():
        if found := row_files(folder):
            raise StudyError(
                f"{folder} holds {found[0].name}, which is not of a study: choose another folder "
                "with -o"
            )
        return
    there = read_study(folder)
    if there["identity"] != study.identity:
        raise StudyError(
            f"{folder} holds another study: of {_summary(there)}, and this is of "
            f"{_summary(described(study))}. Choose another folder with -o. (Estimators, seeds and "
            "values on the same axes may be added to a study, other axes and scenarios may not)"
        )


def _summary(content: Mapping[str, Any]) -> str:
    axes = ", ".join(content["axes"]) or "no axes"
    names = (f"{s['definition']['name']} ({s['hash'][:8]})" for s in content["scenarios"])
    return f"{', '.join(names)} over {axes}"


def described(study: Study) -> dict[str, Any]:
    """Return what study.json holds."""
    return {
        "name": study.name,
        "identity": study.identity,
        "scenarios": [{"hash": s.hash, "definition": s.resolved()} for s in study.scenarios],
        "estimators": list(study.estimators),
        "seeds": list(study.seeds),
        "axes": list(study.axes),
        "points": len(study.points),
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
            f"{folder} is not the folder of a study ({STUDY} is missing or damaged). Make one "
            "with `flexaxis study FILE.toml -o FOLDER`"
        ) from error
    return content
