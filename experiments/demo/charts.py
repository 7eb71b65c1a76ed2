"""The curves of the page: estimates with bands, diag P, and the trade-off, drawn by the browser."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.demo.bound import Allowed
from flexaxis.experiments.demo.dots import Dot
from flexaxis.experiments.demo.racer import NAMES, SHOWN
from flexaxis.experiments.demo.session import SPAN, Curves
from flexaxis.experiments.scoring.theta import physical
from flexaxis.sim.law_parameters import LAW_UNITS
from flexaxis.sim.parameters import PARAMETER_UNITS

Array = NDArray[np.float64]

COLOURS = ("#0072B2", "#D55E00")
"""Of the two racers, whoever they are: distinct also for the colour-blind."""

THEORY = "#777777"
"""Of what theory allows."""

DASHES = ((), (10, 4), (2, 4))
FAR = 4.0
"""Estimates are drawn up to this many times nominal, so that a burst leaves the rest to be seen."""


P_RANGE, F_C_RANGE = (-7.0, -0.4), (-0.04, 0.44)
"""Of the charts of log₁₀ P and of f_c [N m]; fixed, so that what is nowhere does not set them."""
NOWHERE = -1e6

NEAR = 0.03
"""Of nominal: so far from it an estimate is always drawn, and noise does not fill a chart."""
TICKS = tuple(float(f"{digit}e{power}") for power in range(-3, 3) for digit in (1, 2, 5))
"""Between two ticks; less than a thousandth the browser's three decimals would not tell apart."""


def unit(name: str) -> str:
    """Return the unit of an estimated parameter."""
    parameter, exponent = physical(name)
    text = (PARAMETER_UNITS | LAW_UNITS)[parameter].replace("^2", "²")
    return text if exponent > 0 else f"1/({text})"


class Charts:
    """The charts of the last seconds, and the trade-off.

    Parameters
    ----------
    gui : viser.GuiApi
        Where they are put.
    nominal : ndarray (4,)
        Sizes of the parameters in `SHOWN`.
    """

    def __init__(self, gui: Any, nominal: Array) -> None:
        self._nominal = nominal
        self._estimates = [
            _estimate_chart(gui, name, float(size))
            for name, size in zip(SHOWN, nominal, strict=True)
        ]
        self._dots = _dot_chart(gui)
        self._P = _P_chart(gui)
        self._drawn: tuple[Any, ...] = ()

    def update(self, curves: Curves, dots: Sequence[Dot], allowed: Allowed | None) -> None:
        """Draw the last seconds, and the dots and the bound if there are new ones."""
        if len(curves.time) < 2:
            return
        for i, chart in enumerate(self._estimates):
            chart.visible = i < len(NAMES) or bool(curves.truth[:, i].any())
            chart.data = estimate_lines(curves, i, float(self._nominal[i]))
        self._P.data = P_lines(curves)
        lag = allowed.lag if allowed else None
        if (list(dots), lag) != self._drawn:
            self._drawn = list(dots), lag
            self._dots.data = dot_columns(dots, lag)


def estimate_lines(curves: Curves, i: int, nominal: float) -> tuple[Array, ...]:
    """Return time, truth, and for each racer +2σ, −2σ and the estimate; each (M,).

    What a racer does not estimate is far below the chart.
    """
    lines = [curves.truth[:, i]]
    for racer in range(curves.theta.shape[1]):
        theta = curves.theta[:, racer, i]
        band = 2 * np.nan_to_num(curves.deviation[:, racer, i])
        lines += [theta + band, theta - band, theta]
    low = nominal / FAR if i < len(NAMES) else -nominal
    clipped = [np.clip(line, low, nominal * FAR) for line in lines]
    return (curves.time, *(np.where(np.isnan(line), NOWHERE, line) for line in clipped))


def P_lines(curves: Curves) -> tuple[Array, ...]:
    """Return time and log₁₀ of the diagonal of P for each racer and parameter, each (M,).

    That of an estimator that has none is far below the chart, for the browser knows no gaps.
    """
    P = np.log10(
        np.clip(curves.P.reshape(len(curves.P), -1), 10.0 ** P_RANGE[0], 10.0 ** P_RANGE[1])
    )
    return (curves.time, *np.where(np.isnan(P), NOWHERE, P).T)


def dot_columns(
    dots: Sequence[Dot], allowed: tuple[float, float] | None = None
) -> tuple[Array, ...]:
    """Return std (M,) in rising order, the two lags allowed, and lags of each racer and parameter.

    Each is a column (M,), far below the chart where a dot belongs to another one.
    """
    rows = sorted(dots, key=lambda dot: dot.std)
    columns = np.full((2 * len(NAMES), len(rows) + 2), 1e-9)
    for place, dot in enumerate(rows, start=1):
        columns[len(NAMES) * dot.racer + NAMES.index(dot.parameter), place] = dot.lag
    std = np.array([1e-9, *(dot.std for dot in rows), 1e9])
    bounds = [np.full(len(std), lag) for lag in allowed or (1e-9, 1e-9)]
    return (std, *bounds, *columns)


def _estimate_chart(gui: Any, name: str, nominal: float) -> Any:
    from viser import uplot

    series = [uplot.Series(label="t"), uplot.Series(label="truth", stroke="#000", dash=(6, 4))]
    for colour in COLOURS:
        faint = {"stroke": "transparent", "points": {"show": False}}
        series += [uplot.Series(label=f"{s}2σ", **faint) for s in "+−"]  # type: ignore[typeddict-item]
        series.append(uplot.Series(label="estimate", stroke=colour, width=2))
    return gui.add_uplot(
        data=_nothing(len(series)),
        series=tuple(series),
        bands=tuple(
            uplot.Band(series=(2 + 3 * i, 3 + 3 * i), fill=colour + "30")
            for i, colour in enumerate(COLOURS)
        ),
        title=f"{name} [{unit(name)}] over t [s]",
        **_look(_around(nominal) if name in NAMES else F_C_RANGE, TICKS),
    )


def _around(nominal: float) -> Any:
    """Return a range that follows the data, and always holds what is near nominal."""
    edges = {"min": nominal * (1 - NEAR), "max": nominal * (1 + NEAR)}
    return {side: {"pad": 0.1, "soft": edge, "mode": 1} for side, edge in edges.items()}


def _P_chart(gui: Any) -> Any:
    from viser import uplot

    lines = [
        uplot.Series(label=name, stroke=colour, width=2, dash=dash)
        for colour in COLOURS
        for name, dash in zip(NAMES, DASHES, strict=True)
    ]
    return gui.add_uplot(
        data=_nothing(1 + len(lines)),
        series=(uplot.Series(label="t"), *lines),
        title="log₁₀ diag P: k_T —, 1/J_a – –, f_m · ·",
        **_look(P_RANGE, (1.0, 2.0)),
    )


def _dot_chart(gui: Any) -> Any:
    from viser import uplot

    dots = [
        uplot.Series(
            label=name,
            stroke="transparent",
            points={"show": True, "size": size, "width": 2, "stroke": colour, "fill": fill},
        )
        for colour in COLOURS
        for name, size, fill in zip(NAMES, (9, 12, 9), ("#fff", colour + "40", colour), strict=True)
    ]
    return gui.add_uplot(
        data=dot_columns(()),
        series=(uplot.Series(label="std"), *theory_series(), *dots),
        bands=(theory_band(),),
        title="lag after a fault [s] over std before it [%]: k_T ○, 1/J_a ◎, f_m ●",
        scales={
            "x": uplot.Scale(time=False, distr=3, log=10, auto=False, range=(0.01, 80)),
            "y": uplot.Scale(distr=3, log=10, auto=False, range=(0.01, 8)),
        },
        axes=axes(),
        legend=uplot.Legend(show=False),
        height=170,
    )


def theory_series() -> list[Any]:
    """Return the look of the two edges of what theory allows."""
    from viser import uplot

    return [
        uplot.Series(label=label, stroke=THEORY, width=1, points={"show": False})  # type: ignore[typeddict-item]
        for label in ("allowed, told which", "allowed")
    ]


def theory_band() -> Any:
    """Return the look of what lies between them."""
    from viser import uplot

    return uplot.Band(series=(2, 1), fill=THEORY + "50")


def _look(y: Any, ticks: Sequence[float]) -> dict[str, Any]:
    from viser import uplot

    fixed = isinstance(y, tuple)
    return {
        "scales": {
            "x": uplot.Scale(time=False),
            "y": uplot.Scale(auto=not fixed, range=y),
        },
        "axes": axes(space=20, incrs=tuple(ticks)),
        "legend": uplot.Legend(show=False),
        "height": 108,
    }


def axes(**y: Any) -> tuple[Any, Any]:
    """Return the look of both axes: no more room than their numbers need."""
    from viser import uplot

    plain = {"grid": {"show": True, "width": 1}, "ticks": {"show": False}}
    return cast(uplot.Axis, {"size": 28} | plain), cast(uplot.Axis, plain | y)


def _nothing(series: int) -> tuple[Array, ...]:
    return (np.array([0.0, SPAN]), *np.ones((series - 1, 2)))
