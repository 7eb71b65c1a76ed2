"""Describe a scenario in words: its purpose, its faults and the parameters that are scored."""

import inspect
import re
from dataclasses import asdict
from typing import Any

from flexaxis.estimators.methods.rpem import Rpem
from flexaxis.estimators.problem import Problem
from flexaxis.estimators.registry import REGISTRY, Entry
from flexaxis.experiments.catalogue.find import find_scenario, find_suite, suite_names
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.scenario import Scenario


def reference_card(scenario: Scenario) -> dict[str, str]:
    """Return a description of a scenario in words, as texts that are keyed by heading."""
    from flexaxis.experiments.scoring.bounds import bounded  # slow to import

    names = ", ".join(bounded(scenario, scenario.identify))
    return {
        "tests": scenario.card,
        "group": scenario.group or "none",
        "expected": scenario.difficulty or "unknown",
        "happens": happens(scenario),
        **{heading: "; ".join(texts) or "nothing" for heading, texts in _parts(scenario).items()},
        "estimated": ", ".join(scenario.identify),
        "bound": f"defined for {names}" if names else "no score, because no bound is defined",
    }


def happens(scenario: Scenario) -> str:
    """Describe the faults and other parameter changes of a scenario in one line of text."""
    words = [fault.in_words() for fault in scenario.fault]
    words += [f"no fault: {change.in_words()}" for change in scenario.nuisance or ()]
    estimated = {physical(name)[0] for name in scenario.identify}
    if scenario.fault and not estimated & {fault.parameter for fault in scenario.fault}:
        words.append("not estimated")
    if scenario.onset_spread is not None:
        words.append(f"random onset time for each seed, ± {scenario.onset_spread:g} s")
    return "; ".join(words) or "no fault"


def in_a_line(scenario: Scenario) -> str:
    """Describe in one line a scenario's faults and its differences from the default scenario."""
    usual = _parts(Scenario(name="usual", duration=20.0))
    parts = (t for name, texts in _parts(scenario).items() for t in texts if t not in usual[name])
    return "; ".join([happens(scenario), *parts])


def _parts(scenario: Scenario) -> dict[str, list[str]]:
    """Return descriptions of a scenario's tables, keyed by heading.

    The heading "unmodelled" contains the effects that the linear model does not describe.
    """
    s, tables = scenario, scenario.tables.values()
    sensors = [words for table in tables if table.exact and (words := table.in_words())]
    sensors += ["the controller uses the measured angle"] * (s.feedback == "measured")
    unmodelled = [table.in_words() for table in tables if not table.exact]
    unmodelled += [f"known {name} × {factor:g}" for name, factor in s.known_factors.items()]
    unmodelled += [f"known values wrong by {100 * s.spread:g} %"] * (s.spread > 0)
    axis = s.preset if s.model == "three_mass" else s.model
    return {
        "axis": [axis + (f", start {s.start:g}" if s.start != 1 else "")],
        "read": [s.output],
        "sampled": [f"every {1000 * s.period:g} ms"],
        "sensors": sensors,
        "unmodelled": unmodelled,
        "data sheet": [f"known {name} = {value:g}" for name, value in s.data_sheet.items()],
        "excitation": [s.excitation.in_words()],
    }


def show(name: str) -> tuple[dict[str, Any], list[str]]:
    """Return the description of a scenario, a suite or an estimator as a dict and as lines of text.

    Parameters
    ----------
    name : str
        Name of a scenario, suite or estimator, or path of a scenario file. For a scenario, the text
        consists of its description and all its keys in TOML format.

    Raises
    ------
    ScenarioError
        If no scenario, suite or estimator has the name `name`.
    """
    if name in REGISTRY:
        entry = REGISTRY[name]
        known = options(entry)
        lines = [f"{key} = {default}\n    {text}" for key, (default, text) in known.items()]
        content = {"name": name, "summary": entry.summary, "options": known}
        return content, [f"{name}: {entry.summary}", *lines]
    if name in suite_names():
        content = asdict(find_suite(name))
        return content, [f"{key}: {value}" for key, value in content.items()]
    scenario = find_scenario(name)
    card = reference_card(scenario) | {"content hash": scenario.hash}
    lines = [f"# {key}: {' '.join(value.split())}" for key, value in card.items()]
    content = scenario.resolved() | {"hash": scenario.hash}
    return content, [*lines, "", scenario.to_toml().rstrip()]


def options(entry: Entry) -> dict[str, tuple[Any, str]]:
    """Return the default value and the description of each option of a registered estimator."""
    sources = [entry.make, REGISTRY["ekf"].make, Rpem, Problem]
    text = "\n".join(inspect.getdoc(getattr(each, "func", each)) or "" for each in sources)
    result: dict[str, str] = {}
    for names, words in re.findall(r"^(\w[\w, ]*) : .*\n((?:    .*\n?|\n)+)", text, re.MULTILINE):
        for name in names.split(", "):
            if not words.strip().startswith("As for"):
                result.setdefault(name, " ".join(words.split()))
    return {name: (value, result.get(name, "")) for name, value in entry.options.items()}
