"""What is said of an identification: as text, as JSON, and as a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from flexaxis.estimators.offline.frequency import frequency_response
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.findings import Finding, ordered, show, tell, texts_of
from flexaxis.experiments.logs.identification.candidates import Candidate
from flexaxis.experiments.logs.identification.friction import linear_part
from flexaxis.experiments.logs.identification.identify import Identification
from flexaxis.experiments.logs.identification.validate import Validation, liveliest
from flexaxis.experiments.logs.pages.page import LogPage, compared, line, means, panel
from flexaxis.experiments.reporting.charts_old.charts import Chart, Line, Panel
from flexaxis.experiments.reporting.charts_old.tables import Cell, Column, Row, Table, texts

TOLD = 3  # estimates in the sentence that the page begins with
UNITS = {"delay": " [s]"} | dict.fromkeys(("offset", "g_sin", "g_cos"), " [as the torque]")


def findings(found: Identification, tried: Validation | None) -> list[Finding]:
    """Return what was found on both logs, the gravest first."""
    unlike = "" if tried is None else tried.unlike
    other = [Finding("problem", f"on the other log, {unlike}")] if unlike else []
    return ordered([*other, *found.findings])


def content(found: Identification, tried: Validation | None) -> dict[str, Any]:
    """Return it as JSON has it."""
    every = findings(found, tried)
    told: dict[str, Any] = {
        "estimates": {n: {"value": value, "sd": sd} for n, (value, sd) in found.estimates.items()},
        "units": units(found),
        "fit": found.fit,
        "friction": found.friction,
        "compared": [vars(each) for each in found.tried],
        "fits": {
            each.name: {"error": each.error, "taken": each is found.best}
            | dict(zip(found.names, each.fitted.z.tolist(), strict=False))
            for each in found.candidates
        },
        "residual": {
            "std": found.axis.noise,
            "correlation": found.correlation,
            "noise_order": len(found.axis.whitening) - 1,
        },
        "warnings": texts_of(every, "problem"),
        "remarks": texts_of(every, "note", "ok"),
    }
    if tried is not None:
        told["validation"] = {"simulation": tried.simulation, "prediction": tried.prediction}
    return told


def facts(found: Identification, tried: Validation | None) -> list[tuple[str, str]]:
    """Return how far to trust it: names and what they are here."""
    percent = {
        "simulation of held-out pieces from the torque alone": found.fit,
        "simulation of the whole log": found.whole.percent,
    }
    if tried is not None:
        percent["on the other log, fit of a simulation"] = tried.simulation
        percent["on the other log, fit of a prediction over one sample"] = tried.prediction
    told = [(what, f"{value:.1f} %") for what, value in percent.items()]
    told.insert(2, ("correlation of white residuals", f"{found.correlation:.3f}"))
    return [("law of friction", found.friction), ("fit", found.best.name), *told]


def units(found: Identification) -> str:
    """Return in which units the parameters are: a log tells ratios to k_T only."""
    unit, k_T = found.torque_unit, found.axis.model.nominal.get("k_T")
    if unit not in {"", "1", "A", "V"} and k_T in {None, 1.0}:  # it was read in N m, or N
        return "SI"
    one = f"1 {unit}" if unit not in {"", "1"} else "1"
    text = f"SI, if a torque of {one}, as read, is {k_T or 1.0:g} {'N' if found.linear else 'N m'}"
    return f"{text}; give what it is by --fix k_T=VALUE" if k_T == 1 else text


def print_identification(found: Identification, tried: Validation | None) -> None:
    """Print it."""
    show(("parameter", "estimate", "± sd", "[%]"), _rows(found))
    for what, text in [("units", units(found)), *facts(found, tried)]:
        print(f"{what}: {text}")
    tell(findings(found, tried))


def identification_page(
    found: Identification, period: float, tried: Validation | None, title: str, command: str
) -> LogPage:
    """Return the page of it."""
    charts = identification_charts(found, period)
    charts += [] if tried is None else [validation_chart(tried)]
    every, unit = findings(found, tried), found.torque_unit
    system = f"SI, the torque in {unit}" if unit not in {"", "Nm", "N"} else "SI"
    columns = ("parameter", f"estimate [{system}]", "standard deviation", "of the value [%]")
    heads = [Column(name, kind="number" if i else "text") for i, name in enumerate(columns)]
    fits = [(each.name, _of_candidate(each)) for each in found.candidates]
    tables = [
        Table("Estimates", heads, _rows(found)),
        texts("Three fits, one answer", ("fit", "its estimates"), fits),
        texts("How far to trust them", ("what", "here"), facts(found, tried)),
    ]
    told = _finding(found, texts_of(every, "problem"))
    return LogPage(title, command, told, every, charts, tables)


def identification_charts(found: Identification, period: float) -> list[Chart]:
    """Return the motion with its simulation, the friction map, and the frequency response."""
    charts: list[Chart] = [simulation_chart(found, period)]
    charts += [] if found.map is None else map_charts(found)
    return charts + ([] if found.response is None else [bode_chart(found, period)])


def _of_candidate(candidate: Candidate) -> str:
    told = zip(candidate.names, candidate.fitted.z, candidate.deviations, strict=False)
    values = ", ".join(f"{_named(name)} {value:.4g} ± {sd:.1g}" for name, value, sd in told)
    return f"{values}; error of a simulation of held-out pieces {candidate.error:.4g}"


def _finding(found: Identification, against: Sequence[str]) -> Finding:
    """Return what was identified, how well, and how many doubts there are, in a sentence."""
    each = zip(found.names, found.theta, found.deviations, strict=True)
    sure = sorted((sd / abs(v), f"{name} = {v:.4g} ± {sd:.1g}") for name, v, sd in each if v)
    told = ", ".join(text for _, text in sure[:TOLD])
    more = f" and {len(sure) - TOLD} more" if len(sure) > TOLD else ""
    text = (
        f"The model simulates {found.fit:.1f} % of what it was not fitted to from the torque alone"
        + (f"; surest: {told}{more}." if told else ".")
    )
    if against:
        count = "One thing speaks" if len(against) == 1 else f"{len(against)} things speak"
        text = f"{text} {count} against it, first: {against[0].rstrip('.')}."
    return Finding("problem" if against else "ok", text)


def _named(name: str) -> str:
    return f"{name}{UNITS.get(name, '')}"


def _rows(found: Identification) -> list[Row]:
    """Return the lines of estimates; of what stands at a bound, or was told, no deviation."""
    rows = []
    for name, (value, sd) in found.estimates.items():
        share = 100 * sd / abs(value) if abs(value) > sd else 0.0
        numbers = (Cell(f"{x:.2g}" if x else "–", x or "") for x in (sd, share))
        rows.append(Row([Cell(_named(name), name), Cell(f"{value:.5g}", value), *numbers]))
    return rows


def bode_chart(found: Identification, period: float) -> Chart:
    """Return the measured frequency response and that of the identified model."""
    assert found.response is not None
    model, seen = linear_part(found.axis.model), found.response
    signal = SIGNALS[found.best.setup.log.output]
    chosen = signal.predicted(model, period).parametrize(model.parameters)
    # resonances are narrower than steps of lines
    fine = np.geomspace(seen.omega.min(), seen.omega.max(), 800)
    gain = frequency_response(chosen, chosen.theta, fine, period=period)[0]
    gain = gain * np.exp(-1j * fine * found.axis.delay)

    def both(of: Callable[[Any], Any]) -> list[Line]:
        return [
            line(seen.omega / (2 * np.pi), of(seen.gain), kind="points"),
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
