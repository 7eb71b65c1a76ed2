"""Work with the logs of a real axis through `import_log`, `identify` and `track`.

Each of these functions returns a `LogResult` object, which contains a table, findings and figures.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis._records import draw
from flexaxis.experiments.logs import importing, pages
from flexaxis.experiments.logs import track as tracking
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import MARKS, texts_of
from flexaxis.experiments.logs.identify import find_logs, identify_many
from flexaxis.experiments.logs.identify import identify as fitted
from flexaxis.experiments.logs.verdict import validate as validated
from flexaxis.experiments.running.estimators import parse

Log = Any  # a path, a record, or what `import_log` returned


@dataclass(frozen=True, repr=False, eq=False)
class LogResult:
    """The result of `import_log`, `identify` or `track`: a table, sentences and figures.

    Attributes
    ----------
    result : object
        The full result, an object of the class ``Imported``, ``Identification``, ``Many`` or
        ``Tracked``.
    page : LogPage
        The report page with sentences and charts.
    content : dict
        The JSON object that the corresponding command prints with ``--json``.
    table : DataFrame
        Table with one row per check, per parameter or per log.
    write : callable
        Function that writes the record, axis, estimates or table to the given path.
    status : int
        Exit status of the corresponding command, which is 1 if the command reports a finding, such
        as a changed parameter.
    record : Record or None
        The record that was read from the log, or None for a folder of logs.
    axis : Axis or None
        The identified axis. The method ``axis.save`` writes an axis file, which `flexaxis track`
        can read.
    """

    result: Any
    page: pages.LogPage
    content: dict[str, Any]
    table: pd.DataFrame
    write: Callable[[Path], object]
    status: int = 0
    record: Any = None
    axis: Any = None

    def save(self, path: str | Path) -> Path:
        """Write the result to a file, write the report page, and return the path of the page."""
        self.write(Path(path))
        page = Path(path).with_suffix(".html")
        self.page.write(page)
        return page

    def plot(self, chart: int = 0, *, ax: Any = None) -> Any:
        """Draw one chart of the report page.

        Parameters
        ----------
        chart : int
            Index of the chart on the page, starting at 0.
        ax : matplotlib axes, optional
            Matplotlib axes, one for each panel of the chart (default: new axes).
        """
        shown = self.page.charts[chart]
        return draw(shown.panels, ax, **shown.options)

    def __repr__(self) -> str:
        lines = [f"{MARKS[one.kind]} {one.sentence}" for one in self.page.remarks]
        numbers = [] if self.page.table is None else [self.table.to_string()]
        return "\n".join([self.page.finding.text, *numbers, *lines])


def _read(log: Log, options: Mapping[str, Any] | None) -> importing.Imported:
    """Read a log, and print a message for each data problem that can distort the estimates."""
    if not isinstance(log, str | Path):
        return importing.Imported(getattr(log, "record", log), ())  # type: ignore[arg-type]
    result = importing.import_log(Path(log), **(options or {}))
    for text in texts_of(result.checks, "problem"):
        print(f"✗ {log}: {text}", file=sys.stderr)
    return result


def _axis(model: Any) -> Any:
    return find_axis(str(model)) if isinstance(model, str | Path) else getattr(model, "axis", model)


def import_log(path: str | Path, **columns: Any) -> LogResult:
    """Read a log and check its data quality, like the command `flexaxis import`.

    Parameters
    ----------
    path : str or Path
        Path of the log.
    **columns
        Options that describe the log format. The options are column names (``torque="current"``),
        ``unit={"angle": "deg"}``, ``scale``, ``rate``, ``rows``, ``torque_is``, ``resample`` [Hz]
        and ``burn_in`` [s].
    """
    result = _read(path, columns)
    checks = [vars(check) for check in result.checks]
    table = pd.DataFrame(checks).set_index("name")
    page = pages.import_page(result, Path(path).name)
    return LogResult(
        result, page, {"checks": checks}, table, result.record.save, record=result.record
    )


def identify(
    log: Log,
    model: Any = "two_mass",
    *,
    start: Mapping[str, float] | None = None,
    fix: Mapping[str, float | None] | None = None,
    validate: Log | None = None,
    covariates: Sequence[str] = (),
    false_alarms: float = 0.01,
    columns: Mapping[str, Any] | None = None,
    **options: Any,
) -> LogResult:
    """Identify axis parameters from one or several logs, like the command `flexaxis identify`.

    Parameters
    ----------
    log : path, record, result of `import_log`, or a folder of logs
        The log to use. If `log` is a folder, the function reads all its logs, sorted by file name.
        In this case, the result table contains one row per log, and the findings describe covariate
        effects and parameter changes.
    model : str, path or Axis
        Name of a built-in model, path of your own TOML file, or an `Axis` object.
    start : mapping of str to float, optional
        Start values for the parameter search, keyed by parameter name.
    fix : mapping of str to float or None, optional
        Values of the parameters to hold constant, keyed by parameter name. If you pass None for a
        parameter, the function holds the parameter at its nominal value.
    validate : path or record, optional
        Second log, on which the function tests the identified model.
    covariates : sequence of str
        Names of the columns that contain covariates, such as a temperature. Covariates can explain
        why the estimates differ between the logs in a folder.
    false_alarms : float
        Probability that the result for a folder of logs reports a parameter change although no
        parameter changed.
    columns : mapping, optional
        Options that describe the log format, with the same names as in `import_log`.
    **options
        The options ``free``, ``friction``, ``gravity`` and ``delay``, which
        `flexaxis.experiments.logs.identify.identify` describes.
    """
    axis, start, fix = _axis(model), start or {}, fix or {}
    values = {name: value for name, value in {**start, **fix}.items() if value is not None}
    laws = {name: values.pop(name) for name in {*values} - {*axis.model.parameters}}
    known = axis.known or bool(values.keys() & start.keys())
    axis = axis.having(values).model_copy(update={"known": known})
    if isinstance(log, str | Path) and Path(log).is_dir():
        many = identify_many(
            find_logs(Path(log)), axis, columns or {}, covariates=covariates,
            free=options.get("free", ()), false_alarms=false_alarms,
        )  # fmt: skip
        title = f"{axis.model.name} in {len(many.table)} logs"
        content = {"logs": many.table.to_dict("index"), "remarks": texts_of(many.findings, *MARKS)}
        return LogResult(
            many, pages.many_page(many, title), content, many.table, many.table.to_csv,
            many.status,
        )  # fmt: skip
    record = _read(log, columns).record
    result = fitted(record, axis, fix=tuple(fix), levels=laws, **options)
    other = None if validate is None else validated(_read(validate, columns).record, result.axis)
    title = f"{result.axis.model.name} from {record.versions.get('log', 'a record')}"
    page = pages.identification_page(result, other, title)
    content = pages.content(result, page.remarks)
    return LogResult(
        result, page, content, page.table, result.axis.save,
        int(bool(content["warnings"])), record, result.axis,
    )  # fmt: skip


def track(
    log: Log,
    axis: Any,
    parameters: Sequence[str],
    estimator: str | None = None,
    *,
    start: float = 1.0,
    columns: Mapping[str, Any] | None = None,
) -> LogResult:
    """Track parameters in a log with a recursive estimator, like the command `flexaxis track`.

    Parameters
    ----------
    log : path, record, or result of `import_log`
        The log to use.
    axis : path, Axis, or result of `identify`
        The identified axis.
    parameters : sequence of str
        Names of the parameters to track, such as ``["k_T", "1/J_l"]``.
    estimator : str, optional
        Estimator to use (default: ekf, or glr for an axis with dry friction).
    start : float
        Ratio of the initial estimate to the identified parameter value.
    columns : mapping, optional
        Options that describe the log format, with the same names as in `import_log`.
    """
    known = _axis(axis)
    spec = parse(estimator or tracking.default_estimator(known))
    read = _read(log, columns)
    result = tracking.track(read.record, known, spec, identify=parameters, start=start)
    page = pages.track_page(result, spec.text, read.record.versions.get("log", "a record"))
    content = page.table.to_dict() | {
        "fit": result.fit,
        "alarms": result.alarms.tolist(),
        "changes": [vars(change) for change in result.changes],
        "doubts": texts_of(result.findings, "problem"),
    }
    return LogResult(
        result, page, content, page.table, partial(result.save, estimator=spec.text), result.status,
        read.record, known,
    )  # fmt: skip
