"""What is said of an identification: as text, as JSON, and as a table."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flexaxis.experiments.logs.findings import MARKS, Finding, ordered, texts_of
from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.validate import Validation

OTHERS = ("delay", "offset")
UNITS = {"delay": " [s]", "offset": " [as the torque]"}  # of what is no parameter of a model
UNITS |= dict.fromkeys(("g_sin", "g_cos"), UNITS["offset"])


def rows(found: Identification) -> list[tuple[str, float, float]]:
    """Return name, estimate, and its standard deviation."""
    parameters = zip(found.names, found.theta.tolist(), found.deviations.tolist(), strict=True)
    return [
        *parameters,
        *((n, getattr(found, n), getattr(found, f"{n}_deviation")) for n in OTHERS),
    ]


def findings(found: Identification, tried: Validation | None) -> list[Finding]:
    """Return what was found on both logs, the gravest first."""
    unlike = "" if tried is None else tried.unlike
    other = [Finding("problem", f"on the other log, {unlike}")] if unlike else []
    return ordered([*other, *found.findings])


def content(found: Identification, tried: Validation | None) -> dict[str, Any]:
    """Return it as JSON has it."""
    every = findings(found, tried)
    told: dict[str, Any] = {
        "estimates": {name: {"value": value, "sd": sd} for name, value, sd in rows(found)},
        "fit": found.fit,
        "friction": found.friction,
        "compared": [vars(each) for each in found.tried],
        "fits": {
            way.name: {"error": way.error, "taken": way is found.best}
            | dict(zip(found.names, way.fitted.z.tolist(), strict=False))
            for way in found.ways
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
    facts = [
        ("law of friction", found.friction),
        ("fit", found.best.name),
        ("simulation of held-out pieces from the torque alone", f"{found.fit:.1f} %"),
        ("simulation of the whole log", f"{found.whole.percent:.1f} %"),
        ("correlation of white residuals", f"{found.correlation:.3f}"),
    ]
    if tried is not None:
        facts += [
            ("on the other log, fit of a simulation", f"{tried.simulation:.1f} %"),
            ("on the other log, fit of a prediction over one sample", f"{tried.prediction:.1f} %"),
        ]
    return facts


def print_identification(found: Identification, tried: Validation | None) -> None:
    """Print it."""
    table = Table("parameter", "estimate", "± sd", "[%]", box=None, pad_edge=False)
    for name, value, sd in rows(found):
        share = f"{100 * sd / abs(value):.2g}" if abs(value) > sd else ""
        deviation = f"{sd:.2g}" if sd else ""  # none of what stands at a bound, or was told
        table.add_row(escape(name + UNITS.get(name, "")), f"{value:.5g}", deviation, share)
    console = Console()
    console.print(table)
    for name, text in facts(found, tried):
        print(f"{name}: {text}")
    for each in findings(found, tried):
        style = "yellow" if each.kind == "problem" else None
        console.print(f"{MARKS[each.kind]} {each.text}", style=style, markup=False, soft_wrap=True)
