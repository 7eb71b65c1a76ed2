"""Figures 3 to 9 of the paper: each is a chart, a function of the evidence.

The page draws them as every page does, and files have them by matplotlib.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.offline.adaptation import steady_P
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.paper.claim import Evidence, by_name
from flexaxis.experiments.paper.claims import PEAKS
from flexaxis.experiments.paper.experiments import (
    BAND,
    HIGH_ORDER,
    STRIDE,
    decibels,
    times,
)
from flexaxis.experiments.paper.model_measures import (
    gradient_power,
    low_energy,
    torque_lines,
    torque_peaks,
)
from flexaxis.experiments.reporting.charts import Chart, Line, Panel

Array = NDArray[np.float64]

STEP = 5  # samples from one drawn estimate to the next


def line(x: ArrayLike, y: ArrayLike, who: str = "", **more: Any) -> Line:
    """Return a line of numbers of any kind."""
    return Line(x=np.asarray(x, float), y=np.asarray(y, float), who=who, **more)


def level(ends: ArrayLike, y: float, who: str = "", **more: Any) -> Line:
    """Return a bound from one end to the other."""
    return line(ends, [y, y], who, role="bound", **more)


def truth(x: ArrayLike, y: ArrayLike) -> Line:
    """Return what is true."""
    return line(x, y, role="truth", label="truth")


def _data(x: ArrayLike, y: ArrayLike) -> Line:
    return line(x, y, role="data", label="torque")


def fig3(e: Evidence) -> Chart:
    """Return the spectrum of the torque in closed loop."""
    omega, amplitude = torque_lines(e.data)
    peaks = list(torque_peaks(e).values())
    found = f"peaks at {', '.join(f'{peak:.0f}' for peak in peaks)} rad/s"
    at = line(peaks, np.interp(peaks, omega, amplitude), kind="points", label=found)
    edge = 2 * np.pi * e.data.excitation.high
    return Chart(
        name="fig3",
        title="Figure 3. Spectrum of the torque in closed loop",
        words="",
        x="frequency [rad/s]",
        panels=[Panel(y="amplitude [N m]", lines=[_data(omega, amplitude), at],
                      y_range=(0.0, 1.15 * float(amplitude.max())))],
        marks=[*((peak, "peaks of the paper"[: 18 * (i == 0)]) for i, peak in enumerate(PEAKS)),
               (edge, "30 Hz")],
        spans=[(0.0, 70.0, f"{low_energy(e):.1f} % of the energy")],
        windows=[("", 0.0, 220.0)],
    )  # fmt: skip


def fig4(e: Evidence) -> Chart:
    """Return the Bode diagrams of the axis, the identified physical model and an ARX model."""
    omega = np.geomspace(20, 400, 600)
    true, *models = bode_responses(e, omega).items()

    def panel(y: str, values: Callable[[Any], Array], *shown: float) -> Panel:
        lines = [truth(omega, values(true[1])), *(line(omega, values(r), w) for w, r in models)]
        return Panel(y=y, lines=lines, y_range=(shown[0], shown[1]))

    return Chart(
        name="fig4",
        title="Figure 4. Bode diagrams: the axis, the identified physical model, an ARX model",
        words="Where there is no torque the black-box model is free to be anything; the physical "
        "one is not.",
        x="frequency [rad/s]",
        panels=[
            panel("gain [dB]", decibels, -12, 38),
            panel("phase [°]", lambda r: np.degrees(np.unwrap(np.angle(r))), -200, 90),
            panel("off by [dB]", lambda r: decibels(r) - decibels(true[1]), -0.3, 0.3),
        ],
        spans=[(20.0, BAND[0], "little torque"), (BAND[1], 400.0, "no torque")],
        windows=[("", 20.0, 400.0)],
        x_log=True,
    )


def bode_responses(e: Evidence, omega: Array) -> dict[str, NDArray[np.complex128]]:
    """Return the frequency responses (M,) of Fig. 4 with python-control, that of the axis first."""
    import control

    period, physical = e.data.scenario.period, e.offline.physical
    arx = e.offline.arx[HIGH_ORDER]

    def sampled(names: tuple[str, ...], theta: Array) -> Any:
        A, B, C = e.data.model.parametrize(names).matrices(theta)
        return control.c2d(control.ss(A, B, C, 0), period, method="zoh")

    systems = {
        "axis": sampled(e.data.names, e.data.parametrization.theta),
        "physical model, identified": sampled(physical.names, physical.theta),
        f"ARX model of order {HIGH_ORDER}": control.tf(arx.b, arx.a, period),
    }
    return {
        name: np.squeeze(control.frequency_response(system, omega).complex)
        for name, system in systems.items()
    }


def fig5(e: Evidence) -> Chart:
    """Return |G_θ|² of the three parameters, and the torque that it weighs."""
    omega, model = np.linspace(1, 220, 1000), e.data.parametrization
    _, slopes = frequency_response(model, model.theta, omega, period=e.data.scenario.period)
    lines, amplitude = torque_lines(e.data)
    curves = [
        line(omega, np.abs(slope) ** 2, name, label=f"{name}: E ψ² = {power:.0f}")
        for (name, power), slope in zip(gradient_power(e).items(), slopes.T, strict=True)
    ]
    return Chart(
        name="fig5",
        title="Figure 5. |G_θ|² of the three parameters",
        words="Where the torque has its energy decides how well a parameter can be seen. 1/J_a "
        "shows around the first resonance only.",
        x="frequency [rad/s]",
        panels=[
            Panel(y="|G_θ|²", lines=curves, y_log=True, y_range=(1e-6, 1e8)),
            Panel(y="torque² [N² m²]", lines=[_data(lines, amplitude**2)]),
        ],
        windows=[("", 0.0, 220.0)],
    )


def estimates(method: str, name: str, title: str, e: Evidence) -> Chart:
    """Return estimates, the same axes for each method."""
    time, runs = e.data.scenario.times[::STEP], e.convergence.runs[method]
    t63, panels = times(e.data, runs, 0.37), []
    for i, parameter in enumerate(e.data.names):
        low, high = np.percentile(runs.theta[:, ::STEP, i], [10, 90], axis=0)
        one = line(time, runs.theta[0, ::STEP, i], parameter, low=low, high=high)
        panels.append(
            Panel(
                y=f"{parameter} / nominal",
                title=f"63 % after {t63[parameter]:.2g} s",
                lines=[truth(time[[0, -1]], [1, 1]), one],
                y_range=(0.88, 1.4),
            )
        )
    words = f"Line: one run; band: 10–90 % of {len(runs.theta)} runs."
    return Chart(name=name, title=title, words=words, x="time [s]", panels=panels)


def diagonal(method: str, name: str, title: str, theory: str, e: Evidence) -> Chart:
    """Return diag P of the first run beside theory, the same axes for each method."""
    time, runs = e.data.scenario.times[STRIDE - 1 :: STRIDE], e.convergence.runs[method]
    steady = by_name(e, np.diag(steady_P(e.convergence.Q, **runs.adaptation)))
    lines = [
        each
        for i, (parameter, theory_) in enumerate(steady.items())
        for each in (
            line(time, runs.P[0, :, i], parameter),
            level(time[[0, -1]], theory_, parameter, label=theory),
        )
    ]
    panel = Panel(y="diagonal of P", lines=lines, y_log=True, y_range=(1.5e-6, 2e-3))
    return Chart(name=name, title=title, words="", x="time [s]", panels=[panel])


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
}  # fmt: skip
"""The figures by name; a file has the name of its figure."""
