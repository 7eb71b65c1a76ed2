"""Charts of a log, of what was identified from it, and of an axis on another one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from flexaxis.estimators.models.model import increment
from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.experiments.logs.axis_file import output_of, usable
from flexaxis.experiments.logs.doubts.sketch import LOG, line, panel, points
from flexaxis.experiments.logs.friction import linear_part
from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.validate import Validation, liveliest
from flexaxis.experiments.logs.visibility import Seen
from flexaxis.experiments.reporting.charts import Cells, Chart, Heat, Line, Panel
from flexaxis.experiments.reporting.thinning import extremes
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

BINS, FEW = 60, 5  # bins of a map, and samples that one holds at the least
GAPS = 200  # that are shaded: more are a pattern, and seen as one


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


def thinned(time: Array) -> str:
    """Return what there is to know of a curve that is thinned, empty for one that is not."""
    kept = len(extremes(time, np.zeros(len(time))))
    return "" if kept == len(time) else (
        f" Of {len(time)} samples the least and the greatest of each column of the screen are "
        "drawn, so that no spike is lost."
    )  # fmt: skip


def spectrum_chart(record: Record) -> Chart:
    """Return the spectrum of the torque."""
    rate = 1 / record.period
    segment = min(len(record.torque) // 2, round(4 * rate))
    frequency, power = welch(record.torque, fs=rate, nperseg=segment)
    density = line(frequency[1:], np.sqrt(power[1:]), log=True)
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
        increment(model, period) if found.best.attempt.log.output == "increment" else model
    ).parametrize(model.parameters)
    seen = found.response.omega
    fine = np.geomspace(seen.min(), seen.max(), 800)  # resonances are narrower than steps of lines
    gain = frequency_response(chosen, chosen.theta, fine, period=period)[0]
    gain = gain * np.exp(-1j * fine * found.delay)
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
    log = found.best.attempt.log
    simulated = log.y - found.residual
    time = period * np.arange(float(len(log.y)))
    piece = liveliest(time, log.y, simulated, log.ok)
    shown = Line(x=time[piece], y=log.y[piece], role="truth", label="log")
    return Chart(
        title="Measured and simulated",
        words="The liveliest piece of the log, simulated from the torque alone.",
        x="time [s]",
        panels=[
            panel("speed [rad/s]", shown, line(time[piece], simulated[piece], "simulation")),
            panel("error [rad/s]", line(time[piece], (log.y - simulated)[piece], "simulation")),
        ],
    )


def map_charts(found: Identification) -> list[Chart]:
    """Return what of the torque is left without inertia: over the speed, and over the angle."""
    assert found.map is not None
    mapped, motion = found.map, found.map.motion
    moved, value = motion.used, mapped.value
    law = value["viscous"] * motion.columns["viscous"] + value["dry"] * motion.columns["dry"]
    words = "Points: means of the log as a rigid axis, and 10 … 90 % of it"
    return [
        Chart(
            title="Friction over the speed",
            words=f"{words}; the line is f_c sgn v + f_m v. Where points leave it near standstill "
            "friction has a hump, and where they differ by direction it has two sides.",
            x="speed [rad/s]",
            panels=[
                panel(
                    "torque without inertia [as logged]",
                    _means(motion.speed[moved], (mapped.rest + law)[moved], "log"),
                    _means(motion.speed[moved], law[moved], "f_c sgn v + f_m v", band=False),
                )
            ],
        ),
        Chart(
            title="What is left over the angle",
            words=f"{words}. What repeats itself here is gravity, ripple or cogging.",
            x="angle of the load [rad]",
            panels=[
                panel("torque left [as logged]", _means(motion.angle[moved], mapped.rest[moved],
                                                        "log"))
            ],
        ),
        Chart(
            title="What is left over the speed",
            words=f"{words}.",
            x="speed [rad/s]",
            panels=[
                panel("torque left [as logged]", _means(motion.speed[moved], mapped.rest[moved],
                                                        "log"))
            ],
        ),
    ]  # fmt: skip


def _means(x: Array, y: Array, who: str, *, band: bool = True) -> Line:
    """Return means of y in `BINS` bins of x that hold as much each, with 10 … 90 % of it."""
    edges = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0))
    held = [place == k for k in range(len(edges) - 1) if np.sum(place == k) > FEW]
    across, mean = (np.array([values[k].mean() for k in held]) for values in (x, y))
    if not band:
        return Line(who=who, x=across, y=mean)
    low, high = np.array([np.percentile(y[k], (10, 90)) for k in held]).reshape(-1, 2).T
    return Line(who=who, kind="points", x=across, y=mean, low=low, high=high)


def validation_chart(found: Validation) -> Chart:
    """Return the liveliest piece of a log with simulation and prediction over it, and errors."""
    piece = liveliest(found.time, found.measured, found.predicted, found.ok)
    time, measured = found.time[piece], found.measured[piece]
    sides = {
        f"simulation from the torque alone, fit {found.simulation:.1f} %": found.simulated[piece],
        f"prediction over one sample, fit {found.prediction:.1f} %": found.predicted[piece],
    }
    log = Line(x=time, y=measured, role="truth", label="log")
    return Chart(
        title="On another log",
        words="The liveliest piece of the log that was not used. The simulation is given the "
        "torque alone, the prediction the motion up to the sample before as well.",
        x="time [s]",
        panels=[
            panel(
                "speed [rad/s]", log, *(line(time, values, who) for who, values in sides.items())
            ),
            panel(
                "error [rad/s]",
                *(line(time, measured - values, who) for who, values in sides.items()),
            ),
        ],
    )


def gaps(time: Array, ok: NDArray[np.bool_]) -> list[tuple[float, float, str]]:
    """Return what is to be shaded: where samples do not count."""
    edges = np.flatnonzero(np.diff(np.r_[1, ok, 1]))
    pairs = list(zip(edges[::2], edges[1::2], strict=True))[:GAPS]
    return [(float(time[begin]), float(time[end - 1]), "") for begin, end in pairs]
