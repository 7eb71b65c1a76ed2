"""Figures of a study: each function returns a matplotlib Figure, in the style of a run's figures.

A line is a method, in its colour; whiskers are 95 % intervals over the cases behind a point.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from flexaxis.experiments.reporting.figures import colour, symbol
from flexaxis.experiments.reporting.findings import MISSED, SEVERAL, UNMODELLED, Alarms

Row = Mapping[str, Any]
_DASHES = ("-", ":", "-.", (0, (5, 1)))


def degradation(rows: Sequence[Row], axis: str) -> Figure:
    """Draw the lag after the fault, and the error before it, over the values of an axis.

    Parameters
    ----------
    rows : sequence of mapping
        From `Results.pooled(["method", axis])`.
    axis : str
        The swept key.
    """
    rows = [row for row in rows if row[axis] is not None]  # it may be an option of one method only
    names = list(dict.fromkeys(row["parameter"] for row in rows))
    lags = [row for row in rows if row["changed"] and row["lag"] is not None]
    panels = [None, *names] if lags else names
    layout = ConstrainedLayoutEngine(w_pad=0.12)
    fig = Figure(figsize=(3.0 * max(2, len(panels)), 3.6), layout=layout)
    for ax, name in zip(fig.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        if name is None:
            draw_lags(ax, lags, axis)
        else:
            _lines(
                ax, _errors([row for row in rows if row["parameter"] == name], axis), axis, "rms"
            )
            ax.set_ylabel(f"error of {symbol(name)} before [%]")
        ax.set_ylim(0, 1.12 * ax.dataLim.ymax or 1.0)
        ax.set_xlabel(axis)
        ax.grid(alpha=0.25)
    _legend(fig)
    return fig


def draw_lags(ax: Axes, rows: Sequence[Row], axis: str) -> None:
    """Draw the lag after the fault over the values of an axis, and its bound."""
    names = list(dict.fromkeys(row["parameter"] for row in rows))
    for name, dashes in zip(names, _DASHES * len(names), strict=False):
        mine = [row for row in rows if row["parameter"] == name]
        _lines(ax, mine, axis, "lag", dashes, f" ({symbol(name)})" if len(names) > 1 else "")
        bounds = {row[axis]: row["lag_bound"] for row in mine if row["lag_bound"] is not None}
        if bounds:
            label = "Cramér–Rao bound" if name == names[0] else None
            ax.plot(*zip(*sorted(bounds.items()), strict=True), "k--", lw=1.0, label=label)
    ax.set_ylabel("lag after [s]")


def _lines(  # noqa: PLR0917
    ax: Axes, rows: Sequence[Row], axis: str, measure: str, dashes: Any = "-", suffix: str = ""
) -> None:
    """Draw a line a method, with the intervals that stand beside a column."""
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        mine.sort(key=lambda row: row[axis])
        y = np.array([row[measure] for row in mine], float)
        x, whiskers = [row[axis] for row in mine], _whiskers(mine, y, f"{measure}_interval")
        ax.errorbar(
            x, y, yerr=whiskers, color=colour(method), ls=dashes, marker="o", markersize=4,
            capsize=2, lw=1.3, label=method + suffix,
        )  # fmt: skip


def _whiskers(rows: Sequence[Row], values: Any, column: str) -> Any:
    """Return how far the intervals reach below and above some values (2, n)."""
    spans = [row.get(column) or (v, v) for v, row in zip(values, rows, strict=True)]
    return np.abs(np.reshape(spans, (-1, 2)).T - values)


def _errors(rows: Sequence[Row], axis: str) -> list[dict[str, Any]]:
    """Return the rms error by method and value: over all cases, with a change later or without."""
    held: dict[tuple[str, Any], list[tuple[float, int]]] = {}
    for row in rows:
        if row["std"] is not None:
            square = row["std"] ** 2 + (row["bias"] or 0.0) ** 2
            held.setdefault((row["method"], row[axis]), []).append((square, row["cases"]))
    found = []
    for (method, value), squares in held.items():
        values, weights = zip(*squares, strict=True)
        rms = float(np.sqrt(np.average(values, weights=weights)))
        found.append({"method": method, axis: value, "rms": rms})
    return found


def _legend(fig: Figure) -> None:
    found: dict[str, Any] = {}
    for ax in fig.axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        fig.legend(
            list(found.values()), list(found), loc="outside upper center", ncols=4, frameon=False
        )


def detection(found: Sequence[Alarms]) -> Figure:
    """Draw the delay of detection, and the share of faults missed, against false alarms.

    Parameters
    ----------
    found : sequence of Alarms
        From `flexaxis.experiments.reporting.findings.alarms`: a point a setting, a line a method.
    """
    fig = Figure(figsize=(8.0, 3.6), layout="constrained")
    delay, missed = fig.subplots(1, 2)
    for method in dict.fromkeys(each.method for each in found):
        mine = sorted((e for e in found if e.method == method), key=lambda e: e.false_per_hour)
        late = [each for each in mine if each.delay is not None]
        y = np.array([each.delay for each in late], float)
        style: dict[str, Any] = {"color": colour(method), "marker": "o", "markersize": 4, "lw": 1.3}
        x = [each.false_per_hour for each in late]
        whiskers = _whiskers([{"span": each.delay_interval} for each in late], y, "span")
        delay.errorbar(x, y, yerr=whiskers, capsize=2, label=method, **style)
        missed.plot([e.false_per_hour for e in mine], [100 * e.missed for e in mine], **style)
        for each, place in zip(late, zip(x, y, strict=True), strict=True):
            setting = each.estimator.partition("[")[2].removesuffix("]")
            delay.annotate(setting, place, textcoords="offset points", xytext=(4, 4), fontsize=7)
    delay.set_ylabel("delay of detection [s]")
    missed.set_ylabel("faults missed [%]")
    missed.set_ylim(-3, 103)
    delay.set_ylim(0, 1.12 * max(0.01, delay.dataLim.ymax))
    most = max((each.false_per_hour for each in found), default=0.0)
    for ax in (delay, missed):
        ax.set_xscale("symlog", linthresh=1.0)
        ax.set_xlim(-0.1, max(10.0, 2 * most))
        ax.set_xlabel("false alarms in an hour")
        ax.grid(alpha=0.25)
    _legend(fig)
    return fig


def isolation(counts: Mapping[str, Counter[tuple[str, str]]]) -> Figure:
    """Draw a matrix a method: rows are what changed, columns what was named, in % of the faults.

    Parameters
    ----------
    counts : mapping of str to Counter
        From `flexaxis.experiments.reporting.findings.confusion`.
    """
    pairs = [pair for counter in counts.values() for pair in counter]
    faults = list(dict.fromkeys(fault for fault, _ in pairs))
    others = sorted({named for _, named in pairs} - set(faults) - {MISSED, UNMODELLED, SEVERAL})
    columns = [*faults, *others, SEVERAL, UNMODELLED, MISSED]
    width = max(3.5, 0.75 * len(columns) + 1.2)
    fig = Figure(figsize=(width * len(counts), 1.9 + 0.45 * len(faults)), layout="constrained")
    for ax, (method, counter) in zip(
        fig.subplots(1, len(counts), squeeze=False)[0], counts.items(), strict=True
    ):
        table = np.array([[counter[fault, name] for name in columns] for fault in faults], float)
        share = 100 * table / np.maximum(1, table.sum(axis=1, keepdims=True))
        _matrix(ax, share, "%.0f", limits=(0, 100))
        marks = [symbol(n) if "_" in n else n for n in columns]
        ax.set_xticks(range(len(columns)), marks, rotation=45, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(len(faults)), [symbol(fault) for fault in faults])
        ax.set(xlabel="named", ylabel="changed", title=f"{method} [% of the faults]")
    return fig


def heat_map(rows: Sequence[Row], x: str, y: str, measure: str = "lag") -> Figure:
    """Draw a score over two axes, a panel a method.

    Parameters
    ----------
    rows : sequence of mapping
        From `Results.pooled(["method", x, y])`; of the parameters that changed.
    x, y : str
        Swept keys.
    measure : str
        Column, the lag by default.
    """
    rows = [row for row in rows if row["changed"] and row[measure] is not None]
    methods = list(dict.fromkeys(row["method"] for row in rows))
    across, up = (_ordered(row[key] for row in rows) for key in (x, y))
    fig = Figure(
        figsize=((1.3 + 0.75 * len(across)) * len(methods) + 1, 1.6 + 0.5 * len(up)),
        layout="constrained",
    )
    top = max(row[measure] for row in rows)
    axes = fig.subplots(1, len(methods), squeeze=False)[0]
    for ax, method in zip(axes, methods, strict=True):
        table = np.full((len(up), len(across)), np.nan)
        for i, j in np.ndindex(table.shape):
            here = [r for r in rows if (r["method"], r[y], r[x]) == (method, up[i], across[j])]
            if here:
                weights = [row["cases"] for row in here]
                table[i, j] = np.average([row[measure] for row in here], weights=weights)
        image = _matrix(ax, table, "%.2g", limits=(0, top))
        ax.set_xticks(range(len(across)), [short(value) for value in across])
        ax.set_yticks(range(len(up)), [short(value) for value in up])
        ax.set(xlabel=x, ylabel=y, title=method)
    fig.colorbar(image, ax=list(axes), label=f"{measure} [s]" if measure == "lag" else measure)
    return fig


def _matrix(ax: Axes, table: Any, form: str, *, limits: tuple[float, float]) -> Any:
    image = ax.imshow(table, cmap="Blues", vmin=limits[0], vmax=limits[1], aspect="auto",
                      origin="upper")  # fmt: skip
    for (i, j), value in np.ndenumerate(table):
        if np.isfinite(value):
            dark = value > 0.6 * limits[1]
            ax.text(j, i, form % value, ha="center", va="center", fontsize=9,
                    color="white" if dark else "black")  # fmt: skip
    return image


def _ordered(values: Iterable[Any]) -> list[Any]:
    found = list(dict.fromkeys(values))
    try:
        return sorted(found)
    except TypeError:
        return found


def short(value: Any) -> str:
    """Return the value of an axis for a tick or a table."""
    if value is None:
        return "–"
    return f"{value:.3g}" if isinstance(value, int | float) else str(value)
