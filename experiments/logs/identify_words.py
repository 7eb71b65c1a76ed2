"""What is said of an identification: as text, and as JSON."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from flexaxis.experiments.logs.identify import Identification
from flexaxis.experiments.logs.validate import Validation

Line = tuple[str, float, float, float, float]
UNITS = {"delay": " [s]", "offset": " [as the torque]"}  # of what is no parameter of a model


def rows(found: Identification) -> list[Line]:
    """Return name, estimate, and its standard deviations: the larger, of noise, over pieces."""
    columns = (found.theta, found.deviations, found.noise_deviations, found.spread)
    values = zip(found.names, *(column.tolist() for column in columns), strict=True)
    more = [
        ("delay", found.delay, found.delay_deviation),
        ("offset", found.offset, found.offset_deviation),
    ]
    return [*values, *((name, value, sd, sd, sd) for name, value, sd in more)]


def warnings(found: Identification, tried: Validation | None) -> list[str]:
    """Return what speaks against it, on both logs."""
    return [*found.warnings, *(() if tried is None else tried.warnings)]


def content(found: Identification, tried: Validation | None) -> dict[str, Any]:
    """Return it as JSON has it."""
    told: dict[str, Any] = {
        "estimates": {
            name: {"value": v, "sd": sd, "sd_noise": noise, "sd_pieces": pieces}
            for name, v, sd, noise, pieces in rows(found)
        },
        "fit": found.fit,
        "friction": found.friction,
        "compared": [
            {"law": t.name, "against": t.against, "taken": t.taken} | vars(t.comparison)
            for t in found.tried
        ],
        "condition": found.verdict.condition,
        "identifiability": found.verdict.weakest,
        "residual": {
            "std": found.axis.noise,
            "correlation": found.verdict.correlation,
            "noise_order": len(found.axis.whitening) - 1,
        },
        "warnings": warnings(found, tried),
        "remarks": list(found.remarks),
    }
    if tried is not None:
        told["validation"] = {"simulation": tried.simulation, "prediction": tried.prediction}
    return told


def facts(found: Identification, tried: Validation | None) -> list[tuple[str, str]]:
    """Return how far to trust it: names and what they are here."""
    facts = [
        ("law of friction", found.friction),
        ("fit of a simulation from the torque alone", f"{found.fit:.1f} %"),
        ("order of the noise model", str(len(found.axis.whitening) - 1)),
        ("correlation of white residuals", f"{found.verdict.correlation:.3f}"),
        ("condition", f"{found.verdict.condition:.3g}"),
        ("identifiability", found.verdict.weakest),
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
    for name, value, sd, *_ in rows(found):
        share = f"{100 * sd / abs(value):.2g}" if abs(value) > sd else ""
        deviation = f"{sd:.2g}" if sd else ""  # none of what stands at a bound, or was told
        table.add_row(escape(name + UNITS.get(name, "")), f"{value:.5g}", deviation, share)
    console = Console()
    console.print(table)
    for name, text in facts(found, tried):
        print(f"{name}: {text}")
    for text in found.remarks:
        print(f"- {text}")
    for text in warnings(found, tried):
        console.print(f"! {text}", style="yellow", markup=False, soft_wrap=True)
