"""A trend in words that the owner of an axis reads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.logs.findings import Finding, Kind
from flexaxis.experiments.logs.trend.change_points import Change
from flexaxis.experiments.logs.trend.covariates import Clock
from flexaxis.experiments.logs.trend.trend import Trend, ailments, common
from flexaxis.experiments.logs.trend.wear import (
    CHANGED,
    EXPLAINED,
    OPEN,
    STEADY,
    UNTOLD,
    WearVerdict,
)

SIGN = 3.0  # standard deviations of a slope whose sign is believed
QUIET = "did not change"
TOLD = 3  # logs of which it is told above all else what is wrong with them
COLOURED = 0.4  # memory of the scatter from log to log that is worth a word


def sentences(found: WearVerdict, trend: Trend) -> list[str]:
    """Return what became of a parameter."""
    slopes, causes = _slopes(found, [*trend.covariates]), " and ".join(trend.covariates)
    lines = []
    match found.kind:
        case "changed":
            lines = [_change(found, change, trend.clock) for change in found.found.changes]
            lines += [f"beside that, {text}" for text in slopes]
            if not causes:
                lines.append("whether it is worn or warm cannot be told without --covariate")
        case "explained":
            largest = max(found.bare.changes, key=lambda c: abs(c.size))
            lines = [
                f"moved by {found.percent(largest.size):+.2g} %, as {causes} did, and not "
                f"besides: {', '.join(slopes)}",
                *_asked(found, [*trend.covariates]),
            ]
        case "untold":
            lines = [
                "cannot be told: logs repeat so poorly that a change of less than "
                f"±{100 * found.least:.2g} % would not be seen"
            ]
        case "open":
            assert found.change is not None
            lines = [
                f"and {causes} changed at the same time: beside it, {_size(found, found.change)}. "
                "Worn and warm cannot be told apart on these logs; add some of worn and cold, or "
                "new and warm"
            ]
        case _ if found.found.changes:
            sizes = ", ".join(f"{found.percent(c.size):+.2g} %" for c in found.found.changes)
            lines = [f"changed by {sizes} only, which is less than {100 * found.smallest:g} %"]
        case _:
            lines = [", ".join([QUIET, *(text for text in slopes if "no effect" not in text)])]
    lines += [
        f"the log of {trend.clock.labels[int(found.logs[c.place])]} is out of line by "
        f"{found.percent(c.size):+.2g} %"
        for c in found.found.outliers
    ]
    return [f"{found.name} {lines[0]}", *(f"{found.name}: {line}" for line in lines[1:])]


def _size(found: WearVerdict, change: Change) -> str:
    return f"{found.percent(change.size):+.2g} ± {found.percent_deviation(change):.2g} %"


def _change(found: WearVerdict, change: Change, clock: Clock) -> str:
    """Return such as "has grown by 12 ± 2 % since 2026-01-30 (day 29, at 95 % 26 … 33)"."""
    size, sd = float(found.percent(change.size)), found.percent_deviation(change)
    at, first, last = (found.logs[k] for k in (change.place, change.earliest, change.latest))
    where = f"{'day' if clock.first else 'log'} {clock.time[at]:.3g}"
    if last > first:
        where += f", at 95 % {clock.time[first]:.3g} … {clock.time[last]:.3g}"
    if change.shape == "step":
        verb, since = f"{'rose' if size > 0 else 'fell'} at once", "on"
    else:
        verb, since = f"has {'grown' if size > 0 else 'fallen'}", "since"
    return f"{verb} by {abs(size):.2g} ± {sd:.1g} % {since} {clock.labels[at]} ({where})"


def _asked(found: WearVerdict, covariates: Sequence[str]) -> list[str]:
    """Return a question where friction grows with the temperature, as that of no grease does."""
    slopes = zip(covariates, found.found.slopes, found.found.slope_deviations, strict=True)
    wrong = [n for n, slope, sd in slopes if "temp" in n.lower() and slope > SIGN * sd]
    if not wrong or not found.name.startswith("f_"):
        return []
    return [
        f"friction that grows with {wrong[0]} is not that of grease: is the heat its consequence? "
        "Then it is wear; log the temperature before the motion"
    ]


def _slopes(found: WearVerdict, covariates: Sequence[str]) -> list[str]:
    spans = np.ptp(found.series.covariates, axis=0)
    slopes = found.found.slopes, found.found.slope_deviations
    return [
        f"{name} has no effect that can be seen"
        if abs(slope) < 2 * sd or abs(slope) * span < found.smallest
        else f"{name} explains {100 * slope:+.3g} ± {100 * sd:.1g} % for each unit of it"
        for name, slope, sd, span in zip(covariates, *slopes, spans, strict=True)
    ]


def remarks(trend: Trend) -> list[Finding]:
    """Return all that there is to say, what changed first."""
    weights: dict[str, Kind] = dict.fromkeys((CHANGED, OPEN), "problem")
    weights |= {EXPLAINED: "note", UNTOLD: "note", STEADY: "ok"}
    order = sorted(trend.verdicts, key=lambda v: [*weights].index(v.kind))
    said = {v.name: sentences(v, trend) for v in order}
    quiet = [name for name, lines in said.items() if lines == [f"{name} {QUIET}"]]
    found = log_remarks(trend.rows)
    found += [
        Finding(weights[v.kind] if i == 0 else "note", text)
        for v in order
        if v.name not in quiet
        for i, text in enumerate(said[v.name])
    ]
    if quiet:
        found.append(Finding("ok", f"{', '.join(quiet)} {QUIET}"))
    return found + [Finding("note", text) for text in _to_know(trend)] + [
        Finding("ok", dates_remark(trend)),
        Finding("ok", f"one page in {1 / trend.false_alarms:.0f} of an axis that does not change "
                "says that it does (each time that it is made)"),
    ]  # fmt: skip


def _to_know(trend: Trend) -> Iterator[str]:
    """Yield what is to be known of the logs together, in sentences."""
    if not trend.covariates:
        yield ("without a covariate, warm and worn cannot be told apart: --covariate temp, a "
               "column of the logs, or a CSV with the name of each log and its value")  # fmt: skip
    memory = [
        v.name
        for v in trend.verdicts
        if v.found.correlation >= COLOURED and v.found.scatter > 0.5 * np.median(v.series.deviation)
    ]
    if memory:
        yield (f"{', '.join(memory)}: what differs from log to log is alike from one to the next, "
               "so something moves it that is not among the covariates; changes are judged the "
               "more carefully")  # fmt: skip
    bad = [row for row in trend.rows if row["problem"]]
    if bad:
        yield f"{len(bad)} of {len(trend.rows)} logs could not be used; see below"
    copies = [f"{copy} is {row['log']}" for row in trend.rows for copy in row.get("copies", [])]
    if copies:
        more = f" and {len(copies) - TOLD} more" if len(copies) > TOLD else ""
        yield f"copies count once: {', '.join(copies[:TOLD])}{more}"


def log_remarks(rows: Sequence[Mapping[str, Any]]) -> list[Finding]:
    """Return what is wrong with logs that could be read."""
    ill = [f"{log}: {', and '.join(said)}" for log, said in ailments(rows).items()]
    if len(ill) > TOLD:
        ill[TOLD:] = [f"{len(ill) - TOLD} more of {len(rows)} logs; see below"]
    together = common([row for row in rows if not row["problem"]])
    return [*(Finding("problem", t) for t in ill), *(Finding("note", t) for t in together)]


def dates_remark(trend: Trend) -> str:
    """Return where the dates come from."""
    if trend.clock.first:
        return f"dates: {len(trend.good)} of their names, or of their folders"
    undated = sum(row["date"] is None for row in trend.good)
    why = f"{undated} have no date" if undated else "all have the same date"
    return f"the logs are numbered in the order given, as {why} such as 2026-12-31"


def summary(found: WearVerdict, trend: Trend) -> dict[str, Any]:
    """Return what became of a parameter, for JSON; sizes as parts, not per cent."""
    clock = trend.clock

    def told(change: Change) -> dict[str, Any]:
        at = int(found.logs[change.place])
        return {
            "shape": change.shape,
            "since": clock.labels[at],
            "time": float(clock.time[at]),
            "between": [float(clock.time[found.logs[k]]) for k in (change.earliest, change.latest)],
            "size": float(found.percent(change.size)) / 100,
            "sd": float(found.percent_deviation(change)) / 100,
            "chance": change.chance,
        }

    slopes = zip(trend.covariates, found.found.slopes, found.found.slope_deviations, strict=True)
    return {
        "verdict": found.kind,
        "changes": [told(change) for change in found.found.changes],
        "changes_without_covariates": [told(change) for change in found.bare.changes],
        "outliers": [told(change) for change in found.found.outliers],
        "covariates": {n: {"slope": float(b), "sd": float(s)} for n, b, s in slopes},
        "scatter": found.found.scatter,
        "correlation": found.found.correlation,
        "residual": float(np.std(found.series.value - found.found.fitted)),
        "words": sentences(found, trend),
    }
