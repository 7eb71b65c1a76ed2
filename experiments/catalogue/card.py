"""The reference card of a scenario: what it tests, what happens in it, and what can be scored."""

from __future__ import annotations

from typing import Any

from flexaxis.experiments.scoring.theory import bounded
from flexaxis.experiments.scoring.theta import physical
from flexaxis.sim.excitation import Excitation, Multisine
from flexaxis.sim.faults import Fault
from flexaxis.sim.scenario import Scenario

GROUPS = {
    "nominal": "nothing happens",
    "steps": "one parameter jumps",
    "wear": "one parameter changes over seconds",
    "intermittent": "one parameter jumps to and fro",
    "several": "more than one change",
    "excitation": "other motion than the full multisine",
    "sensors": "what lies between axis and log",
    "mismatch": "an axis that no model describes",
    "nuisance": "changes that are no faults",
}
"""The groups of the catalogue, in the order in which it is read."""


def reference_card(scenario: Scenario) -> dict[str, str]:
    """Return what to know of a scenario before reading its results, by heading."""
    names = ", ".join(bounded(scenario, scenario.identify))
    return {
        "tests": scenario.card,
        "group": scenario.group or "none",
        "expected": scenario.difficulty or "unknown",
        "axis": scenario.preset + (f", start {scenario.start:g}" if scenario.start != 1 else ""),
        "happens": happens(scenario),
        "excitation": excitation_in_words(scenario.excitation),
        "unmodelled": beyond(scenario) or "nothing",
        "read": readings(scenario),
        "estimated": ", ".join(scenario.identify),
        "bound": f"defined for {names}" if names else "none, so no score: see lag, std and alarms",
    }


def happens(scenario: Scenario) -> str:
    """Return the faults and other changes of a scenario in a line."""
    words = [change_in_words(fault) for fault in scenario.fault]
    words += [f"no fault: {change_in_words(change)}" for change in scenario.nuisance or ()]
    estimated = {physical(name)[0] for name in scenario.identify}
    if scenario.fault and not estimated & {fault.parameter for fault in scenario.fault}:
        words.append("not estimated")
    return "; ".join(words) or "no fault"


def in_a_line(scenario: Scenario) -> str:
    """Return what happens in a scenario, and what about it is not as in most."""
    card = reference_card(scenario)
    usual = {
        "axis": "n1",
        "read": "speed",
        "unmodelled": "nothing",
    }
    usual["excitation"] = excitation_in_words(Multisine())
    return "; ".join([card["happens"], *(card[k] for k in usual if card[k] != usual[k])])


def readings(scenario: Scenario) -> str:
    """Return what estimators read, in words."""
    counts = scenario.encoder.counts
    return scenario.output + (f" of {counts} counts" if counts else "")


def change_in_words(change: Fault) -> str:
    """Return a change of a parameter in words, such as "f_m +50 % at 10 s"."""
    much = (
        f"{change.factor:g}-fold" if change.factor >= 3 else f"{100 * change.factor - 100:+.3g} %"
    )
    words = f"{change.parameter} {much}"
    match change.kind:
        case "step":
            return f"{words} at {change.at:g} s"
        case "ramp":
            return f"{words} from {change.at:g} to {change.at + change.over:g} s"
        case "thermal":
            return f"{words} from {change.at:g} s, {change.time_constant:g} s to 63 %"
        case "intermittent":
            return f"{words} from {change.at:g} s, {change.on:g} s of {change.on + change.off:g}"


def excitation_in_words(excitation: Excitation) -> str:
    """Return what the axis is asked to do, in words."""
    match excitation.kind:
        case "multisine":
            pauses = "".join(f", paused {a:g} to {b:g} s" for a, b in excitation.pause)
            return f"multisine {excitation.low:g} to {excitation.high:g} Hz{pauses}"
        case "moves":
            return (
                f"moves of {excitation.move:g} s within {excitation.reach:g} rad, "
                f"{excitation.dwell:g} s apart"
            )
        case "standstill":
            return "standstill"


def beyond(scenario: Scenario) -> str:
    """Return what the linear model does not know of axis, loop and log, as keys and values."""
    tables = {key: table.model_dump() for key, table in scenario.nonlinear.items()}
    if scenario.filter:
        tables["filter"] = scenario.filter.model_dump()
    if scenario.told:
        tables["told"] = scenario.told
    words = [f"{key} ({_values(table)})" for key, table in tables.items()]
    delay, controller = scenario.delay, scenario.controller
    if delay.measurement:
        words.append(f"measurement late by {delay.measurement} samples")
    if delay.torque:
        words.append(f"torque late by {1000 * delay.torque:g} ms")
    if controller.rate:
        words.append(
            f"loop at {controller.rate} Hz, torque logged as its {controller.log or 'mean'}"
        )
    return "; ".join(words)


def _values(table: dict[str, Any]) -> str:
    return ", ".join(f"{key} {value:g}" for key, value in table.items())
