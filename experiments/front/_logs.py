"""Logs of a real axis: `import_log`, `identify`, `track`, with tables and figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis._records import panels
from flexaxis.experiments.logs import pages
from flexaxis.experiments.logs import track as tracking
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.findings import MARKS, say_problems, texts_of, waiting
from flexaxis.experiments.logs.identify import identify as fitted
from flexaxis.experiments.logs.importing import import_any
from flexaxis.experiments.logs.importing import import_log as imported
from flexaxis.experiments.logs.many import find_logs, identify_many
from flexaxis.experiments.logs.validate import validate as validated
from flexaxis.experiments.running.estimators import parse
from flexaxis.sim.record import Record

Log = Any  # a path, a record, or what `import_log` returned


@dataclass(frozen=True, repr=False, eq=False)
class LogResult:
    """The result for a log: a table, sentences with a mark each, and figures.

    Attributes
    ----------
    found : object
        All of it: an ``Imported``, ``Identification``, ``Many`` or ``Tracked``.
    table : DataFrame
        A line a check or a parameter.
    page : LogPage
        Sentences and charts, as they are on the page.
    content : dict
        What the command prints with ``--json``.
    status : int
        Exit status of the command: 1 for a finding.
    record : Record or None
        The record of the log.
    axis : Axis or None
        The axis; its `save` writes the file that the commands read.
    """

    found: Any
    table: pd.DataFrame
    page: pages.LogPage
    content: dict[str, Any]
    status: int = 0
    record: Any = None
    axis: Any = None
    write: Callable[[Path], object] = lambda path: None

    def save(self, path: str | Path) -> Path:
        """Write the record, axis or estimates, and the page beside it; return the page."""
        self.write(Path(path))
        page = Path(path).with_suffix(".html")
        self.page.write(page)
        return page

    def plot(self, chart: int | str = 0, *, ax: Any = None) -> Any:
        """Draw a chart of the page.

        Parameters
        ----------
        chart : int or str
            Its place on the page, or its title.
        ax : matplotlib axes, optional
            One for each of its panels; new ones by default.
        """
        titles = [one.title for one in self.page.charts]
        shown = self.page.charts[titles.index(chart) if isinstance(chart, str) else chart]
        axes = panels(ax, len(shown.panels))
        shown.draw(axes=axes)
        return axes[0] if len(axes) == 1 else np.array(axes, object)

    def __repr__(self) -> str:
        table = [self.table.to_string(float_format="{:.5g}".format)] * bool(len(self.table))
        lines = [f"{MARKS[one.kind]} {one.sentence}" for one in self.page.remarks]
        return "\n".join([self.page.finding.text, *table, *lines])

    def _repr_html_(self) -> str:
        return f"<pre>{self!r}</pre>"


def _read(log: Log, options: Mapping[str, Any]) -> tuple[Record, Any]:
    """Return the record of a log and its checks; warn of what spoils estimates."""
    if not isinstance(log, str | Path):
        return getattr(log, "record", log), ()
    columns, treated = _split(options)
    with waiting(f"reading {log}"):
        found = import_any(Path(log), columns, **treated)
    say_problems(Path(log), found.checks)
    return found.record, found.checks


def _split(options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return which columns to read, and what is done to them."""
    columns = dict(options)
    return columns, {name: columns.pop(name, None) for name in ("resample", "burn_in")}


def _axis(model: Any) -> Any:
    return find_axis(str(model)) if isinstance(model, str | Path) else getattr(model, "axis", model)


def _table(lines: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    table = pd.DataFrame(lines)
    return table.set_index(table.columns[0]) if lines else table


def import_log(path: str | Path, *, command: str = "", **options: Any) -> LogResult:
    """Read a log, and check it before any estimator does; `flexaxis import` in Python.

    Parameters
    ----------
    path : str or Path
    command : str
        The line that does it again, for the page.
    **options
        Columns (``torque="current"``), ``unit={"angle": "deg"}``, ``scale``, ``rate``, ``rows``,
        ``torque_is``; ``resample`` [Hz] and ``burn_in`` [s].
    """
    columns, treated = _split(options)
    with waiting(f"importing {path}"):
        found = imported(Path(path), columns, **treated)
    checks = [check.told() for check in found.checks]
    return LogResult(
        found, _table(checks), pages.import_page(found, Path(path).name, command),
        {"checks": checks}, record=found.record, write=found.record.save,
    )  # fmt: skip


def identify(
    log: Log,
    model: Any = "two_mass",
    *,
    start: Mapping[str, float] | None = None,
    fix: Mapping[str, float | None] | Sequence[str] = (),
    free: Sequence[str] = (),
    validate: Log | None = None,
    covariates: Sequence[str] = (),
    false_alarms: float = 0.01,
    columns: Mapping[str, Any] | None = None,
    command: str = "",
    **options: Any,
) -> LogResult:
    """Identify an axis from its log, or from many; `flexaxis identify` in Python.

    Parameters
    ----------
    log : path, record, or what `import_log` returned; folder or sequence of paths
        Of a folder or several logs in the order of time, the table has a row each, and the
        findings tell what a covariate explains and whether a parameter changed.
    model : str, path or Axis
        A shipped model, a TOML of your own, or an axis.
    start : mapping of str to float, optional
        Where the search starts.
    fix : mapping of str to float or None, or sequence of str
        Parameters to hold, at a value or at their nominal one.
    free : sequence of str
        Parameters to identify, and no others.
    validate : path or record, optional
        Another log, to simulate and predict with the result.
    covariates : sequence of str
        Columns of many logs that may explain the estimates, such as a temperature.
    false_alarms : float
        Probability that many logs without a change show one.
    columns : mapping, optional
        How to read a log, as the options of `import_log`.
    command : str
        The line that does it again, for the page.
    **options
        ``friction, gravity, delay, highpass`` as of
        `flexaxis.experiments.logs.identify.identify`.
    """
    axis, start, fixed = _axis(model), dict(start or {}), dict(
        fix if isinstance(fix, Mapping) else dict.fromkeys(fix)
    )  # fmt: skip
    values = {name: value for name, value in (start | fixed).items() if value is not None}
    own = {name: value for name, value in values.items() if name in axis.model.parameters}
    laws = {name: value for name, value in values.items() if name not in own}
    axis = axis.having(own)
    axis = replace(axis, known=True) if own.keys() & start.keys() else axis
    if isinstance(log, list | tuple) or (isinstance(log, str | Path) and Path(log).is_dir()):
        logs = find_logs(Path(log)) if isinstance(log, str | Path) else [*map(Path, log)]
        names, treated = _split(columns or {})
        with waiting(f"identifying {len(logs)} logs"):
            many = identify_many(logs, axis, names, covariates=covariates, free=free,
                                 false_alarms=false_alarms, **treated)  # fmt: skip
        title = f"{axis.model.name} in {len(many.table)} logs"
        return LogResult(
            many, many.table, pages.many_page(many, title, command),
            {"logs": many.table.to_dict("index"), "remarks": texts_of(many.findings, *MARKS)},
            many.status, write=many.table.to_csv,
        )  # fmt: skip
    record, _ = _read(log, columns or {})
    with waiting(f"identifying {axis.model.name}"):
        found = fitted(record, axis, free=free, fix=tuple(fixed), given=laws, **options)
    other = None if validate is None else validated(_read(validate, columns or {})[0], found.axis)
    lines = [{"parameter": name, "value": value, "sd": sd}
             for name, (value, sd) in found.estimates.items()]  # fmt: skip
    title = f"{found.axis.model.name} from {log if isinstance(log, str | Path) else 'a record'}"
    page = pages.identification_page(found, record.period, other, title, command)
    content = pages.content(found, other)
    status = int(bool(content["warnings"]))
    return LogResult(
        found, _table(lines), page, content, status, record, found.axis, found.axis.save
    )


def track(
    log: Log,
    axis: Any,
    parameters: Sequence[str],
    estimator: str | None = None,
    *,
    start: float = 1.0,
    columns: Mapping[str, Any] | None = None,
    command: str = "",
) -> LogResult:
    """Follow parameters along a log by a recursive estimator; `flexaxis track` in Python.

    Parameters
    ----------
    log : path, record, or what `import_log` returned
    axis : path, Axis, or what `identify` returned
    parameters : sequence of str
        Such as ``["k_T", "1/J_l"]``.
    estimator : str, optional
        By default ekf, or glr for an axis with dry friction.
    start : float
        Initial estimate as a multiple of the identified value.
    columns, command
        As for `identify`.
    """
    known = _axis(axis)
    record, checks = _read(log, columns or {})
    spec = parse(estimator or tracking.default_estimator(known))
    with waiting(f"tracking {', '.join(parameters)}"):
        found = tracking.track(record, known, spec, identify=parameters, start=start)
    values = zip(found.names, found.last.tolist(), found.nominal.tolist(), strict=True)
    lines = [{"parameter": n, "last": v, "nominal": of, "ratio": v / of} for n, v, of in values]
    name = Path(log).name if isinstance(log, str | Path) else "a record"
    page = pages.track_page(
        found, spec.text, problems=texts_of(checks, "problem"), log=name, command=command
    )
    content = {
        "last": dict(zip(found.names, found.last.tolist(), strict=True)),
        "nominal": dict(zip(found.names, found.nominal.tolist(), strict=True)),
        "fit": found.fit,
        "residual": {"correlation": found.correlation},
        "alarms": found.alarms.tolist(),
        "changes": [vars(change) for change in found.changes],
        "doubts": texts_of(found.findings, "problem"),
    }
    return LogResult(
        found, _table(lines), page, content, found.status, record, known,
        lambda path: found.save(path, estimator=spec.text),
    )  # fmt: skip
