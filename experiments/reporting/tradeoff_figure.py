"""The figure of speed against variance: a line an estimator, over its knob, with the bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from flexaxis.experiments.reporting import figures


def figure(points: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw lag over std for each scenario, a line an estimator, the bounds dashed and dotted."""
    scenarios = list(dict.fromkeys((p["scenario"], p["parameter"]) for p in points))
    many = len({p["estimator"] for p in points}) > 8  # they need more room to be told apart
    columns = min(2 if many else 3, max(1, len(scenarios)))
    rows = -(-len(scenarios) // columns)
    wide, high = (5.4, 4.4) if many else (3.6, 3.2)
    fig = Figure(figsize=(0.6 + wide * columns, 0.8 + high * rows), layout="constrained")
    axes = fig.subplots(rows, columns, squeeze=False).ravel()
    for ax in axes[len(scenarios) :]:
        ax.set_axis_off()
    for ax, (scenario, parameter) in zip(axes, scenarios, strict=False):
        mine = [p for p in points if (p["scenario"], p["parameter"]) == (scenario, parameter)]
        _panel(ax, mine)
        ax.set_title(f"{scenario}: {figures.symbol(parameter)}", fontsize=10)
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    return fig


def _panel(ax: Any, points: Sequence[Mapping[str, Any]]) -> None:
    for estimator in dict.fromkeys(p["estimator"] for p in points):
        line = sorted(
            (p for p in points if p["estimator"] == estimator and p["std"] and p["lag"]),
            key=lambda p: p["std"],
        )
        x, y = [p["std"] for p in line], [p["lag"] for p in line]
        low = [p["lag"] - (p["lag_interval"] or [p["lag"]] * 2)[0] for p in line]
        high = [(p["lag_interval"] or [p["lag"]] * 2)[1] - p["lag"] for p in line]
        ax.errorbar(
            x, y, yerr=np.maximum(0, [low, high]) if line else None,
            marker=figures.marker(estimator), ms=5, lw=1.2, capsize=2,
            color=figures.colour(estimator), label=estimator,
        )  # fmt: skip
    for key, dashes, label in (
        ("lag_bound", "--", "Cramér–Rao bound, all θ unknown"),
        ("lag_bound_single", ":", "the same, only this θ unknown"),
    ):
        bound = next((p[key] for p in points if p[key]), None)
        if bound:
            ax.axhline(bound, color="k", ls=dashes, lw=1, label=label)
    if not any(p["std"] and p["lag"] for p in points):  # a logarithm wants something to show
        ax.set(xlim=(0.1, 10))
        ax.text(0.5, 0.5, "no spread, or never settled", transform=ax.transAxes, ha="center")
    ax.set(xscale="log", yscale="log", xlabel="std before the fault [% of nominal]")
    ax.set_ylabel("lag after the fault [s]")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    ax.grid(alpha=0.25)
