"""Figures 3 to 9 of the paper: each is a function of the evidence, which returns a Figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
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
from flexaxis.experiments.reporting.figures import Series, curves

Array = NDArray[np.float64]

STEP = 5  # samples from one drawn estimate to the next


def _level(ends: ArrayLike, y: float, **more: Any) -> Series:
    """Return a bound from one end to the other."""
    return Series(x=ends, y=[y, y], role="bound", **more)


def fig3(e: Evidence) -> Figure:
    """Draw the spectrum of the torque in closed loop."""
    omega, amplitude = torque_lines(e.data)
    peaks = list(torque_peaks(e).values())
    label = f"peaks at {', '.join(f'{peak:.0f}' for peak in peaks)} rad/s"
    at = Series(x=peaks, y=np.interp(peaks, omega, amplitude), kind="points", label=label)
    edge = 2 * np.pi * e.data.excitation.high
    y = "amplitude [N m]"
    return curves(
        {y: [Series(x=omega, y=amplitude, role="data", label="torque"), at]},
        x="frequency [rad/s]",
        limits={y: (0.0, 1.15 * float(amplitude.max())), "frequency [rad/s]": (0.0, 220.0)},
        marks=[*((peak, "peak of the paper") for peak in PEAKS), (edge, "30 Hz")],
        spans=[(0.0, 70.0, f"{low_energy(e):.1f} % of the energy")],
    )


def fig4(e: Evidence) -> Figure:
    """Draw the Bode diagrams of the axis, the identified physical model and an ARX model."""
    omega = np.geomspace(20, 400, 600)
    true, *models = bode_responses(e, omega).items()
    panels: dict[str, Callable[[Any], Array]] = {
        "gain [dB]": decibels,
        "phase [°]": lambda r: np.degrees(np.unwrap(np.angle(r))),
        "off by [dB]": lambda r: decibels(r) - decibels(true[1]),
    }
    return curves(
        {
            label: [Series(x=omega, y=values(true[1]), role="truth")]
            + [Series(x=omega, y=values(r), estimator=name) for name, r in models]
            for label, values in panels.items()
        },
        x="frequency [rad/s]",
        logs=["frequency [rad/s]"],
        limits={
            "frequency [rad/s]": (20.0, 400.0),
            "gain [dB]": (-12, 38),
            "phase [°]": (-200, 90),
            "off by [dB]": (-0.3, 0.3),
        },
        spans=[(20.0, BAND[0], "little torque"), (BAND[1], 400.0, "no torque")],
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


def fig5(e: Evidence) -> Figure:
    """Draw |G_θ|² of the three parameters, and the torque that it weighs."""
    omega, model = np.linspace(1, 220, 1000), e.data.parametrization
    _, slopes = frequency_response(model, model.theta, omega, period=e.data.scenario.period)
    lines, amplitude = torque_lines(e.data)
    powers = zip(gradient_power(e).items(), slopes.T, strict=True)
    gains = [
        Series(x=omega, y=np.abs(slope) ** 2, estimator=name, label=f"{name}: E ψ² = {power:.0f}")
        for (name, power), slope in powers
    ]
    torque = Series(x=lines, y=amplitude**2, role="data", label="torque")
    return curves(
        {"|G_θ|²": gains, "torque² [N² m²]": [torque]},
        x="frequency [rad/s]",
        logs=["|G_θ|²"],
        limits={"|G_θ|²": (1e-6, 1e8), "frequency [rad/s]": (0.0, 220.0)},
    )


def estimates(method: str, e: Evidence) -> Figure:
    """Draw estimates, on the same axes for each method."""
    time, runs = e.data.scenario.times[::STEP], e.convergence.runs[method]
    t63, panels = times(e.data, runs, 0.37), {}
    for i, parameter in enumerate(e.data.names):
        low, high = np.percentile(runs.theta[:, ::STEP, i], [10, 90], axis=0)
        one, label = runs.theta[0, ::STEP, i], f"63 % after {t63[parameter]:.2g} s"
        panels[f"{parameter} / nominal"] = [
            Series(x=time[[0, -1]], y=[1, 1], role="truth"),
            Series(x=time, y=one, low=low, high=high, estimator=parameter, label=label),
        ]
    return curves(panels, x="time [s]", limits=dict.fromkeys(panels, (0.88, 1.4)))


def diagonal(method: str, theory: str, e: Evidence) -> Figure:
    """Draw diag P of the first run beside theory, on the same axes for each method."""
    time, runs = e.data.scenario.times[STRIDE - 1 :: STRIDE], e.convergence.runs[method]
    steady = by_name(e, np.diag(steady_P(e.convergence.Q, **runs.adaptation)))
    series = []
    for i, (parameter, value) in enumerate(steady.items()):
        series.append(Series(x=time, y=runs.P[0, :, i], estimator=parameter))
        series.append(_level(time[[0, -1]], value, estimator=parameter, label=theory))
    y = "diagonal of P"
    return curves({y: series}, x="time [s]", logs=[y], limits={y: (1.5e-6, 2e-3)})


FIGURES: Mapping[str, Callable[..., Figure]] = {
    "fig3": fig3,
    "fig4": fig4,
    "fig5": fig5,
    "fig6": partial(estimates, "forgetting"),
    "fig7": partial(diagonal, "forgetting", "(1−λ) Q⁻¹, eq. (29)"),
    "fig8": partial(estimates, "modification"),
    "fig9": partial(diagonal, "modification", "P Q P = Δ, eq. (30)"),
}
"""The figures by name; a file has the name of its figure."""

CAPTIONS: Mapping[str, tuple[str, str]] = {
    "fig3": ("Figure 3. Spectrum of the torque in closed loop", ""),
    "fig4": (
        "Figure 4. Bode diagrams: the axis, the identified physical model, an ARX model",
        "Where there is no torque the black-box model is free to be anything; the physical one is "
        "not.",
    ),
    "fig5": (
        "Figure 5. |G_θ|² of the three parameters",
        "Where the torque has its energy decides how well a parameter can be seen. 1/J_a shows "
        "around the first resonance only.",
    ),
    "fig6": ("Figure 6. Estimates with forgetting", "Line: one run; band: 10–90 % of the runs."),
    "fig7": ("Figure 7. Diagonal of P with forgetting, first run", ""),
    "fig8": (
        "Figure 8. Estimates with covariance modification",
        "Line: one run; band: 10–90 % of the runs.",
    ),
    "fig9": ("Figure 9. Diagonal of P with covariance modification, first run", ""),
}
"""Title and words of each figure."""
