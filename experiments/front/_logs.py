"""Your own logs: `import_log`, `identify`, `track` and `trend`, as tables with figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis._draw import panels, returned
from flexaxis._table import ShownTable

if TYPE_CHECKING:
    from flexaxis.experiments.logs.axis_file import Axis
    from flexaxis.experiments.reporting.charts_old.charts import Chart
    from flexaxis.sim.record import Record

Log = Any  # a path, a record, or what `import_log` returned


class LogResult(ShownTable):
    """What came of a log or of many: a line for each thing that was looked at or estimated.

    Attributes
    ----------
    found : object
        All of it: an ``Imported``, ``Identification``, ``Tracked``, or the verdicts of a trend.
    record : Record or None
        That was read.
    axis : Axis or None
        That was identified; its `save` writes the file that the commands take.
    charts : list of Chart
        What `plot` draws.
    """

    def __init__(
        self,
        lines: Sequence[Mapping[str, Any]],
        found: Any,
        charts: Sequence[Chart],
        *,
        record: Record | None = None,
        axis: Axis | None = None,
    ) -> None:
        super().__init__(lines)
        self.found, self.record, self.axis, self.charts = found, record, axis, list(charts)

    def plot(self, chart: int | str = 0, *, ax: Any = None) -> Any:
        """Draw a chart of the page that the command makes.

        Parameters
        ----------
        chart : int or str
            Its place in `charts`, or its title.
        ax : matplotlib axes, optional
            One for each of its panels; new ones by default.

        Returns
        -------
        Axes
        """
        from flexaxis.experiments.reporting.charts_old.figures import draw

        titles = [each.title for each in self.charts]
        shown = self.charts[titles.index(chart) if isinstance(chart, str) else chart]
        axes = panels(ax, len(shown.panels))
        for place, each in enumerate(axes):
            draw(shown, each, panel=place).label_outer()
            each.legend(frameon=False, fontsize=8)
        axes[0].set_title(shown.title)
        return returned(axes)


def import_log(path: str | Path, **options: Any) -> LogResult:
    """Read a log, and say what is to be doubted of it; `flexaxis import` in Python.

    Parameters
    ----------
    path : str or Path
    **options
        Columns (``torque="current"``), ``unit={"angle": "deg"}``, ``scale``, ``rate``, ``rows``,
        ``torque_is``; ``resample`` [Hz] and ``burn_in`` [s].
    """
    from flexaxis.experiments.logs.importing import import_log as read
    from flexaxis.experiments.logs.pages.import_page import log_chart, spectrum_chart

    treated = {name: options.pop(name, None) for name in ("resample", "burn_in")}
    found = read(Path(path), options, **treated)
    charts = [log_chart(found.record), spectrum_chart(found.record)]
    return LogResult([c.told() for c in found.checks], found, charts, record=found.record)


def identify(log: Log, model: Any = "two_mass", **options: Any) -> LogResult:
    """Identify an axis from its log; `flexaxis identify` in Python.

    Parameters
    ----------
    log : path, record, or what `import_log` returned
    model : str, path or Axis
        A shipped model, a TOML of your own, or an axis.
    **options
        As of `flexaxis.experiments.logs.identification.identify.identify`: ``friction``,
        ``gravity``, ``free``, ``fix``, ``delay``, ``highpass``; and ``start={"k": 500.0}``.
    """
    from flexaxis.experiments.logs.identification.identify import identify as fitted
    from flexaxis.experiments.logs.pages.identify_page import identification_charts

    record, axis = _record(log), _axis(model)
    start = options.pop("start", {})
    axis = replace(axis.having(start), known=True) if start else axis
    found = fitted(record, axis, **options)
    told = found.estimates.items()
    lines = [{"parameter": name, "value": value, "sd": sd} for name, (value, sd) in told]
    charts = identification_charts(found, record.period)
    return LogResult(lines, found, charts, record=record, axis=found.axis)


def track(
    log: Log,
    axis: Any,
    parameters: Sequence[str],
    estimator: str | None = None,
    *,
    start: float = 1.0,
) -> LogResult:
    """Follow parameters along a log by a recursive estimator; `flexaxis track` in Python.

    Parameters
    ----------
    log : path, record, or what `import_log` returned
    axis : path, Axis, or what `identify` returned
    parameters : sequence of str
        Such as ``["k_T", "1/J_l"]``.
    estimator : str, optional
        The recommended one for such an axis by default.
    start : float
        θ(0) over what was identified.
    """
    from flexaxis.experiments.logs.pages.track_page import estimates_chart, residual_chart
    from flexaxis.experiments.logs.track import default_estimator
    from flexaxis.experiments.logs.track import track as tracked
    from flexaxis.experiments.running.estimators import parse

    record, known = _record(log), _axis(axis)
    text = estimator or default_estimator(known)
    found = tracked(record, known, parse(text), identify=parameters, start=start)
    values = zip(found.names, found.last.tolist(), found.nominal.tolist(), strict=True)
    lines = [{"parameter": n, "last": v, "nominal": of, "ratio": v / of} for n, v, of in values]
    charts = [estimates_chart(found, text), residual_chart(found, record.period)]
    return LogResult(lines, found, charts, record=record, axis=known)


def trend(
    logs: str | Path | Sequence[str | Path],
    axis: Any,
    folder: str | Path = "trend",
    *,
    covariates: Sequence[str] = (),
    free: Sequence[str] = (),
    false_alarms: float = 0.01,
    smallest: float = 0.01,
    jobs: int = 1,
    **options: Any,
) -> LogResult:
    """Follow parameters over many logs, and tell wear from warmth; `flexaxis trend` in Python.

    Parameters
    ----------
    logs : path or sequence of path
        Logs, or folders of them.
    axis : path, Axis, or what `identify` returned
    folder : path
        Where estimates are kept, so that no log is computed twice.
    covariates : sequence of str
        Columns of the logs, or CSV files, that may explain the estimates.
    free, false_alarms, smallest, jobs
        As the options of the command; ``smallest`` as a part.
    **options
        How logs are read, as of `import_log`.
    """
    from flexaxis.experiments.logs.pages.trend_page import overview_chart
    from flexaxis.experiments.logs.trend.estimates import Source
    from flexaxis.experiments.logs.trend.trend import trend_of
    from flexaxis.experiments.logs.trend.words import summary

    treated = {name: options.pop(name, None) for name in ("resample", "burn_in")}
    many = [logs] if isinstance(logs, str | Path) else logs
    source, known = Source(options, treated), _axis(axis)
    found = trend_of(
        [Path(each) for each in many], known, source, Path(folder), free=free, jobs=jobs,
        covariates=covariates, false_alarms=false_alarms, smallest=smallest,
    )  # fmt: skip
    lines = [{"parameter": one.name} | summary(one, found) for one in found.verdicts]
    charts = [overview_chart(found)]
    return LogResult(lines, found, charts, axis=known)


def _record(log: Log) -> Record:
    from flexaxis.experiments.logs.importing import read_any

    log = log.record if isinstance(log, LogResult) else log
    return read_any(Path(log), {}) if isinstance(log, str | Path) else log


def _axis(given: Any) -> Axis:
    from flexaxis.experiments.logs.axis_file import find_axis

    given = given.axis if isinstance(given, LogResult) else given
    return find_axis(str(given)) if isinstance(given, str | Path) else given
