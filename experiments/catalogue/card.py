"""The reference card of a scenario: what it tests, what happens in it, and what can be scored."""

from __future__ import annotations

import inspect
import re
from typing import Any

from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import REGISTRY, Entry
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.scenario import Scenario

# What most scenarios have, and a line need not say.
_USUAL = Scenario(name="usual", duration=20.0)


def reference_card(scenario: Scenario) -> dict[str, str]:
    """Return what to know of a scenario before reading its results, by heading."""
    from flexaxis.experiments.scoring.bounds import bounded  # and all that bounds take

    names = ", ".join(bounded(scenario, scenario.identify))
    return {
        "tests": scenario.card,
        "group": scenario.group or "none",
        "expected": scenario.difficulty or "unknown",
        "axis": _axis(scenario),
        "happens": "; ".join([happens(scenario), *_drawn(scenario)]),
        "excitation": scenario.excitation.in_words(),
        "unmodelled": "; ".join(_unmodelled(scenario)) or "nothing",
        "sensors": "; ".join(_sensors(scenario)) or "ideal",
        "sampled": _sampled(scenario),
        "data sheet": "; ".join(_data_sheet(scenario)) or "nothing",
        "read": scenario.output,
        "estimated": ", ".join(scenario.identify),
        "bound": f"defined for {names}" if names else "none, so no score: see lag, std and alarms",
    }


def happens(scenario: Scenario) -> str:
    """Return the faults and other changes of a scenario in a line."""
    words = [fault.in_words() for fault in scenario.fault]
    words += [f"no fault: {change.in_words()}" for change in scenario.nuisance or ()]
    estimated = {physical(name)[0] for name in scenario.identify}
    if scenario.fault and not estimated & {fault.parameter for fault in scenario.fault}:
        words.append("not estimated")
    return "; ".join(words) or "no fault"


def in_words_of_spread(spread: float) -> str:
    """Return how an onset is drawn."""
    return f"onset drawn by seed, ± {spread:g} s"


def in_a_line(scenario: Scenario) -> str:
    """Return what happens in a scenario, and what about it is not as in most."""
    usual = _parts(_USUAL)
    parts = (part for part in _parts(scenario) if part not in usual)
    return "; ".join([happens(scenario), *parts, *_drawn(scenario)])


def _drawn(scenario: Scenario) -> list[str]:
    return [] if scenario.onset_spread is None else [in_words_of_spread(scenario.onset_spread)]


def _parts(scenario: Scenario) -> list[str]:
    return [
        _axis(scenario),
        scenario.output,
        _sampled(scenario),
        *_sensors(scenario),
        *_unmodelled(scenario),
        *_data_sheet(scenario),
        scenario.excitation.in_words(),
    ]


def _axis(scenario: Scenario) -> str:
    axis = scenario.preset if scenario.model == _USUAL.model else scenario.model
    return axis + (f", start {scenario.start:g}" if scenario.start != 1 else "")


def _sampled(scenario: Scenario) -> str:
    return f"every {1000 * scenario.period:g} ms"


def _sensors(scenario: Scenario) -> list[str]:
    """Return what lies between axis and log and is no mismatch."""
    words = [table.in_words() for table in scenario.tables.values() if table.exact]
    if scenario.feedback == "measured":
        words.append("controller sees what is measured")
    return [text for text in words if text]


def _unmodelled(scenario: Scenario) -> list[str]:
    """Return what the linear model, as told, does not know of axis, loop and log."""
    words = [table.in_words() for table in scenario.tables.values() if not table.exact]
    return words + [f"told {name} × {x:g}" for name, x in scenario.told_factors.items()]


def _data_sheet(scenario: Scenario) -> list[str]:
    """Return what estimators are told besides parameters."""
    words = {
        "poles": "told {:g} periods of cogging a turn",
        "torque_limit": "told a limit of {:g} N m",
        "noise": "told noise of {:g}",
    }
    return [words[name].format(value) for name, value in scenario.data_sheet.items()]


def options(entry: Entry) -> dict[str, tuple[Any, str]]:
    """Return the default and the meaning of each option of a registered estimator."""
    sources = [entry.make, REGISTRY["ekf"].make, Rpem, Problem]
    text = "\n".join(inspect.getdoc(getattr(each, "func", each)) or "" for each in sources)
    result: dict[str, str] = {}
    for names, words in re.findall(r"^(\w[\w, ]*) : .*\n((?:    .*\n?|\n)+)", text, re.MULTILINE):
        for name in names.split(", "):
            if not words.strip().startswith("As for"):
                result.setdefault(name, " ".join(words.split()))
    return {name: (value, result.get(name, "")) for name, value in entry.options.items()}
