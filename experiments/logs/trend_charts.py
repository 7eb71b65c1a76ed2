"""Charts of a trend: a parameter over time, and over what explains it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.experiments.logs.covariates import Clock
from flexaxis.experiments.logs.wear import Verdict
from flexaxis.experiments.reporting.charts import Chart, Line, Panel

Array = NDArray[np.float64]

ESTIMATE = "estimate of a log, ±2σ"
FITTED, WITH_CHANGE = "fitted", "with the change found"


def parameter_charts(
    found: Verdict,
    clock: Clock,
    covariates: Mapping[str, Array],
    first: datetime | None,
    *,
    title: str,
    words: str,
) -> Iterator[Chart]:
    """Yield a parameter over time with what was found in it, then over each covariate.

    Parameters
    ----------
    found : Verdict
    clock : Clock
    covariates : mapping of str to ndarray
        Of all logs, in the order of the clock.
    first : datetime or None
        Of the first log, where logs have dates.
    title, words : str
        Of the chart over time.
    """
    shape = {"step": "step", "ramp": "from here on"}
    times = clock.time[found.logs]
    changes = found.found.changes
    yield Chart(
        title=title,
        words=f"{words} Shaded: where the change can have begun, at 95 %." if changes else words,
        x="date" if first else "log",
        x_from=_origin(first),
        panels=list(_panels(found, clock, [*covariates])),
        marks=[(float(times[c.place]), shape.get(c.shape, c.shape)) for c in changes],
        spans=[
            (float(times[c.earliest]), float(times[c.latest]), "")
            for c in changes
            if c.latest > c.earliest
        ],
    )
    for name, values in covariates.items():
        yield _over_covariate(found, name, values)


def overview_chart(found: Sequence[Verdict], clock: Clock, first: datetime | None) -> Chart:
    """Return all parameters over time."""
    return Chart(
        title="All parameters",
        words="Over the value at the start and the mean of the covariates; bars are ±2σ of a log.",
        x="date" if first else "log",
        x_from=_origin(first),
        panels=[_over_time(one, clock, title="") for one in found],
    )


def logs_chart(rows: Sequence[Mapping[str, Any]], clock: Clock, first: datetime | None) -> Chart:
    """Return fit, delay, constant torque and colour of the residual of each log.

    Parameters
    ----------
    rows : sequence of mapping
        In the order of the clock.
    clock : Clock
    first : datetime or None
    """
    periods = np.array([row["period"] for row in rows])
    panels = {
        "fit [%]": _points(clock.time, [row["fit"] for row in rows]),
        "torque late [samples]": _with_bars(clock.time, rows, "late", 1 / periods),
        "constant torque [as logged]": _with_bars(clock.time, rows, "offset", np.ones(len(rows))),
        "residual predicted [%]": _points(clock.time, [100 * row["colour"] for row in rows]),
    }
    return Chart(
        title="The logs",
        words="How well a simulation from the torque alone fits each, how late its torque acts, "
        "what constant torque acts besides, and how much of what is left its own past predicts: 0 "
        "if it is white noise, and more where the model leaves something out. Bars are ±2σ.",
        x="date" if first else "log",
        x_from=_origin(first),
        panels=[Panel(y=label, lines=[line]) for label, line in panels.items()],
    )


def _origin(first: datetime | None) -> str:
    return "" if first is None else first.replace(tzinfo=None).isoformat(timespec="seconds")


def _points(x: ArrayLike, y: ArrayLike, bars: ArrayLike | None = None, **more: Any) -> Line:
    """Return points, with bars of a half length."""
    at, up = np.asarray(x, float), np.asarray(y, float)
    sides = {} if bars is None else {"low": up - bars, "high": up + bars}
    return Line(**({"who": ESTIMATE, "kind": "points", "x": at, "y": up} | sides | more))


def _with_bars(x: Array, rows: Sequence[Mapping[str, Any]], name: str, scale: Array) -> Line:
    """Return something of each log over time, with ±2σ."""
    value, sd = (scale * np.array([row[name][key] for row in rows]) for key in ("value", "sd"))
    return _points(x, value, 2 * sd)


def _panels(found: Verdict, clock: Clock, covariates: Sequence[str]) -> Iterator[Panel]:
    if not covariates:
        yield _over_time(found, clock, title="")
        return
    yield _over_time(found, clock, title="as estimated", raw=True, covariates=covariates)
    yield _over_time(found, clock, title=f"less what {' and '.join(covariates)} explains")


def _over_time(
    found: Verdict,
    clock: Clock,
    *,
    title: str,
    raw: bool = False,
    covariates: Sequence[str] = (),
) -> Panel:
    """Return a parameter over time, without what the covariates explain unless it is `raw`."""
    times, warm = clock.time[found.logs], found.found.of_covariates
    level = found.found.level + (0.0 if raw else warm)
    percent = found.percent(found.series.value - level)
    lines = [_points(times, percent, 200 * found.series.deviation)]
    if raw:
        explained = f"what {' and '.join(covariates)} explains"
        lines.append(Line(who=explained, x=times, y=found.percent(warm)))
    who = WITH_CHANGE if found.found.changes else FITTED
    lines.append(Line(who=who, x=times, y=found.percent(found.found.fitted - level)))
    out = [outlier.place for outlier in found.found.outliers]
    if out:
        lines.append(_points(times[out], percent[out], who="out of line"))
    return Panel(y=f"{found.name} [%]", title=title, lines=lines)


def _over_covariate(found: Verdict, name: str, values: Array) -> Chart:
    """Return the estimates over a covariate, those before a change apart from those after it."""
    x = values[found.logs]
    y = found.percent(found.series.value - found.found.level)
    changes = found.found.changes
    turn = changes[0].place if changes else len(x) // 2
    words = ("before the change", "after it") if changes else ("first half", "second half")
    order = np.argsort(x)
    explained = found.percent(found.found.of_covariates)[order]
    lines = [
        _points(x[part], y[part], who=f"logs, {word}")
        for part, word in zip((slice(turn), slice(turn, None)), words, strict=True)
        if len(x[part])
    ]
    return Chart(
        title=f"{found.name} over {name}",
        words=f"What {name} explains, and what it does not.",
        x=f"{name} [its unit]",
        panels=[
            Panel(
                y=f"{found.name} [%]",
                lines=[*lines, Line(who=f"what {name} explains", x=x[order], y=explained)],
            )
        ],
    )
