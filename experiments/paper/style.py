"""How the figures of the paper look: one colour and line style a parameter, quiet axes."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes

RC: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.labelsize": 10.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "legend.fontsize": 9,
}
"""Settings of matplotlib that all figures are drawn with."""

WIDTH = 8.0
"""Width of a figure [in]."""

# Okabe and Ito's colours, distinct also for the colour-blind; line styles as in the paper
COLOURS = {"k_T": "#0072B2", "1/J_a": "#D55E00", "f_m": "#009E73"}
LINES: dict[str, str | tuple[int, tuple[int, ...]]] = {
    "k_T": "-",
    "1/J_a": (0, (5, 1)),
    "f_m": (0, (6, 1, 1, 1)),
}
GREY = "#7F7F7F"
HIGHLIGHT = "#CC79A7"


def note(
    ax: Axes, text: str, x: float, y: float, *, colour: str = "0.35", ha: str = "left"
) -> None:
    """Write a remark into an axis, at fractions of its width and height."""
    ax.text(x, y, text, transform=ax.transAxes, color=colour, fontsize=9, ha=ha, va="center")
