"""Write the report of a study, with curves, maps and a table of scores for all swept settings."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any

import pandas as pd
from markupsafe import Markup

from flexaxis.experiments.files import StudyError
from flexaxis.experiments.reporting import page, sentences, tables
from flexaxis.experiments.reporting.figures import curves, lines, score_map
from flexaxis.experiments.reporting.sentences import axis_words
from flexaxis.experiments.reporting.styles import assigned
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.study import is_option

LINES = 300  # largest number of rows in the table
SHOWN = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged")
LABELS = {"score": "score, 0–100", "lag": "lag [s]", "std": "std before [%]",
          "detection.false_alarms_per_1000_s": "false alarms / 1000 s"}  # fmt: skip


def render(results: Results) -> str:
    """Return the report of a study as HTML.

    Raises
    ------
    StudyError
        If all simulations of the study failed.
    """
    if not results.frame["parameter"].any():
        raise StudyError(
            "all simulations of the study failed; see the column `error` of the results for the "
            "reasons"
        )
    axes, study = numeric_axes(results), results.study
    table = _table(results)
    looks = assigned(name for name, _ in table.rows)
    shown = [
        over_axis(results, axis, "score", "detection.false_alarms_per_1000_s") for axis in axes[:1]
    ]
    shown += [over_axis(results, axis, "lag", "std") for axis in axes]
    return page.render(
        "reporting/templates/study.html",
        title=title(results),
        study=study,
        looks=looks,
        axes=list(map(axis_words, results.axes)),
        cases=results.cases,
        failures=sentences.failures_in_words(results.failures.to_dict("records")),
        figures=[page.drawn(curves, f"{', '.join(o['panels'])} over {o['x']}", looks=looks, **o)
                 for o in shown if o["panels"]],
        maps=list(_maps(results)),
        table=table,
    )  # fmt: skip


def numeric_axes(results: Results) -> list[str]:
    """Return the swept settings that have several numeric values; fault settings come first."""
    axes = results.frame[list(results.axes)].select_dtypes("number")
    return sorted(axes.columns[axes.nunique() > 1], key=lambda axis: not axis.startswith("fault"))


def pooled(results: Results, axes: Sequence[str], *by: str) -> pd.DataFrame:
    """Return the scores, pooled over the seeds and over all swept settings not in `axes`.

    If `axes` contains no estimator option, the function treats each setting of an estimator as a
    separate estimator.
    """
    option = any(is_option(axis, results.study["estimators"]) for axis in axes)
    rows = tables.flat(results.pooled(*by, "estimator" if option else "setting", *axes))
    return rows.rename(columns={"setting": "estimator"}).dropna(subset=list(axes))


def title(results: Results) -> str:
    """Return a sentence that names the estimator with the highest score in a study."""
    axes = numeric_axes(results)[:1]
    rows = _changed(results, axes).dropna(subset="score")
    if rows.empty:
        return (
            f"{results.study['name']}: no score, because no estimated parameter changes in a step"
        )
    scores = rows.groupby("estimator")["score"].agg(["mean", tables.between])
    order = scores.sort_values("mean", ascending=False)["between"]
    over = " over the ".join(["the highest score", *map(axis_words, axes)])
    values = [f"{who} {score}" for who, score in order.head(2).items()]
    return f"{order.index[0]} has {over}: {', next '.join(values)}"


def _changed(results: Results, axes: Sequence[str]) -> pd.DataFrame:
    """Return the pooled scores of the changed parameters, without rows that lack a lag."""
    rows = pooled(results, axes)
    return rows[rows["changed"].astype(bool) & rows["lag"].notna()]


def over_axis(results: Results, axis: str, *measures: str) -> dict[str, Any]:
    """Return options that make `curves` plot scores against a swept setting of a study.

    The figure has one panel for each combination of score and parameter.

    Parameters
    ----------
    results : Results
        Results of the study.
    axis : str
        Swept setting on the horizontal axis.
    *measures : str
        Names of the scores to draw. Each name is a column of the pooled scores.
    """
    rows, panels, x = _changed(results, [axis]), {}, axis_words(axis)
    for measure in rows.columns.intersection(measures):
        for parameter, group in rows[rows[measure].notna()].groupby("parameter", sort=False):
            panels[f"{LABELS[measure]} of {parameter}"] = lines(group, axis, measure)
    wide = rows[axis].max() > 30 * rows[axis].min() > 0
    return {"panels": panels, "x": x, "logs": [x] * bool(wide)}


def _maps(results: Results) -> Iterator[tuple[str, list[Markup]]]:
    """For each pair of swept settings, yield a heading and one lag map per estimator."""
    for y, x in combinations(numeric_axes(results), 2):
        heading = f"lag [s] over {axis_words(x)} and {axis_words(y)}"
        maps = _changed(results, [x, y]).pivot_table("lag", ["estimator", y], x)
        limits = maps.min(axis=None), maps.max(axis=None)
        yield heading, [page.drawn(score_map, f"{who}: {heading}", own.droplevel(0), title=str(who),
                                   limits=limits, x=axis_words(x), y=axis_words(y))
                        for who, own in maps.groupby(level=0, sort=False)]  # fmt: skip


def _table(results: Results) -> tables.Table:
    """Return one table with the pooled scores for all combinations of swept settings.

    The rows of the changed parameters come first.
    """
    rows = pooled(results, results.axes, "scenario")
    rows = rows.sort_values("changed", ascending=False, kind="stable").head(LINES)
    names = ("estimator", "scenario", *results.axes, "parameter", *SHOWN)
    heads = {name: tables.COLUMNS.get(name) or axis_words(name) for name in names}
    return tables.table("scores", rows, heads)
