"""The report of a study: the answer first, scores over its axes, then maps and tables."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import pandas as pd
from markupsafe import Markup

from flexaxis.experiments.reporting import page, tables, words
from flexaxis.experiments.reporting.figures import Series, curves, points, score_map
from flexaxis.experiments.reporting.inputs import numeric_axes, pooled
from flexaxis.experiments.running.results import Results

MAPS, LINES = 3, 300  # pairs of axes with maps; lines of the table
SHOWN = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged")
LABELS = {"score": "score, 0–100", "lag": "lag [s]", "std": "std before [%]"}


def render(results: Results) -> str:
    """Return the report of a study as HTML."""
    axes, study, failures = numeric_axes(results), results.study, results.failures
    table = _table(results)
    looks = page.looks_of(name for name, _ in table.rows)
    shown = [over_axis(results, axis, "score") for axis in axes[:1]]
    shown += [over_axis(results, axis, "lag", "std") for axis in axes]
    return page.render(
        "reporting/templates/study.html",
        title=title(results),
        study=study,
        looks=looks,
        axes=[words.axis_words(axis, study) for axis in results.axes],
        cases=results.cases,
        failures=words.failures_in_words(failures.head(10).to_dict("records")),
        failed=len(failures),
        figures=[page.drawn(curves, f"{', '.join(o['panels'])} over {o['x']}", looks=looks, **o)
                 for o in shown if o["panels"]],
        maps=list(_maps(results)),
        table=table,
    )  # fmt: skip


def title(results: Results) -> str:
    """Return the answer of a study in a sentence: who leads over its first axis."""
    axes = numeric_axes(results)[:1]
    rows = _changed(pooled(results, axes))
    if rows.empty:
        return f"{results.study['name']}: nothing that is estimated changes"
    measure = _measure(rows, "score")
    points = rows[axes[0]] if axes else pd.Series("", rows.index)
    means = rows.pivot_table(measure, points.rename("point"), "estimator")
    ranks = means.rank(axis=1, ascending=measure == "lag", method="first")
    order = ranks.mean().sort_values().index
    led = int((ranks[order[0]] == 1).sum())
    what = "highest score" if measure == "score" else "shortest lag [s]"
    where = f" at {led} of {len(means)} values of " if axes else ""
    where += "".join(words.axis_words(axis, results.study) for axis in axes)
    values = [f"{name} {tables.between(means[name])}" for name in order[:2]]
    return f"{order[0]} has the {what}{where}: {', next '.join(values)}"


def _changed(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["changed"].astype(bool) & rows["lag"].notna()] if len(rows) else rows


def _measure(rows: pd.DataFrame, name: str) -> str:
    """Return the score; the lag where no score is defined."""
    return "lag" if name == "score" and rows["score"].isna().all() else name


def over_axis(results: Results, axis: str, *measures: str) -> dict[str, Any]:
    """Return scores over an axis as options of `curves`: a panel a score and parameter.

    Parameters
    ----------
    results : Results
    axis : str
        A swept key.
    *measures : str
        Columns of pooled rows; the lag stands for a score that is not defined.
    """
    rows, panels = _changed(pooled(results, [axis])), {}
    for name in measures if len(rows) else ():
        measure = _measure(rows, name)
        own = rows.drop_duplicates(["estimator", axis]) if "false" in measure else rows
        for parameter, group in own[own[measure].notna()].groupby("parameter", sort=False):
            series = [points(line.sort_values(axis), axis, measure, str(who))
                      for who, line in group.groupby("estimator", sort=False)]  # fmt: skip
            if measure == "lag" and group["lag_bound"].notna().any():
                bound = group.groupby(axis)["lag_bound"].median()
                series.append(Series(x=bound.index, y=bound, role="bound"))
            panels[f"{LABELS[measure]} of {parameter}"] = series
    across = rows[axis].astype(float) if len(rows) else pd.Series([1.0])
    x = words.axis_words(axis, results.study)
    wide = across.min() > 0 and across.max() > 30 * across.min()
    return {"panels": panels, "x": x, "logs": [x] * bool(wide), "height": 230}


def _maps(results: Results) -> Iterator[tuple[str, list[Markup]]]:
    """Yield a heading and a map of the lag an estimator, over two axes each."""
    for y, x in list(combinations(numeric_axes(results), 2))[:MAPS]:
        labels = {k: words.axis_words(axis, results.study) for k, axis in (("x", x), ("y", y))}
        heading = f"lag [s] over {' and '.join(labels.values())}"
        rows = _changed(pooled(results, [x, y]))
        if rows.empty:
            continue
        maps = rows.pivot_table("lag", ["estimator", y], x)
        limits = maps.min(axis=None), maps.max(axis=None)
        yield heading, [page.drawn(score_map, f"{who}: {heading}", own.droplevel(0)[::-1],
                                   title=str(who), limits=limits, **labels)
                        for who, own in maps.groupby(level=0, sort=False)]  # fmt: skip


def _table(results: Results) -> tables.Table:
    """Return pooled scores at each point, what changed first."""
    rows = tables.flat(pooled(results, results.axes, "scenario").to_dict("records"))
    rows = rows.sort_values("changed", ascending=False, kind="stable").head(LINES)
    names = ("estimator", "scenario", *results.axes, "parameter", *SHOWN)
    heads = {name: tables.COLUMNS.get(name) or words.axis_words(name, results.study)
             for name in names}  # fmt: skip
    return tables.table("scores", rows, heads)
