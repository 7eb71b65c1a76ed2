"""The report of a study: the answer first, scores over its axes, then maps and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from flexaxis.experiments.reporting import page, tables, words
from flexaxis.experiments.reporting.figures import Looks, Series, curves, lag_maps
from flexaxis.experiments.reporting.inputs import StudyInputs
from flexaxis.experiments.reporting.tables import Cell, Table, between, short

Row = Mapping[str, Any]
WIDE_RATIO = 30  # of the ends of an axis from which its scale is logarithmic
MAPS, LINES = 3, 300  # maps over two axes; lines of a table
SCORES = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged")
LABELS = {"score": "score, 0–100", "lag": "lag [s]", "false": "false alarms / h"}


def render(inputs: StudyInputs) -> str:
    """Return the report of a study as HTML."""
    failures = inputs.results.failures()
    answer = over_axis(inputs, inputs.numeric[0]) if inputs.numeric else None
    everything = table(inputs)
    looks = page.looks_of(dict.fromkeys(name for name, _ in everything.rows))
    draw = partial(page.drawn, legend=False, looks=looks)
    return page.render(
        "reporting/templates/study.html",
        title=title(inputs),
        study=inputs.study,
        looks=looks,
        axes=[_label(inputs, axis) for axis in inputs.results.axes],
        cases=inputs.results.cases,
        failures=words.failures_in_words(failures[:10]),
        failed=len(failures),
        answer=draw(curves, "the answer", **answer) if answer else Markup(),
        averaged=[_label(inputs, a) for a in inputs.averaged(inputs.numeric[:1])],
        figures=list(_figures(inputs, looks)),
        maps=list(_maps(inputs)),
        isolation=isolation(inputs),
        table=everything,
    )


def _label(inputs: StudyInputs, axis: str) -> str:
    return words.axis_words(axis, inputs.study)


def title(inputs: StudyInputs) -> str:
    """Return the answer of a study in a sentence: who leads over its first axis."""
    rows = inputs.pooled(inputs.numeric[:1])
    name = inputs.study["name"]
    if rows.empty:
        return f"{name}: no case could be run"
    rows = rows[rows["changed"].astype(bool) & rows["lag"].notna()]
    if rows.empty:
        return f"{name}: nothing changes here that is estimated"
    measure = "score" if rows["score"].notna().any() else "lag"
    axis = inputs.numeric[0] if inputs.numeric else "parameter"
    means = rows.groupby(["estimator", axis])[measure].mean().unstack(0)
    best = (means.idxmax if measure == "score" else means.idxmin)(axis=1).value_counts()
    first, count = str(best.index[0]), int(best.iloc[0])
    unit = "of 100" if measure == "score" else "s"
    own = f"{between(means[first])} {unit}"
    where = f"over {_label(inputs, axis)}" if inputs.numeric else "on average"
    if len(means.columns) == 1:
        return f"{first}: a {measure} of {own} {where}"
    others = means.drop(columns=first)
    second = (others.mean().idxmax if measure == "score" else others.mean().idxmin)()
    verb = "scores highest" if measure == "score" else "has the shortest lag"
    at = f" at {count} of {len(means)} values of {_label(inputs, axis)}" * bool(inputs.numeric)
    return f"{first} {verb}{at}: {own}, next {second} {between(means[second])}"


def over_axis(inputs: StudyInputs, axis: str) -> dict[str, Any] | None:
    """Return score, or lag without any, over an axis, with false alarms: options of `curves`."""
    rows = inputs.pooled([axis])
    rows = rows[rows["changed"].astype(bool)] if len(rows) else rows
    if rows.empty or rows["lag"].isna().all():
        return None
    measure = "score" if rows["score"].notna().any() else "lag"
    panels = _panels(rows, axis, measure)
    alarms = rows.rename(
        columns={
            "false_alarms_per_hour": "false",
            "false_alarms_per_hour_interval": "false_interval",
        }
    )
    alarms = alarms.drop_duplicates(["estimator", axis])
    if "false" in alarms and alarms["false"].notna().any():
        panels |= _panels(alarms.assign(parameter=""), axis, "false")
    return _options(inputs, axis, panels)


def lag_over_axis(inputs: StudyInputs, axis: str) -> dict[str, Any] | None:
    """Return lag, and noise before the fault, over an axis: options of `curves`."""
    rows = inputs.pooled([axis])
    rows = rows[rows["changed"].astype(bool) & rows["lag"].notna()] if len(rows) else rows
    if rows.empty:
        return None
    panels = _panels(rows, axis, "lag") | {
        f"{name}: std before [%]": [
            _line(who, own, axis, "std") for who, own in group.groupby("estimator", sort=False)
        ]
        for name, group in rows.groupby("parameter", sort=False)
    }
    return _options(inputs, axis, panels) | {"limits": {}}


def _options(
    inputs: StudyInputs, axis: str, panels: Mapping[str, Sequence[Series]]
) -> dict[str, Any]:
    across = np.concatenate([np.asarray(s.x) for each in panels.values() for s in each])
    log = across.min() > 0 and across.max() > WIDE_RATIO * across.min()
    return {
        "panels": panels,
        "x": _label(inputs, axis),
        "x_log": log,
        "height": 230,
        "limits": {k: (-3.0, 103.0) for k in panels if "score" in k or "[%]" in k},
    }


def _panels(rows: pd.DataFrame, axis: str, measure: str) -> dict[str, list[Series]]:
    """Return a panel a parameter: a line an estimator with its intervals, and the bound."""
    panels: dict[str, list[Series]] = {}
    for name, group in rows.groupby("parameter", sort=False):
        label = f"{name}: {LABELS[measure]}" if name else LABELS[measure]
        series = [
            _line(who, own, axis, measure) for who, own in group.groupby("estimator", sort=False)
        ]
        bound = group.dropna(subset=["lag_bound"]).drop_duplicates(axis).sort_values(axis)
        if measure == "lag" and len(bound):
            series.append(
                Series(
                    x=bound[axis].astype(float),
                    y=bound["lag_bound"].astype(float),
                    role="bound",
                    label="Cramér–Rao bound",
                )
            )
        panels[label] = series
    return panels


def _line(who: str, rows: pd.DataFrame, axis: str, measure: str) -> Series:
    rows = rows[rows[measure].notna()].sort_values(axis)
    spans = rows.get(f"{measure}_interval", pd.Series([None] * len(rows)))
    ends = [
        [np.nan if e is None else e for e in span]
        if isinstance(span, list | tuple)
        else [np.nan, np.nan]
        for span in spans
    ]
    low, high = np.array(ends, float).reshape(-1, 2).T
    return Series(
        x=rows[axis].astype(float),
        y=rows[measure].astype(float),
        low=low,
        high=high,
        estimator=who,
        kind="both",
    )


def _figures(inputs: StudyInputs, looks: Looks) -> Any:
    """Yield heading, figure and words of what the axes of a study allow."""
    draw = partial(page.drawn, curves, legend=False, looks=looks)
    for axis in inputs.numeric:
        if options := lag_over_axis(inputs, axis):
            label = _label(inputs, axis)
            yield (
                f"Lag and noise over {label}",
                draw(f"lag over {label}", **options),
                ("Dotted: the Cramér–Rao bound. Whiskers: 95 % intervals over the seeds."),
            )
    if found := inputs.finds():
        yield (
            "Faults found",
            draw("faults found", **_finds(inputs, found)),
            (
                "Share of the faults that are found within 1 s, over their size; at 1 nothing changes, "
                "and what is found there is found by chance."
            ),
        )
    settings = inputs.detection()
    if len(settings):
        panels = {
            label: [
                _line(who, own, "false", column)
                for who, own in settings.groupby("method", sort=False)
            ]
            for label, column in (("delay [s]", "delay"), ("missed [%]", "missed"))
        }
        yield (
            "Detection",
            draw("detection", panels=panels, x="false alarms in an hour"),
            ("A point is a setting of an estimator that reports findings."),
        )


def _finds(inputs: StudyInputs, found: Sequence[Any]) -> dict[str, Any]:
    rows = pd.DataFrame(
        [
            {
                "label": f"{each.base}: {each.parameter} found [%]",
                "estimator": each.estimator,
                "size": each.size,
                "share": 100 * each.share,
                "share_interval": [100 * end for end in each.share_interval],
            }
            for each in found
        ]
    )
    panels = {
        str(label): [
            _line(who, own, "size", "share") for who, own in group.groupby("estimator", sort=False)
        ]
        for label, group in rows.groupby("label", sort=False)
    }
    return {
        "panels": panels,
        "x": _label(inputs, found[0].axis),
        "height": 230,
        "limits": dict.fromkeys(panels, (-3.0, 103.0)),
    }


def _maps(inputs: StudyInputs) -> Any:
    """Yield heading, figure and table of the lag over two axes each."""
    for y, x in list(combinations(inputs.numeric, 2))[:MAPS]:
        rows = inputs.pooled([x, y])
        rows = rows[rows["changed"].astype(bool) & rows["lag"].notna()]
        if rows.empty:
            continue
        maps = {
            str(who): own.pivot_table("lag", y, x).sort_index(ascending=False)
            for who, own in rows.groupby("estimator", sort=False)
        }
        labels = _label(inputs, x), _label(inputs, y)
        figure = page.drawn(
            lag_maps, f"lag over {labels[0]} and {labels[1]}", maps, x=labels[0], y=labels[1]
        )
        yield f"Lag over {labels[0]} and {labels[1]}", figure, _map_table(maps, labels)


def _map_table(maps: Mapping[str, pd.DataFrame], labels: tuple[str, str]) -> Table:
    across = list(dict.fromkeys(x for each in maps.values() for x in each.columns))
    lines = [
        (
            who,
            [
                Cell(who),
                Cell(f"{y:.4g}", y),
                *(tables.scored(cells.get(x, pd.Series(dtype=float)).get(y)) for x in across),
            ],
        )
        for who, cells in maps.items()
        for y in cells.index
    ]
    heads = ["estimator", labels[1], *(f"lag [s] at {x:.4g}\n{labels[0]}" for x in across)]
    return Table(f"lag over {labels[0]} and {labels[1]}", heads, lines)


def isolation(inputs: StudyInputs) -> Table | None:
    """Return what each fault was taken for, in % of the faults."""
    shares = inputs.isolation()
    lines = [
        (who, [Cell(who), Cell(fault), *(Cell(f"{v:.0f}", v, tone=v / 100) for v in row)])
        for (who, fault), row in shares.iterrows()
    ]
    heads = ["estimator", "changed", *(f"{name} [%]" for name in shares.columns)]
    return Table("isolation", heads, lines) if lines else None


def table(inputs: StudyInputs) -> Table:
    """Return pooled scores at each point, what changed first."""
    axes = [a for a in inputs.results.axes if a not in inputs.options()]
    rows = inputs.pooled(axes, scenario=True)
    heads = [
        "estimator",
        "scenario",
        *(_label(inputs, a) for a in axes),
        "parameter",
        *(tables.COLUMNS[name][0] for name in SCORES),
    ]
    if rows.empty:
        return Table("scores", heads, [])
    rows = rows.sort_values("changed", ascending=False, kind="stable")
    rows = rows.astype(object).where(rows.notna(), None)
    lines = [
        (
            row["estimator"],
            [
                Cell(row["estimator"]),
                Cell(row["scenario"]),
                *(_value(row[a]) for a in axes),
                Cell(row["parameter"]),
                *(tables.COLUMNS[name][1](row) for name in SCORES),
            ],
        )
        for row in rows.head(LINES).to_dict("records")
    ]
    left = len(rows) - LINES
    return Table(
        "scores", heads, lines, [f"{left} more lines are in the folder of the study."] * (left > 0)
    )


def _value(value: Any) -> Cell:
    return Cell(short(value) if isinstance(value, float) else str(value or "–"), value or "")
