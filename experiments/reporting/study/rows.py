"""Whom the charts of a study tell apart: estimators, with the options that are swept of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from flexaxis.experiments.reporting.study.charts import short
from flexaxis.experiments.results.groups import Bins
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.study import applies, is_option

FEW = 9  # that a chart tells apart: as many as there are colours


def rows_of(
    results: Results, axes: Sequence[str], bins: Bins, scores: Sequence[str] | None
) -> list[dict[str, Any]]:
    """Return pooled rows over some axes, each with `who` it is of."""
    options = told_apart(results, axes)
    by = ["method", *options, *axes]
    rows = results.pooled(
        by, bins={axis: edges for axis, edges in bins.items() if axis in by}, scores=scores
    )
    return [row | {"who": who(row, options)} for row in rows]


def who(row: Mapping[str, Any], options: Iterable[str]) -> str:
    """Return the estimator of a row, with the options that are told apart.

    Examples
    --------
    >>> who({"method": "ekf", "ekf.walk": 0.5, "imm.walk": None}, ["ekf.walk", "imm.walk"])
    'ekf[walk=0.5]'
    """
    said = {key.rpartition(".")[2]: row[key] for key in options if row[key] is not None}
    method = str(row["method"])
    if not said:
        return method
    inside = ",".join(f"{name}={short(value)}" for name, value in said.items())
    name, _, given = method.partition("[")
    return f"{name}[{given.removesuffix(']')},{inside}]" if given else f"{name}[{inside}]"


def told_apart(results: Results, axes: Sequence[str] = ()) -> list[str]:
    """Return the swept options that are told apart beside some axes: all, or too many and none."""
    options = [key for key in options_of(results) if key not in axes]
    values, count = results.values(), 0
    for method in results.study["estimators"]:
        settings = 1
        for key in options:
            settings *= max(1, len(values[key])) if applies(key, method) else 1
        count += settings
    return options if count <= FEW else []


def pooled_over(results: Results, axes: Sequence[str] = ()) -> list[str]:
    """Return the axes that are averaged over: those that are neither drawn nor told apart."""
    apart = told_apart(results, axes)
    values = results.values()
    return [k for k in results.axes if k not in axes and k not in apart and len(values[k]) > 1]


def options_of(results: Results) -> list[str]:
    """Return the axes that are options of estimators."""
    estimators = tuple(results.study["estimators"])
    return [axis for axis in results.axes if is_option(axis, estimators)]
