"""Figures 3 to 9 of the paper, each a function of the evidence."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexaxis.estimators.offline.adaptation import steady_P
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.paper import offline
from flexaxis.experiments.paper.checks_filter import settled_after
from flexaxis.experiments.paper.checks_model import PEAKS, low_energy, torque_lines, torque_peaks
from flexaxis.experiments.paper.claims import Evidence
from flexaxis.experiments.paper.convergence import FORGETTING, drift
from flexaxis.experiments.paper.data import Data
from flexaxis.experiments.paper.filters import STRIDE, FilterRuns
from flexaxis.experiments.paper.style import COLOURS, GREY, HIGHLIGHT, LINES, WIDTH, note
from flexaxis.experiments.reporting.figures import symbol

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

STEP = 5  # samples from one drawn estimate to the next


def fig3(e: Evidence) -> Figure:
    """Draw the spectrum of the torque in closed loop."""
    omega, amplitude = torque_lines(e.data)
    edge = 2 * np.pi * e.data.excitation.high
    fig = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    ax = fig.subplots()
    ax.axvspan(0, 70, color="0.95", lw=0)
    ax.fill_between(omega, amplitude, color="#0072B2", alpha=0.15, lw=0)
    ax.plot(omega, amplitude, color="#0072B2")
    top = 1.25 * amplitude.max()
    for wanted in PEAKS:
        ax.plot([wanted] * 2, [0.955 * top, top], color=HIGHLIGHT, lw=2)
    ax.text(91, 0.978 * top, "peaks in the paper", color=HIGHLIGHT, ha="right", va="center")
    for peak in torque_peaks(e.data):
        height = float(np.interp(peak, omega, amplitude))
        ax.plot(peak, height, "o", color="#0072B2", ms=5)
        ax.annotate(
            f"{peak:.0f}",
            (peak, height),
            xytext=(0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=9,
        )
    ax.axvline(edge, color="0.5", lw=0.8, ls=":")
    ax.text(edge + 2, 0.5 * top, "edge of the\nband, 30 Hz", color="0.4", fontsize=9)
    ax.text(35, 0.3 * top, f"{low_energy(e.data):.1f} % of the energy", ha="center", color="0.4")
    ax.set(xlim=(0, 220), ylim=(0, top))
    ax.set(xlabel="frequency [rad/s]", ylabel="amplitude of the torque [N m]")
    return fig


def fig4(e: Evidence) -> Figure:
    """Draw the Bode diagrams of the axis, the identified physical model and an ARX model."""
    omega = np.geomspace(20, 400, 600)
    responses = bode_responses(e, omega)
    styles = {
        "axis (truth)": {"color": "k", "ls": "--", "lw": 1.2, "zorder": 3},
        "physical model, identified": {"color": "#0072B2", "lw": 2.2},
        f"ARX model of order {offline.HIGH_ORDER}": {"color": "#E69F00", "lw": 1.3},
    }
    fig = Figure(figsize=(WIDTH, 5.6), layout="constrained")
    gain, phase, error = fig.subplots(3, 1, sharex=True, height_ratios=(2.2, 1.4, 1))
    truth = responses["axis (truth)"]
    for label, style in styles.items():
        response = responses[label]
        gain.semilogx(omega, offline.decibels(response), label=label, **style)
        phase.plot(omega, np.degrees(np.unwrap(np.angle(response))), **style)
        error.plot(omega, offline.decibels(response) - offline.decibels(truth), **style)
    for ax in (gain, phase, error):
        ax.axvspan(20, offline.BAND[0], color="0.95", lw=0)
        ax.axvspan(offline.BAND[1], 400, color="0.95", lw=0)
        ax.grid(True, which="both")
    error.set_xticks([20, 50, 100, 200, 400], ["20", "50", "100", "200", "400"])
    error.set_xticks([], minor=True)
    gain.set(ylabel="gain [dB]", ylim=(-12, 38))
    gain.legend(loc="lower left")
    phase.set(ylabel="phase [°]", ylim=(-200, 90), yticks=[-180, -90, 0, 90])
    error.set(xlim=(20, 400), ylim=(-0.3, 0.3), ylabel="off by [dB]", xlabel="frequency [rad/s]")
    note(gain, "little torque", 0.02, 0.95)
    note(gain, "no torque", 0.98, 0.95, ha="right")
    return fig


def bode_responses(e: Evidence, omega: Array) -> dict[str, ComplexArray]:
    """Return the frequency responses (M,) of Fig. 4 by their labels, with python-control."""
    import control

    period, physical = e.data.scenario.period, e.offline.physical
    arx = e.offline.arx[offline.HIGH_ORDER]

    def sampled(names: tuple[str, ...], theta: Array) -> ComplexArray:
        A, B, C = e.data.model.parametrize(names).matrices(theta)
        system = control.c2d(control.ss(A, B, C, 0), period, method="zoh")
        return np.squeeze(control.frequency_response(system, omega).complex)

    black_box = control.tf(arx.b, arx.a, period)
    return {
        "axis (truth)": sampled(e.data.names, e.data.parametrization.theta),
        "physical model, identified": sampled(physical.names, physical.theta),
        f"ARX model of order {offline.HIGH_ORDER}": np.squeeze(
            control.frequency_response(black_box, omega).complex
        ),
    }


def fig5(e: Evidence) -> Figure:
    """Draw |G_θ|² of the three parameters, with the torque that it weighs."""
    omega = np.linspace(1, 220, 1000)
    model = e.data.parametrization
    _, slopes = frequency_response(model, model.theta, omega, period=e.data.scenario.period)
    fig = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    ax = fig.subplots()
    lines, amplitude = torque_lines(e.data)
    torque = ax.twinx()
    torque.fill_between(lines, amplitude**2, color="0.85", lw=0)
    torque.set(ylim=(0, 2.2 * amplitude.max() ** 2), yticks=[])
    torque.spines["right"].set_visible(False)
    torque.grid(False)
    ax.set_zorder(torque.get_zorder() + 1)
    ax.patch.set_visible(False)
    power = np.diag(e.convergence.Q)
    for i, name in enumerate(e.data.names):
        label = f"{symbol(name)}:  E ψ² = {power[i]:.0f}"
        curve = np.abs(slopes[:, i]) ** 2
        ax.semilogy(omega, curve, color=COLOURS[name], ls=LINES[name], label=label)
    ax.set(xlim=(0, 220), ylim=(1e-6, 1e8), xlabel="frequency [rad/s]")
    ax.set_ylabel(r"$|G_\theta|^2$")
    ax.legend(loc="upper center", ncols=3)
    note(ax, "grey: power of the torque,\nlinear scale", 0.02, 0.1)
    return fig


def fig6(e: Evidence) -> Figure:
    """Draw the estimates with forgetting."""
    return _estimates(e, e.convergence.forgetting)


def fig8(e: Evidence) -> Figure:
    """Draw the estimates with covariance modification, on the axes of Fig. 6."""
    return _estimates(e, e.convergence.drift)


def fig7(e: Evidence) -> Figure:
    """Draw diag P with forgetting."""
    theory = steady_P(e.convergence.Q, forgetting=FORGETTING)
    return _diagonal(e.data, e.convergence.forgetting, theory, "(1−λ) Q⁻¹, eq. (29)")


def fig9(e: Evidence) -> Figure:
    """Draw diag P with covariance modification, on the axis of Fig. 7."""
    theory = steady_P(e.convergence.Q, drift=drift())
    return _diagonal(e.data, e.convergence.drift, theory, "P Q P = Δ, eq. (30)")


def _estimates(e: Evidence, runs: FilterRuns) -> Figure:
    fig = Figure(figsize=(WIDTH, 5.0), layout="constrained")
    axes = fig.subplots(3, 1, sharex=True, sharey=True)
    time = e.data.scenario.times[::STEP]
    t63 = settled_after(e, runs, 0.37)
    for i, (ax, name) in enumerate(zip(axes, e.data.names, strict=True)):
        low, high = np.percentile(runs.theta[:, ::STEP, i], [10, 90], axis=0)
        ax.fill_between(time, low, high, color=COLOURS[name], alpha=0.25, lw=0)
        ax.plot(time, runs.theta[0, ::STEP, i], color=COLOURS[name], lw=0.9)
        ax.axhline(1, color="k", ls="--", lw=1.0)
        ax.axvline(t63[name], color="0.4", lw=0.8, ls=":")
        ax.text(t63[name] + 0.4, 1.3, f"63 % after {t63[name]:.2g} s", fontsize=9, color="0.35")
        ax.set(ylim=(0.88, 1.4), xlim=(0, time[-1]), ylabel=f"{symbol(name)} / nominal")
    axes[-1].set_xlabel("time [s]")
    note(axes[0], f"line: one run, band: 10–90 % of {len(runs.theta)} runs", 0.98, 0.9, ha="right")
    return fig


def _diagonal(data: Data, runs: FilterRuns, theory: Array, label: str) -> Figure:
    fig = Figure(figsize=(WIDTH, 3.4), layout="constrained")
    ax = fig.subplots()
    time = data.scenario.times[STRIDE - 1 :: STRIDE]
    for i, name in enumerate(data.names):
        text = f"$P_{{{i + 1}{i + 1}}}$  ({symbol(name)})"
        # the restless ones thin and below
        style = {"color": COLOURS[name], "ls": LINES[name], "lw": 1.8 - 0.4 * i, "zorder": 4 - i}
        ax.semilogy(time, runs.P[0, :, i], label=text, **style)
        ax.axhline(theory[i, i], color=COLOURS[name], lw=0.8, ls=":")
    ax.plot([], [], color=GREY, lw=0.8, ls=":", label=label)
    ax.set(xlim=(0, time[-1]), ylim=(1.5e-6, 2e-3), xlabel="time [s]", ylabel="diagonal of P")
    ax.legend(loc="upper center", ncols=4)
    return fig
