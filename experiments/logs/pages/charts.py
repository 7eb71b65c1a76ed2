"""Charts of a log, of what was identified from it, and of an axis on another one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.identification.friction import linear_part
from flexaxis.experiments.logs.identification.identify import Identification
from flexaxis.experiments.logs.identification.validate import Validation, liveliest
from flexaxis.experiments.logs.pages.page import (
    compared,
    gaps,
    line,
    means,
    panel,
    points,
    thinned,
)
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.sim.record import Record

Array = NDArray[np.float64]


def log_chart(record: Record) -> Chart:
    """Return torque and motion over time."""
    motion = np.asarray(getattr(record, output_of(record)))
    return Chart(
        title="The log",
        words=f"Shaded: missing, or before the end of the burn-in.{thinned(record.time)}",
        x="time [s]",
        panels=[
            panel("torque [as logged]", line(record.time, record.torque)),
            panel("speed [rad/s]", line(record.time, motion)),
        ],
        spans=gaps(record.time, usable(record)),
    )


def spectrum_chart(record: Record) -> Chart:
    """Return the spectrum of the torque."""
    seen = spectra(record.torque, record.torque, record.period)
    density = line(seen.frequency[1:], np.sqrt(seen.torque[1:]), log=True)
    return Chart(
        title="What the torque excites",
        words="Amplitude spectral density of the torque, over segments of 4 s.",
        x="frequency [Hz]",
        panels=[panel("torque [as logged, per √Hz]", density, y_log=True)],
        x_log=True,
    )


def bode_chart(found: Identification, period: float) -> Chart:
    """Return the measured frequency response and that of the identified model."""
    assert found.response is not None
    model, seen = linear_part(found.axis.model), found.response
    if found.best.setup.log.output == "increment":
        model = increment(model, period)
    chosen = model.parametrize(model.parameters)
    # resonances are narrower than steps of lines
    fine = np.geomspace(seen.omega.min(), seen.omega.max(), 800)
    gain = frequency_response(chosen, chosen.theta, fine, period=period)[0]
    gain = gain * np.exp(-1j * fine * found.axis.delay)

    def both(of: Callable[[Any], Any]) -> list[Line]:
        return [
            points(seen.omega / (2 * np.pi), of(seen.gain)),
            line(fine / (2 * np.pi), of(gain), "identified model"),
        ]

    words = (
        "Points: what the log shows without a model. Where the line leaves them, the model does "
        "not describe the axis."
    )
    if found.axis.model.laws:
        words += (
            " The dry friction that was found was taken off the torque before, as a level that "
            "changes sign with the speed: at low frequencies that is rough."
        )
    return Chart(
        title="Frequency response",
        words=words,
        x="frequency [Hz]",
        panels=[
            panel("|torque to speed| [rad/s per unit]", *both(np.abs), y_log=True),
            Panel(y="phase [°]", lines=both(lambda g: np.degrees(np.angle(g)))),
        ],
        x_log=True,
    )


def simulation_chart(found: Identification, period: float) -> Chart:
    """Return the measured motion with its simulation from the torque alone over it, and errors."""
    log = found.best.setup.log
    simulated = log.y - found.residual
    time = period * np.arange(float(len(log.y)))
    piece = liveliest(time, log.y, simulated, log.ok)
    return Chart(
        title="Measured and simulated",
        words="The liveliest piece of the log, simulated from the torque alone.",
        x="time [s]",
        panels=compared(time, log.y, {"simulation": simulated}, piece),
    )


def validation_chart(found: Validation) -> Chart:
    """Return the liveliest piece of a log with simulation and prediction over it, and errors."""
    piece = liveliest(found.time, found.measured, found.predicted, found.ok)
    sides = {
        f"simulation from the torque alone, fit {found.simulation:.1f} %": found.simulated,
        f"prediction over one sample, fit {found.prediction:.1f} %": found.predicted,
    }
    return Chart(
        title="On another log",
        words="The liveliest piece of the log that was not used. The simulation is given the "
        "torque alone, the prediction the motion up to the sample before as well.",
        x="time [s]",
        panels=compared(found.time, found.measured, sides, piece),
    )


def map_charts(found: Identification) -> list[Chart]:
    """Return what of the torque is left without inertia: over the speed, and over the angle."""
    assert found.map is not None
    motion, value = found.map.motion, found.map.value
    law = value["viscous"] * motion.columns["viscous"] + value["dry"] * motion.columns["dry"]
    speed, angle, law, rest = (
        x[motion.used] for x in (motion.speed, motion.angle, law, found.map.rest)
    )
    friction = means(speed, rest + law), means(speed, law, "f_c sgn v + f_m v", band=False)
    words = "Points: means of the log as a rigid axis, and 10 … 90 % of it"
    hump = (
        "; the line is f_c sgn v + f_m v. Where points leave it near standstill friction has a "
        "hump, and where they differ by direction it has two sides."
    )
    left, across = "torque left [as logged]", "speed [rad/s]"
    turns, repeats = "angle of the load [rad]", ". What repeats itself is gravity or ripple."
    return [
        Chart(title=title, words=f"{words}{more}", x=x, panels=[panel(y, *lines)])
        for title, more, x, y, lines in (
            ("Friction over the speed", hump, across, f"{left}, with friction", friction),
            ("What is left over the angle", repeats, turns, left, [means(angle, rest)]),
            ("What is left over the speed", ".", across, left, [means(speed, rest)]),
        )
    ]
