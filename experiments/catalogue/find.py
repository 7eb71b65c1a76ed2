"""Find scenarios and suites: by their catalogue name, or as a path to a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.names import (
    DRAWN,
    HASHES,
    HOME,
    SPREAD,
    full_name,
    hashes,
    is_path,
    scenario_names,
    suite_names,
    toml_of,
    tomls,
    unknown_scenario,
)
from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean
from flexaxis.sim.scenario import Scenario, load_scenario, parse_scenario

_hashes = cache(hashes)
SCORED = 5.0  # s that each of them goes on at least after its last fault, wherever that is drawn


@dataclass(frozen=True)
class Suite:
    """A named group: which scenarios, which estimators, how many seeds.

    `swept_scenarios` and `swept_estimators` are those of which its report leads with the whole
    curve of speed against variance.
    """

    name: str
    card: str
    scenarios: tuple[str, ...]
    estimators: tuple[str, ...]
    seeds: int
    swept_scenarios: tuple[str, ...] = ()
    swept_estimators: tuple[str, ...] = ()


class Selection(NamedTuple):
    """What names of suites and scenarios stand for.

    Attributes
    ----------
    scenarios : list of Scenario
        Each once, in the order given.
    estimators : list of str
        Those of the suites named; of `smoke` if none was.
    seeds : int
        The largest number that a suite named; of `smoke` if none was.
    swept_scenarios : list of Scenario
    swept_estimators : list of str
        What the suites named sweep over the knobs; none where none was named.
    """

    scenarios: list[Scenario]
    estimators: list[str]
    seeds: int
    swept_scenarios: list[Scenario]
    swept_estimators: list[str]


def find_scenario(name: str) -> Scenario:
    """Return a scenario by its catalogue name or from a TOML file.

    Without a suffix, -v1 is meant. The twin -v2 of a scenario has an onset drawn by seed.

    Raises
    ------
    ScenarioError
        If there is neither such a name nor such a file, the file has errors, or a scenario of the
        catalogue is not what its name is frozen with.
    """
    name = full_name(name)
    if (file := toml_of("scenarios", name)) is not None:
        return _frozen(parse_scenario(file.read_text(encoding="utf-8"), source=name), name)
    if name.endswith(DRAWN) and name in _hashes():
        return _frozen(_with_drawn_onset(find_scenario(name.removesuffix(DRAWN) + "-v1")), name)
    if is_path(name):
        return load_scenario(Path(name))
    raise unknown_scenario(name)


def _with_drawn_onset(first: Scenario) -> Scenario:
    """Return the -v2 of a scenario: the same, but for an onset that is drawn for each seed."""
    last = max(fault.at for fault in first.fault)
    duration = max(first.duration, last + SPREAD + SCORED)
    name = first.name.removesuffix("-v1") + DRAWN
    return first.override({"name": name, "onset_spread": SPREAD, "duration": duration})


def _frozen(scenario: Scenario, name: str) -> Scenario:
    """Return a scenario of the catalogue: two machines mean the same by its name, today and later.

    What differs would be pooled with stored results of that name, and nobody would know.
    """
    wanted, found = _hashes().get(name), scenario.hash[:16]
    if wanted is None:
        raise ScenarioError(
            f"{name}: not frozen yet; when it is as it should be, add the line "
            f'"{name}" = "{found}" to {HOME / HASHES}; until then, run it from its path'
        )
    if wanted != found:
        raise ScenarioError(
            f"{name}: the content has the hash {found}, but the name is frozen with {wanted}; give "
            "a changed scenario a new name, such as -v2 (and a new key of Scenario the default "
            "None, which is off and changes no hash)"
        )
    return scenario


def find_suite(name: str) -> Suite:
    """Return a suite by its name, with "all" written out.

    Raises
    ------
    FlexaxisError
        If there is no such suite.
    """
    known = tomls("suites")
    if name not in known:
        raise FlexaxisError(f"unknown suite {name!r}.{did_you_mean(name, known)}")
    table = tomllib.loads(known[name].read_text(encoding="utf-8"))
    swept = table.get("tradeoff", {"scenarios": [], "estimators": []})
    everyone = [estimator for estimator in REGISTRY if estimator not in table.get("without", [])]
    own, others = (tuple(everyone if t["estimators"] == "all" else t["estimators"])
                   for t in (table, swept))  # fmt: skip
    scenarios = tuple(_members(table))
    return Suite(
        name, table["card"], scenarios, own, table["seeds"], tuple(swept["scenarios"]), others
    )


def _members(table: dict[str, Any]) -> list[str]:
    """Return the scenarios of a suite: all, those of some groups, or those named."""
    if "groups" in table:
        return [name for name, group in _groups().items() if group in table["groups"]]
    if table["scenarios"] != "all":
        return list(table["scenarios"])
    return [name for name, group in _groups().items() if group not in table["apart"]]


@cache
def _groups() -> dict[str, str | None]:
    """Return the groups of the scenarios, each in its last version."""
    twins = (name for name in _hashes() if name.endswith(DRAWN))
    last = {name.rpartition("-v")[0]: name for name in (*scenario_names(), *twins)}
    return {name: find_scenario(name).group for name in last.values()}


def select(names: Sequence[str]) -> Selection:
    """Turn names of suites and scenarios into scenarios, with the suites' estimators and seeds.

    Parameters
    ----------
    names : sequence of str
        Suites, catalogue names and TOML paths, mixed.

    Raises
    ------
    ScenarioError
        With one line for each name or file that is wrong.
    """
    suites = [find_suite(name) for name in names if name in suite_names()]
    wanted = [s for n in names for s in (find_suite(n).scenarios if n in suite_names() else [n])]
    scenarios: dict[str, Scenario] = {}
    problems: list[str] = []
    for name in dict.fromkeys(map(full_name, wanted)):
        try:
            scenarios[name] = find_scenario(name)
        except ScenarioError as error:
            problems += error.problems
    if problems:
        raise ScenarioError(*problems)
    _check_names_differ(scenarios)
    sources = suites or [find_suite("smoke")]
    swept = dict.fromkeys(name for suite in suites for name in suite.swept_scenarios)
    return Selection(
        scenarios=list(scenarios.values()),
        estimators=list(dict.fromkeys(e for suite in sources for e in suite.estimators)),
        seeds=max(suite.seeds for suite in sources),
        swept_scenarios=[find_scenario(name) for name in swept],
        swept_estimators=list(dict.fromkeys(e for s in suites for e in s.swept_estimators)),
    )


def _check_names_differ(scenarios: dict[str, Scenario]) -> None:
    """Two definitions under one name would be pooled into one row of the results."""
    seen: dict[str, str] = {}
    for source, scenario in scenarios.items():
        if scenario.name in seen:
            raise ScenarioError(
                f"{source}: the name {scenario.name!r} is also that of {seen[scenario.name]}; "
                "give each scenario of a run its own `name`"
            )
        seen[scenario.name] = source
