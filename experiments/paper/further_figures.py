"""Figures A to E: answers to what the paper left for further work."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from flexaxis.experiments.paper.claim import Evidence
from flexaxis.experiments.paper.data import PAUSE
from flexaxis.experiments.paper.experiments import FORGETTING, STRIDE
from flexaxis.experiments.paper.figures import (
    diagonal,
    estimates,
    fig3,
    fig4,
    fig5,
    level,
    line,
    truth,
)
from flexaxis.experiments.paper.filter_measures import price
from flexaxis.experiments.paper.further_work import WANTED, Windups
from flexaxis.experiments.reporting.charts import Chart, Line, Panel

SHOWN_MU = (0.0, 1e-2, 1.0)
SHOWN_RESETS = {None: "no reset", 0.03: "reset to 3 %", 1.0: "reset to 100 %"}
ROOM = 1.4  # factor on a time constant that is shaded


def figA(e: Evidence) -> Chart:
    """Return wanted and measured time constants, and what they cost."""
    ends = np.array([0.2, 4.0])
    wanted = line(ends, ends, role="truth", label="as wanted", low=ends / ROOM, high=ends * ROOM)

    def dots(designs: Sequence[Any], what: str, **more: Any) -> list[Line]:
        rows = np.array([getattr(design, what) for design in designs])
        return [
            line(WANTED, row, name, **more) for name, row in zip(e.data.names, rows.T, strict=True)
        ]

    diagonal, coupled = e.further.diagonal, e.further.coupled
    reached = {
        "small steps, diagonal Δ": dots(diagonal, "measured", kind="points"),
        "small steps, coupled Δ": dots(coupled, "measured", kind="points"),
        "steps of 10, 10 and 50 %": dots(diagonal, "large", kind="points"),
    }
    panels = [
        Panel(y="63 % after [s]", title=title, lines=[wanted, *lines], y_log=True, y_range=(0.2, 5))
        for title, lines in reached.items()
    ]
    cost = [*dots(diagonal, "measured_std", kind="points"), *dots(diagonal, "predicted_std")]
    title = "what speed costs; lines: √(σ² P/2), P of (30)"
    panels.append(Panel(y="std [% of nominal]", title=title, lines=cost, y_log=True))
    return Chart(
        name="figA",
        title="Figure A. Time constants wanted, reached, and their price",
        words="Shaded: within a factor of 1.4. The diagonal Δ costs little for the correlation of "
        "k_T and f_m; a coupled Δ with the off-diagonal elements takes it away. Two limits show: a "
        "time constant of half a second is hardly longer than the memory of the axis, and a step "
        "of 10 % in J_a moves a resonance by about its width, so that the estimate needs up to "
        "twice the time.",
        x="time constant wanted [s]",
        panels=panels,
        windows=[("", 0.2, 4.0)],
        x_log=True,
    )


def figB(e: Evidence) -> Chart:
    """Return one run through a standstill, with and without regularisation."""
    time, i = e.data.pause[0].time, e.data.names.index("1/J_a")
    growth, estimate = [], [truth(time[[0, -1]], [1, 1])]
    for mu in SHOWN_MU:
        runs = e.further.windups["forgetting"][mu].runs
        who, largest = f"μ = {mu:g}", runs.P[0].max(axis=1)
        growth.append(line(time[STRIDE - 1 :: STRIDE], largest, who))
        if mu:
            growth.append(level(PAUSE, (1 - FORGETTING) / mu, who, label="(1−λ)/μ"))
        estimate.append(line(time, runs.theta[0, :, i], who))
    return Chart(
        name="figB",
        title="Figure B. A standstill of 20 s",
        words="Without μ, P grows by 1/λ in every sample of the standstill with forgetting, and by "
        "Δ with covariance modification; the estimates burst when the excitation returns, within "
        "the box of 0.1 to 10 times nominal that holds them, and can stay lost in a local minimum. "
        "With μ = 1 that is over at hardly any cost.",
        x="time [s]",
        panels=[
            Panel(y="largest of diag P", lines=growth, y_log=True),
            Panel(y="1/J_a / nominal", lines=estimate, y_log=True, y_range=(0.08, 12.5)),
        ],
        spans=[(*PAUSE, "standstill")],
        windows=[("standstill", 0.0, 40.0), ("restart", 29.5, 33.5)],
    )


def figC(e: Evidence) -> Chart:
    """Return what regularisation gives and costs, over μ."""

    def over_mu(score: Callable[[Windups, float], float]) -> list[Line]:
        windups = e.further.windups.items()
        return _over({who: [(mu, score(s, mu)) for mu in s] for who, s in windups}, "μ = 0")

    burst = over_mu(lambda studies, mu: studies[mu].burst)
    return Chart(
        name="figC",
        title="Figure C. What regularisation gives, and what it costs",
        words="Beyond 1, μ starts to cost: it bounds all elements of P alike, and that of k_T, the "
        "largest with forgetting, pays first.",
        x="μ",
        panels=[
            Panel(y="worst error after restart [%]", lines=burst, y_log=True),
            Panel(y="lag after a fault, × that at μ = 0", lines=over_mu(price), y_log=True),
        ],
        x_log=True,
    )


def _over(rows: Mapping[str, Sequence[tuple[float, float]]], nothing: str) -> list[Line]:
    """Return lines over an option; its value at 0, which comes first, is a level."""
    lines = []
    for who, points in rows.items():
        x, y = np.array(points).T
        lines.append(line(x[1:], y[1:], who, kind="both"))
        lines.append(level(x[[1, -1]], y[0], who, label=nothing))
    return lines


def figD(e: Evidence) -> Chart:
    """Return the median estimate of f_m about its fault, with P reset at its time."""
    time = e.data.faults["f_m"][0].time - e.data.onset * e.data.scenario.period
    near, i = (time > -0.5) & (time < 4.0), e.data.names.index("f_m")
    lines = [
        line(time[near], np.median(e.further.resets[prior].runs.theta[:, near, i], axis=0), who)
        for prior, who in SHOWN_RESETS.items()
    ]
    stepped = truth([-0.5, 0, 0, 4], [1, 1, 1.5, 1.5])
    return Chart(
        name="figD",
        title="Figure D. 50 % more friction, and P reset at that time",
        words="The median of the runs.",
        x="time after the fault [s]",
        panels=[Panel(y="f_m / nominal", lines=[stepped, *lines], y_range=(0.8, 1.9))],
    )


def figE(e: Evidence) -> Chart:
    """Return what a reset of P gives, over the prior that it is reset to."""

    def over_priors(score: str) -> list[Line]:
        resets = e.further.resets.items()
        points = [(100 * (prior or 0.0), getattr(s, score)) for prior, s in resets]
        rows = {name: [(x, values[name]) for x, values in points] for name in e.data.names}
        return _over(rows, "no reset")

    return Chart(
        name="figE",
        title="Figure E. What a reset of P gives at a known change",
        words="α is the deviation that is thought possible. A few per cent make the estimates "
        "several times faster; too much, and the first samples throw all of them off, since the "
        "model is not linear in its parameters. The others pay for a second.",
        x="α, prior deviation after the reset [%]",
        panels=[
            Panel(y="lag [s]", lines=over_priors("lag"), y_log=True),
            Panel(y="rms of the others in 1 s [%]", lines=over_priors("cross_talk"), y_log=True),
        ],
        x_log=True,
    )


FIGURES: Mapping[str, Callable[[Evidence], Chart]] = {
    "fig3": fig3,
    "fig4": fig4,
    "fig5": fig5,
    "fig6": partial(estimates, "forgetting", "fig6", "Figure 6. Estimates with forgetting"),
    "fig7": partial(
        diagonal, "forgetting", "fig7", "Figure 7. Diagonal of P with forgetting, first run",
        "(1−λ) Q⁻¹, eq. (29)",
    ),
    "fig8": partial(
        estimates, "modification", "fig8", "Figure 8. Estimates with covariance modification"
    ),
    "fig9": partial(
        diagonal, "modification", "fig9",
        "Figure 9. Diagonal of P with covariance modification, first run", "P Q P = Δ, eq. (30)",
    ),
    "figA": figA,
    "figB": figB,
    "figC": figC,
    "figD": figD,
    "figE": figE,
}  # fmt: skip
"""All figures, by the name of their files."""
