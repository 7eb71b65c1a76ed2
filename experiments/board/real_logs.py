"""Logs of real axes on a board: an entry follows a part of a log, and is judged on the rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board.entry import Entry, EntryError
from flexaxis.experiments.board.sandbox import Sandbox, SandboxError
from flexaxis.experiments.building.code import names_code
from flexaxis.experiments.building.specs import Spec, parse
from flexaxis.experiments.logs.axis_file import Axis, find_axis
from flexaxis.experiments.logs.identification.validate import validate
from flexaxis.experiments.logs.track import track
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import DEFAULT_IDENTIFY
from flexaxis.sim.record import Record, count_samples, record_pieces

SHARE = 0.7  # of a log, which an entry may follow
START = 1.2  # where it begins, over the values of the axis: who does nothing is not right


@dataclass(frozen=True)
class LogScore:
    """What an entry is worth on a log.

    Attributes
    ----------
    name, label, log : str
    error : float or None
        Rms error of the output that is simulated from the torque on the part held out, with the
        last estimates, over the rms of the output; None where it could not be run.
    nominal : float
        The same with the values that the entry began with.
    remark : str
        Why there is no error.
    leads : bool
    """

    name: str
    label: str
    log: str
    error: float | None
    nominal: float
    remark: str = ""
    leads: bool = False

    def as_json(self) -> dict[str, Any]:
        """Return it as it is stored."""
        return asdict(self)


def log_scores(entries: Sequence[Entry], folder: Path, *, run_code: bool = False) -> list[LogScore]:
    """Return what entries are worth on the logs in a folder.

    Parameters
    ----------
    entries : sequence of Entry
    folder : Path
        With NAME.nc, a record, and NAME.toml, the axis as `flexaxis identify` wrote it, for each.
    run_code : bool
        Whether entries may be run that name code; they run in the sandbox, as a case does.

    Raises
    ------
    EntryError
        If there is no log, or one without its axis.
    SandboxError
        If code of entries cannot be shut in.
    """
    paths = sorted(folder.glob("*.nc"))
    if not paths:
        raise EntryError(f"--logs {folder}: has no NAME.nc with a NAME.toml of `flexaxis identify`")
    found: list[LogScore] = []
    for path in paths:
        found += _marked(list(_of_log(entries, path, run_code)))
    return found


def _of_log(entries: Sequence[Entry], path: Path, run_code: bool) -> Iterator[LogScore]:
    axis = find_axis(str(path.with_suffix(".toml").resolve()))
    first, rest = record_pieces(path, samples=int(SHARE * count_samples(path)))
    identify = [n for n in DEFAULT_IDENTIFY if n.removeprefix("1/") in axis.model.nominal]
    begun = dict(zip(identify, START * axis.model.parametrize(identify).theta, strict=True))
    nominal = error_of(rest, with_values(axis, begun))
    for entry in entries:
        error, remark = None, ""
        if names_code(entry.estimator) and not run_code:
            remark = "names code: --run-code runs it"
        else:
            try:
                with _spec(entry) as spec:
                    tracked = track(first, axis, spec, identify=identify, start=START)
                last = dict(zip(tracked.names, tracked.last.tolist(), strict=True))
                error = error_of(rest, with_values(axis, last))
            except SandboxError:
                raise
            except (EstimatorError, FlexaxisError) as problem:
                remark = str(problem)
        yield LogScore(entry.about.name, entry.label, path.stem, error, nominal, remark)


@contextmanager
def _spec(entry: Entry) -> Iterator[Spec]:
    """Give what makes the estimator of an entry: where that is code, in the sandbox."""
    if not names_code(entry.estimator):
        yield parse(entry.estimator)
        return
    with Sandbox(entry.folder) as sandbox, ExitStack() as stack:

        def make(nominal: Any, period: float, *, identify: Any, output: str, torque: Any,
                 noise: Any = None, deviations: Any = None) -> Any:  # fmt: skip
            every = {"noise": noise, "deviations": deviations, "torque": torque.tolist()}
            offered = {"identify": list(identify), "output": output} | every
            asked = {
                "estimator": entry.estimator, "nominal": dict(nominal), "period": period,
                "offered": {key: value for key, value in offered.items() if value is not None},
            }  # fmt: skip
            return stack.enter_context(sandbox.case(asked, lambda which: torque))

        yield Spec(entry.estimator, make, {})


def error_of(record: Record, axis: Axis) -> float:
    """Return the error of a simulation from the torque, over the rms of the output."""
    try:
        return 1 - validate(record, axis).simulation / 100
    except FlexaxisError:  # it cannot be simulated: it predicts nothing
        return float("inf")


def with_values(axis: Axis, theta: Mapping[str, float]) -> Axis:
    """Return an axis with other values, of inverses such as ``1/J_a`` the parameters'."""
    values = {
        name.removeprefix("1/"): 1 / value if name.startswith("1/") else value
        for name, value in theta.items()
    }
    return axis.having(values)


def _marked(scores: list[LogScore]) -> list[LogScore]:
    least = min((s.error for s in scores if s.error is not None), default=None)
    return [replace(s, leads=s.error is not None and s.error == least) for s in scores]
