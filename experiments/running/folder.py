"""The folder of a study, or of a run: who may write to it, and what fits together."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from flexaxis.experiments.building.code import digest
from flexaxis.experiments.running.errors import StudyError, no_study
from flexaxis.experiments.running.files import make_folder
from flexaxis.experiments.running.lock import locked
from flexaxis.experiments.running.names import LOCK, SCORES, STUDY
from flexaxis.experiments.running.plan import Plan, expected
from flexaxis.experiments.running.previous import is_unfinished, set_aside
from flexaxis.experiments.running.rows import done as cases_done
from flexaxis.experiments.running.rows import row_files, share_of
from flexaxis.experiments.running.sealed import read_sealed, write_sealed
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.running.told import remark
from flexaxis.experiments.running.work import made_with


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
    make_folder(folder)
    with ExitStack() as stack:
        alone = plan.shard[1] == 1
        stack.enter_context(locked(folder / LOCK, shared=not alone))
        name = rows_name(plan.shard)
        if not alone:
            stack.enter_context(locked(folder / f".{name.removesuffix('.jsonl')}{LOCK}"))
        if replace and not resume:
            _make_room(plan.study, folder, about or {})
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
        write_sealed(folder / STUDY, content)
        yield rows


def _make_room(study: Study, folder: Path, about: Mapping[str, Any]) -> None:
    """Move a result out of the way that may be replaced, and say so; refuse what may not.

    Raises
    ------
    StudyError
        If what is there is a study with axes, which may have taken days, shares, or an unfinished
        run of something else.
    """
    if (folder / STUDY).exists() and _binds(folder, (1, 1)):
        there = read_study(folder)
        done = not is_unfinished(folder)
        if there["axes"] or any(share_of(path) for path in row_files(folder)):
            what = f"a study of {_summary(there)}" if there["axes"] else "shares of a run"
            raise StudyError(f"{folder} holds {what}: choose another folder with -o")
        if not done and there["identity"] != study.identity:
            raise StudyError(
                f"{folder} holds an unfinished run of {_summary(there)}: go on with it by "
                "--resume and its own line, remove it, or choose another folder with -o"
            )
        if done and not _contains(study, about, there):
            _tell_replaced(study, folder, there)
    set_aside(folder)


def _contains(study: Study, about: Mapping[str, Any], there: Mapping[str, Any]) -> bool:
    """Whether a study will have all that is there, or is of the same line on the same scenarios."""
    if there["identity"] != study.identity:
        return False
    if there.get("command") and there["command"] == about.get("command"):
        return True
    estimators, seeds = there.get("estimators"), there.get("seeds")
    if not (estimators and seeds):  # as of a comparison
        return False
    return {*estimators} <= {*study.estimators} and {*seeds} <= {*study.seeds}


def _tell_replaced(study: Study, folder: Path, there: Mapping[str, Any]) -> None:
    """Say what goes that nobody may have meant to lose."""
    count = cases_done(folder).size
    of = there.get("command") or _summary(there)
    keep = "--resume" if there["identity"] == study.identity else "another folder with -o"
    remark(f"{folder}: replaces {count} case{'s'[: count != 1]} of: {of}; {keep} keeps them")


def _with_those_before(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Return what study.json is to hold: what is added to a study takes nothing from it."""
    if not (folder / STUDY).exists():
        return content
    there = read_study(folder)
    for key in ("estimators", "seeds"):
        content[key] = list(dict.fromkeys([*there.get(key, []), *content[key]]))
    code = there.get("code", {}) | content["code"]
    return content | {"code": code, "cases": all_cases([there, content])}


def all_cases(studies: Sequence[Mapping[str, Any]]) -> int | None:
    """Return how many cases a whole of several studies has; None where that is not known.

    Parameters
    ----------
    studies : sequence of mapping
        As in study.json, of one identity.
    """
    lists = [{tuple(study[key]) for study in studies} for key in ("estimators", "seeds")]
    if all(len(each) == 1 for each in lists):
        return max((study.get("cases") or 0 for study in studies), default=0)
    if studies[0]["axes"]:  # which estimator was run at which points is not told
        return None
    sizes = [len({one for each in given for one in each}) for given in lists]
    return len(studies[0]["scenarios"]) * sizes[0] * sizes[1]


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
        content = read_sealed(folder / STUDY, StudyError)
        content["identity"], [*map(str, content["axes"])]
        for entry in content["scenarios"]:
            entry["hash"], entry["definition"]["name"]
    except (StudyError, KeyError, TypeError) as error:
        raise no_study(folder, error) from error
    return content
