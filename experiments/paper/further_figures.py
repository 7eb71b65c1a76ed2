"""Figures A to C: answers to what the paper left for further work."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexaxis.experiments.paper.checks_further import price
from flexaxis.experiments.paper.claims import Evidence
from flexaxis.experiments.paper.convergence import FORGETTING
from flexaxis.experiments.paper.data import PAUSE
from flexaxis.experiments.paper.filters import STRIDE
from flexaxis.experiments.paper.further_work import RESETS, WANTED, Windup
from flexaxis.experiments.paper.style import COLOURS, GREY, WIDTH, note
from flexaxis.experiments.reporting.figures import colour, symbol

WIDE = 1.25 * WIDTH
METHODS = {"forgetting": colour("rpem-forgetting"), "modification": colour("rpem-drift")}
SHOWN_MU = {0.0: "k", 1e-2: "#E69F00", 1.0: "#0072B2"}
SHOWN_RESETS = {None: GREY, 0.03: "#009E73", 1.0: "#CC79A7"}
ROOM = 1.4  # factor on a time constant that is shaded


def figA(e: Evidence) -> Figure:
    """Draw wanted and measured time constants, and what they cost."""
    fig = Figure(figsize=(WIDE, 3.7), layout="constrained")
    small, large, std = fig.subplots(1, 3)
    diagonal, coupled = e.further.diagonal, e.further.coupled
    for i, name in enumerate(e.data.names):
        _over_wanted(small, [design.measured[i] for design in diagonal], "o", name)
        _over_wanted(small, [design.measured[i] for design in coupled], "x", name)
        _over_wanted(large, [design.large[i] for design in diagonal], "o", name)
        _over_wanted(std, [design.measured_std[i] for design in diagonal], "o", name)
        _over_wanted(std, [design.predicted_std[i] for design in diagonal], "-", name)
    for ax in (small, large):
        ends = np.array([0.2, 4])
        ax.plot(ends, ends, "k--", lw=1)
        ax.fill_between(ends, ends / ROOM, ends * ROOM, color="0.93", lw=0)
        ax.set(ylim=(0.2, 5), ylabel="time to 63 % of a step [s]")
        _plain(ax, y=[0.3, 0.6, 1.2, 2.4, 4.8])
    _plain(std, y=[0.02, 0.05, 0.1, 0.2, 0.5])
    std.set_ylabel("standard deviation [% of nominal]")
    small.set_title("small steps: as predicted")
    large.set_title("steps of 10, 10 and 50 %")
    std.set_title("what speed costs")
    std.legend(std.lines[::2], [symbol(name) for name in e.data.names], loc="lower left")
    note(small, "• diagonal Δ   × coupled Δ", 0.04, 0.95)
    note(std, "line: √(σ² P/2), P of (30)", 0.3, 0.95)
    return fig


def _over_wanted(ax: Axes, values: list[float], style: str, name: str) -> None:
    """Draw what came out over the time constant wanted."""
    ax.loglog(WANTED, values, style, color=COLOURS[name], ms=6)
    ax.set(xlim=(0.2, 4), xlabel="time constant wanted [s]")
    _plain(ax, x=list(WANTED))


def figB(e: Evidence) -> Figure:
    """Draw a standstill with and without regularisation, and burst and price over μ."""
    fig = Figure(figsize=(WIDE, 6.2), layout="constrained")
    (growth, estimate), (burst, cost) = fig.subplots(2, 2)
    _standstill(e, growth, estimate)
    _over_mu(burst, e, lambda studies, study: study.burst)
    burst.set(yscale="log", ylabel="worst error after restart [%]")
    burst.set_title("what regularisation gives")
    burst.legend(loc="upper right")
    _over_mu(cost, e, price)
    cost.set(yscale="log", ylim=(0.9, 6), ylabel="lag after a fault, times that at μ = 0")
    _plain(cost, y=[1, 2, 3, 4, 5])
    cost.set_title("what it costs")
    return fig


def _standstill(e: Evidence, growth: Axes, estimate: Axes) -> None:
    """Draw P and 1/J_a of one run through a standstill."""
    time, shown = e.data.pause[0].time, e.data.names.index("1/J_a")
    studies = {study.mu: study for study in e.further.forgetting}
    for mu, shade in SHOWN_MU.items():
        runs = studies[mu].runs
        largest = runs.P[0].max(axis=1)
        growth.semilogy(time[STRIDE - 1 :: STRIDE], largest, color=shade, label=f"μ = {mu:g}")
        if mu:
            growth.axhline((1 - FORGETTING) / mu, color=shade, lw=0.8, ls=":")
        estimate.semilogy(time[::2], runs.theta[0, ::2, shown], color=shade, lw=1.2)
    for ax in (growth, estimate):
        ax.axvspan(*PAUSE, color="#E69F00", alpha=0.12, lw=0)
        ax.set_xlabel("time [s]")
    growth.set(xlim=(0, 40), ylabel="largest diagonal element of P")
    growth.legend(loc="upper right")
    growth.set_title("standstill: P grows as λ⁻ᵏ unless μ > 0")
    note(growth, "dotted: (1−λ)/μ", 0.02, 0.95)
    estimate.axhline(1, color="k", ls="--", lw=1)
    estimate.set(xlim=(29.5, 33.5), ylim=(0.08, 12.5), ylabel=f"{symbol('1/J_a')} / nominal")
    _plain(estimate, y=[0.1, 0.3, 1, 3, 10])
    estimate.set_title("restart: the estimate bursts")


def _over_mu(ax: Axes, e: Evidence, score: Callable[[list[Windup], Windup], float]) -> None:
    """Draw a score of both methods over μ; μ = 0 stands at the left end."""
    for (label, shade), studies in zip(
        METHODS.items(), (e.further.forgetting, e.further.drift), strict=True
    ):
        left = min(study.mu for study in studies if study.mu) / 10
        places = [study.mu or left for study in studies]
        values = [score(studies, study) for study in studies]
        ax.semilogx(places, values, "o-", color=shade, ms=5, label=label)
    ticks = [left, *(10.0**k for k in range(-3, 4))]
    ax.set_xticks(ticks, ["0", *(f"{tick:g}" for tick in ticks[1:])])
    ax.set_xticks([], minor=True)
    ax.set_xlabel("μ")


def figC(e: Evidence) -> Figure:
    """Draw what a reset of P at the known time of a fault gives."""
    fig = Figure(figsize=(WIDE, 3.7), layout="constrained")
    estimate, lag, talk = fig.subplots(1, 3)
    _after_the_fault(e, estimate)
    for name in e.data.names:
        _over_resets(lag, {study.fraction: study.lag[name] for study in e.further.resets}, name)
        others = {study.fraction: study.cross_talk[name] for study in e.further.resets}
        _over_resets(talk, others, name)
    lag.set(ylabel="lag [s]", ylim=(0.1, 8))
    _plain(lag, y=[0.2, 0.5, 1, 2, 5])
    lag.set_title("lag of the changed parameter")
    lag.legend(loc="lower left", ncols=3, columnspacing=0.8, handlelength=1.4)
    note(lag, "dotted: no reset", 0.05, 0.93)
    talk.set(ylabel="rms of the others in 1 s [% of nominal]")
    talk.set_title("what it does to the others")
    return fig


def _after_the_fault(e: Evidence, ax: Axes) -> None:
    """Draw the median estimate of f_m around its fault."""
    studies = {study.fraction: study for study in e.further.resets}
    time = e.data.faults["f_m"][0].time - e.data.onset * e.data.scenario.period
    shown = e.data.names.index("f_m")
    for fraction, shade in SHOWN_RESETS.items():
        label = "no reset" if fraction is None else f"reset to {100 * fraction:g} %"
        estimates = studies[fraction].runs.theta[:, :, shown]
        ax.plot(time, np.median(estimates, axis=0), color=shade, label=label)
    ax.plot([-1, 0, 0, 5], [1, 1, 1.5, 1.5], "k--", lw=1)
    ax.set(xlim=(-0.5, 4), ylim=(0.8, 1.9), xlabel="time after the fault [s]")
    ax.set_ylabel(f"{symbol('f_m')} / nominal, median run")
    ax.legend(loc="lower right")
    ax.set_title("50 % more friction")


def _over_resets(ax: Axes, scores: dict[float | None, float], name: str) -> None:
    """Draw scores over the prior that P is reset to, and that without a reset (None)."""
    places = [100 * fraction for fraction in RESETS]
    values = [scores[fraction] for fraction in RESETS]
    ax.loglog(places, values, "o-", color=COLOURS[name], ms=5, label=symbol(name))
    ax.axhline(scores[None], color=COLOURS[name], lw=1, ls=":")
    ax.set_xlabel("prior deviation after reset [%]")
    _plain(ax, x=[0.3, 1, 3, 10, 30, 100])


def _plain(ax: Axes, *, x: list[float] | None = None, y: list[float] | None = None) -> None:
    """Label a logarithmic axis with plain numbers at the places given."""
    for axis, ticks in ((ax.xaxis, x), (ax.yaxis, y)):
        if ticks is not None:
            axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.set_ticks([], minor=True)
