"""Charts of a log, of what was identified from it, and of an axis on another one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.identification.friction import linear_part
from flexaxis.experiments.logs.identification.identify import Identification
from flexaxis.experiments.logs.identification.validate import Validation, liveliest
from flexaxis.experiments.logs.identification.visibility import Seen
from flexaxis.experiments.logs.pages.page import (
    LOG,
    compared,
    gaps,
    line,
    means,
    panel,
    points,
    thinned,
)
from flexaxis.experiments.logs.spectra import spectra
from flexaxis.experiments.reporting.charts import Cells, Chart, Heat, Line, Panel
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


def visibility_map(seen: Mapping[str, Seen]) -> Heat:
    """Return how well the excitation can tell each parameter, eq. (28): alone, and with all free.

    Those of laws are not in it: a spectrum does not show them.
    """
    told = {
        name: (one.together, one.alone)
        for name, one in reversed([*seen.items()])
        if one.together is not None and one.alone is not None
    }
    percent = np.clip(100 * np.array([*told.values()], float).reshape(-1, 2), 1e-6, 1e6)
    return Heat(
        title="What the excitation can see",
        words="Standard deviation in per cent of the value, from the spectrum of the torque, "
        "about, by a linear model; what is above 50 % is not seen.",
        x="unknown",
        y="parameter",
        xs=("all parameters", "this one alone"),
        ys=tuple(told),
        panels=[Cells(values=percent)],
        unit="% of the value",
        log=True,
    )


def bode_chart(found: Identification, period: float) -> Chart:
    """Return the measured frequency response and that of the identified model."""
    assert found.response is not None
    model = linear_part(found.axis.model)
    chosen = (
        increment(model, period) if found.best.setup.log.output == "increment" else model
    ).parametrize(model.parameters)
    seen = found.response.omega
    fine = np.geomspace(seen.min(), seen.max(), 800)  # resonances are narrower than steps of lines
    gain = frequency_response(chosen, chosen.theta, fine, period=period)[0]
    gain = gain * np.exp(-1j * fine * found.axis.delay)
    sides = {"log": (seen, found.response.gain), "identified model": (fine, gain)}
    shown = {name: (omega / (2 * np.pi), values) for name, (omega, values) in sides.items()}
    return Chart(
        title="Frequency response",
        words=_of_response(bool(found.axis.model.laws)),
        x="frequency [Hz]",
        panels=[
            panel(
                "|torque to speed| [rad/s per unit]",
                *(_response(name, f, np.abs(g)) for name, (f, g) in shown.items()),
                y_log=True,
            ),
            Panel(
                y="phase [°]",
                lines=[_response(n, f, np.degrees(np.angle(g))) for n, (f, g) in shown.items()],
            ),
        ],
        x_log=True,
    )


def _response(who: str, frequency: Array, values: Array) -> Line:
    return (points if who == LOG else line)(frequency, values, who)


def _of_response(dry: bool) -> str:
    text = (
        "Points: what the log shows without a model. Where the line leaves them, the model does "
        "not describe the axis."
    )
    if dry:
        text += (
            " The dry friction that was found was taken off the torque before, as a level that "
            "changes sign with the speed. That is rough where the axis hardly moves: points of "
            "low frequencies rest on it, and say less of the linear part than the others."
        )
    return text


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
    mapped, motion = found.map, found.map.motion
    moved, value = motion.used, mapped.value
    law = value["viscous"] * motion.columns["viscous"] + value["dry"] * motion.columns["dry"]
    words = "Points: means of the log as a rigid axis, and 10 … 90 % of it"
    speed, angle, law, rest = (x[moved] for x in (motion.speed, motion.angle, law, mapped.rest))
    line_of = means(speed, law, "f_c sgn v + f_m v", band=False)
    shown = (
        (
            "Friction over the speed",
            f"{words}; the line is f_c sgn v + f_m v. Where points leave it near standstill "
            "friction has a hump, and where they differ by direction it has two sides.",
            "speed [rad/s]",
            "torque without inertia [as logged]",
            (means(speed, rest + law), line_of),
        ),
        (
            "What is left over the angle",
            f"{words}. What repeats itself here is gravity, ripple or cogging.",
            "angle of the load [rad]",
            "torque left [as logged]",
            (means(angle, rest),),
        ),
        (
            "What is left over the speed",
            f"{words}.",
            "speed [rad/s]",
            "torque left [as logged]",
            (means(speed, rest),),
        ),
    )
    return [
        Chart(title=title, words=told, x=x, panels=[panel(y, *lines)])
        for title, told, x, y, lines in shown
    ]
