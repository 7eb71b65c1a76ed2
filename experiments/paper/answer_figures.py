"""Figures A to C: answers to what the paper left for further work."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flexaxis.experiments.figures import colour, symbol
from flexaxis.experiments.paper.answers import RESETS, Reset
from flexaxis.experiments.paper.checks_answers import price
from flexaxis.experiments.paper.claims import Evidence
from flexaxis.experiments.paper.convergence import FORGETTING
from flexaxis.experiments.paper.data import PAUSE
from flexaxis.experiments.paper.filters import STRIDE
from flexaxis.experiments.paper.style import COLOURS, GREY, WIDTH, note

WIDE = 1.25 * WIDTH
METHODS = {"forgetting": colour("rpem-forgetting"), "modification": colour("rpem-drift")}
SHOWN_MU = {0.0: "k", 1e-2: "#E69F00", 1.0: "#0072B2"}
SHOWN_RESETS = {None: GREY, 0.03: "#009E73", 1.0: "#CC79A7"}


def figA(e: Evidence) -> Figure:
    """Draw wanted and measured time constants, and what they cost."""
    fig = Figure(figsize=(WIDE, 3.7), layout="constrained")
    small, large, std = fig.subplots(1, 3)
    wanted = np.array([design.wanted[0] for design in e.answers.diagonal])
    for i, name in enumerate(e.data.names):
        own = {"color": COLOURS[name], "ls": "none", "ms": 6}
        for designs, marker in ((e.answers.diagonal, "o"), (e.answers.coupled, "x")):
            small.plot(wanted, [design.measured[i] for design in designs], marker, **own)
        large.plot(wanted, [design.large[i] for design in e.answers.diagonal], "o", **own)
        std.plot(wanted, [d.predicted_std[i] for d in e.answers.diagonal], color=COLOURS[name])
        measured = [d.measured_std[i] for d in e.answers.diagonal]
        std.plot(wanted, measured, "o", label=symbol(name), **own)
    for ax in (small, large):
        ax.plot([0.2, 4], [0.2, 4], "k--", lw=1)
        ax.fill_between([0.2, 4], [0.2 / 1.4, 4 / 1.4], [0.28, 5.6], color="0.93", lw=0)
        ax.set(ylim=(0.2, 5), ylabel="time to 63 % of a step [s]")
    for ax in (small, large, std):
        ax.set(xscale="log", yscale="log", xlim=(0.2, 4), xlabel="time constant wanted [s]")
        _plain(ax, x=wanted.tolist())
    for ax in (small, large):
        _plain(ax, y=[0.3, 0.6, 1.2, 2.4, 4.8])
    _plain(std, y=[0.02, 0.05, 0.1, 0.2, 0.5])
    small.set_title("small steps: as predicted")
    large.set_title("steps of 10, 10 and 50 %")
    std.set_title("what speed costs")
    std.set_ylabel("standard deviation [% of nominal]")
    std.legend(loc="lower left", handletextpad=0.2)
    note(small, "• diagonal Δ   × coupled Δ", 0.04, 0.95)
    note(std, "line: √(σ² P/2), P of (30)", 0.3, 0.95)
    return fig


def figB(e: Evidence) -> Figure:
    """Draw a standstill with and without regularisation, and burst and price over μ."""
    fig = Figure(figsize=(WIDE, 6.2), layout="constrained")
    (growth, estimate), (burst, cost) = fig.subplots(2, 2)
    time = e.data.pause[0].time
    studies = {study.mu: study for study in e.answers.forgetting}
    for mu, shade in SHOWN_MU.items():
        study = studies[mu]
        growth.semilogy(
            time[STRIDE - 1 :: STRIDE],
            study.runs.P[0].max(axis=1),
            color=shade,
            label=f"μ = {mu:g}",
        )
        if mu:
            growth.axhline((1 - FORGETTING) / mu, color=shade, lw=0.8, ls=":")
        estimate.plot(time[::2], study.runs.theta[0, ::2, 0], color=shade, lw=1.2)
    for ax in (growth, estimate):
        ax.axvspan(*PAUSE, color="#E69F00", alpha=0.12, lw=0)
    growth.set(xlim=(0, 40), xlabel="time [s]", ylabel="largest diagonal element of P")
    growth.legend(loc="upper right")
    growth.set_title("standstill: P grows as λ⁻ᵏ unless μ > 0")
    note(growth, "dotted: (1−λ)/μ", 0.02, 0.95)
    estimate.axhline(1, color="k", ls="--", lw=1)
    estimate.set(xlim=(28, 36), ylim=(0.5, 1.5), xlabel="time [s]")
    estimate.set_ylabel(f"{symbol('k_T')} / nominal")
    estimate.set_title("restart: the estimate bursts")
    _over_mu(burst, e, lambda studies, study: study.burst)
    burst.set(yscale="log", ylabel="burst, worst parameter [% of nominal]")
    burst.set_title("what regularisation gives")
    burst.legend(loc="upper right")
    _over_mu(cost, e, price)
    cost.set(yscale="log", ylim=(0.9, 6), ylabel="lag after a fault, over that with μ = 0")
    _plain(cost, y=[1, 2, 3, 4, 5])
    cost.set_title("what it costs")
    return fig


def _over_mu(ax: Axes, e: Evidence, score) -> None:  # type: ignore[no-untyped-def]
    """Draw a score of both methods over μ; μ = 0 stands at the left end."""
    for (label, shade), studies in zip(
        METHODS.items(), (e.answers.forgetting, e.answers.drift), strict=True
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
    studies = {study.fraction: study for study in e.answers.resets}
    time = e.data.faults["f_m"][0].time - e.data.onset * e.data.scenario.period
    i = e.data.names.index("f_m")
    for fraction, shade in SHOWN_RESETS.items():
        label = "no reset" if fraction is None else f"reset to {100 * fraction:g} %"
        runs = studies[fraction].runs.theta[:, :, i]
        estimate.plot(time, np.median(runs, axis=0), color=shade, label=label)
    estimate.plot([-1, 0, 0, 5], [1, 1, 1.5, 1.5], "k--", lw=1)
    estimate.set(xlim=(-0.5, 4), ylim=(0.8, 1.9), xlabel="time after the fault [s]")
    estimate.set_ylabel(f"{symbol('f_m')} / nominal, median run")
    estimate.legend(loc="lower right")
    estimate.set_title("50 % more friction")
    for name in e.data.names:
        own = {"color": COLOURS[name], "ms": 5}
        _over_resets(lag, studies, lambda study, name=name: study.lag[name], symbol(name), own)
        _over_resets(talk, studies, lambda study, name=name: study.cross_talk[name], None, own)
    lag.set(ylabel="lag [s]", yscale="log")
    lag.set_title("lag of the changed parameter")
    lag.legend(loc="lower left", ncols=3, columnspacing=0.8, handlelength=1.4)
    note(lag, "dotted: no reset", 0.05, 0.93)
    lag.set_ylim(0.1, 8)
    _plain(lag, y=[0.2, 0.5, 1, 2, 5])
    talk.set(ylabel="rms of the others in 1 s [% of nominal]", yscale="log")
    talk.set_title("what it does to the others")
    return fig


def _over_resets(  # type: ignore[no-untyped-def]
    ax: Axes, studies: dict[float | None, Reset], score, label: str | None, style
) -> None:
    """Draw a score over the prior that P is reset to, and its value without a reset."""
    ax.loglog(
        [100 * fraction for fraction in RESETS],
        [score(studies[fraction]) for fraction in RESETS],
        "o-",
        label=label,
        **style,
    )
    ax.axhline(score(studies[None]), color=style["color"], lw=1, ls=":")
    ax.set_xlabel("prior deviation after reset [%]")
    _plain(ax, x=[0.3, 1, 3, 10, 30, 100])


def _plain(ax: Axes, *, x: list[float] | None = None, y: list[float] | None = None) -> None:
    """Label a logarithmic axis with plain numbers at the places given."""
    for axis, ticks in ((ax.xaxis, x), (ax.yaxis, y)):
        if ticks is not None:
            axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
            axis.set_ticks([], minor=True)
