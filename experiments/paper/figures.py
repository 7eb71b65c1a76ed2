"""Draw Figures 3 to 9 of Östring and Gunnarsson's paper with data from MuJoCo."""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.paper.claims import PEAKS
from flexaxis.experiments.paper.evidence import STRIDE
from flexaxis.experiments.paper.measures import PHYSICAL, Measures, decibels
from flexaxis.experiments.reporting.figures import Series, curves

FREQUENCY, TIME = "frequency [rad/s]", "time [s]"


def named(names: Iterable[str], x: Any, rows: Any, **options: Any) -> list[Series]:
    """Return one labelled curve for each row of y-values; all curves share the x-values `x`."""
    return [
        Series(x=x, y=y, estimator=name, **options) for name, y in zip(names, rows, strict=True)
    ]


def fig3(e: Measures) -> Figure:
    """Draw the amplitude spectrum of the closed-loop torque."""
    omega, amplitude = e.torque_lines()
    return curves(
        {"amplitude [N m]": [Series(x=omega, y=amplitude, role="data", label="torque")]},
        x=FREQUENCY,
        limits={"amplitude [N m]": (0, 0.2)},
        marks=[(peak, "peak in the paper") for peak in PEAKS],
        spans=[(0.0, 70.0, f"{e.low_energy():.1f} % of the energy")],
    )


def fig4(e: Measures) -> Figure:
    """Draw the Bode diagrams of the axis, the identified physical model and an ARX model."""
    omega = np.geomspace(20, 400, 600)
    result, names = e.responses(omega), (PHYSICAL, "ARX, order 40")
    rows = np.array([result[name] for name in ("axis", *names)])
    phases = np.degrees(np.unwrap(np.angle(rows)))
    panels = {
        label: [Series(x=omega, y=true, role="truth", label="axis"), *named(names, omega, models)]
        for label, (true, *models) in (("gain [dB]", decibels(rows)), ("phase [°]", phases))
    }
    limits = {"gain [dB]": (-12, 38), "phase [°]": (-300, 120)}
    return curves(panels, x=FREQUENCY, logs=[FREQUENCY], limits=limits)


def fig5(e: Measures) -> Figure:
    """Draw the squared gain |G_θ|² from the torque to the gradient of each parameter."""
    omega = np.linspace(1, 220, 1000)
    _, slopes = frequency_response(e.model, e.theta, omega, period=e.period)
    gains = named(e.names, omega, np.abs(slopes.T) ** 2)
    limits = {"|G_θ|²": (1e-6, 1e8)}
    return curves({"|G_θ|²": gains}, x=FREQUENCY, logs=["|G_θ|²"], limits=limits)


def estimates(method: str, e: Measures) -> Figure:
    """Draw the parameter estimates over time, with the same axis limits for all methods."""
    time, theta = e.scenario.times[::STRIDE], e.runs(method).theta[:, ::STRIDE]
    panels = {}
    for name, columns in zip(e.names, theta.T, strict=True):
        low, high = np.percentile(columns, [10, 90], axis=1)
        panels[f"{name} / nominal"] = [
            Series(x=time, y=columns[:, 0], low=low, high=high, estimator=name),
            Series(x=time[[0, -1]], y=[1, 1], role="truth"),
        ]
    return curves(panels, x=TIME, limits=dict.fromkeys(panels, (0.88, 1.4)))


def diagonal(method: str, e: Measures) -> Figure:
    """Draw the diagonal of the matrix P in the first run, together with its theoretical values."""
    time, y = e.scenario.times[STRIDE - 1 :: STRIDE], "diagonal of P"
    levels = np.outer(np.diag(e.steady_P(method)), [1, 1])
    theory = named(e.names, time[[0, -1]], levels, role="bound", label="_")
    series = [*named(e.names, time, e.runs(method).P[0].T), *theory]
    return curves({y: series}, x=TIME, logs=[y], limits={y: (1.5e-6, 2e-2)})


FIGURES: Mapping[str, tuple[Any, str, str]] = {
    "fig3": (fig3, "Figure 3. Spectrum of the closed-loop torque", ""),
    "fig4": (
        fig4,
        "Figure 4. Bode diagrams of the axis, the identified physical model and an ARX model",
        "At frequencies without torque, the data do not determine the ARX model. The structure of "
        "the physical model allows extrapolation to frequencies without torque.",
    ),
    "fig5": (
        fig5,
        "Figure 5. |G_θ|² of the three parameters",
        "The accuracy of an estimate depends on the frequencies at which the torque has energy. "
        "The parameter 1/J_a affects the speed only around the first resonance.",
    ),
    "fig6": (
        partial(estimates, "forgetting"),
        "Figure 6. Estimates with forgetting",
        "The line shows one run, and the band shows the 10th to 90th percentiles of all runs.",
    ),
    "fig7": (
        partial(diagonal, "forgetting"),
        "Figure 7. Diagonal of P with forgetting, first run",
        "The dotted lines show the theoretical values (1−λ) Q⁻¹ of equation (29).",
    ),
    "fig8": (
        partial(estimates, "modification"),
        "Figure 8. Estimates with covariance modification",
        "The line shows one run, and the band shows the 10th to 90th percentiles of all runs.",
    ),
    "fig9": (
        partial(diagonal, "modification"),
        "Figure 9. Diagonal of P with covariance modification, first run",
        "The dotted lines show the theoretical values, which solve equation (30), P Q P = Δ.",
    ),
}
"""Function, title and caption of each figure, keyed by the name of the image file."""
