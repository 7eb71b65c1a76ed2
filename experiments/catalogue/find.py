"""Find scenarios and suites in the catalogue by name or path, and list them.

Slow modules are imported only after the names of all scenarios have been checked. Therefore a
misspelt scenario name causes an immediate error.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean, unknown

if TYPE_CHECKING:
    from flexaxis.sim.scenario import Scenario

HOME = Path(str(files("flexaxis.experiments.catalogue")))
HASHES = "hashes.toml"
STREAMS = "streams.toml"
DRAWN = "-v2"
"""Suffix in the names of scenarios whose fault onset is random and depends on the seed."""
SPREAD = 3.0  # `onset_spread` of every scenario with the suffix -v2 [s]
SCORED = 5.0  # shortest time from the latest possible onset in -v2 to the end of the run [s]

GROUPS = {
    "nominal": "nothing happens",
    "steps": "one parameter jumps",
    "wear": "one parameter changes within seconds",
    "intermittent": "one parameter alternates between two values",
    "several": "several changes",
    "excitation": "references other than the default multisine",
    "sensors": "sensor errors and signal delays",
    "mismatch": "effects that the linear model does not describe",
    "nuisance": "parameter changes that are not faults",
    "known": "faults on axes whose nominal parameter values are wrong",
    "drives": "faults on commercial drives with published friction",
    "control": "the controller uses the parameter estimates",
    "chains": "axes that do not have three masses",
    "ground": "conditions under which good estimators have failed",
}
"""Descriptions of the scenario groups in the catalogue, in the order of `flexaxis list`."""

Line = dict[str, str]


@dataclass(frozen=True)
class Suite:
    """A suite defines the scenarios, the estimators and the number of seeds of a benchmark.

    The field `scenarios` contains scenario names, or Scenario objects if `select` has created the
    suite. A benchmark also tunes the estimators in `swept_estimators` to equal noise, and compares
    these estimators on the scenarios in `swept_scenarios`.
    """

    name: str
    card: str
    scenarios: Sequence[Any]
    estimators: Sequence[str]
    seeds: int
    swept_scenarios: Sequence[Any] = ()
    swept_estimators: Sequence[str] = ()


def names_in(folder: str) -> list[str]:
    """Return the names of the TOML files in a folder of the catalogue."""
    return sorted(path.stem for path in (HOME / folder).glob("*.toml"))


def scenario_names() -> list[str]:
    """Return the names of all scenarios except those with a random onset (suffix -v2)."""
    return names_in("scenarios")


def suite_names() -> list[str]:
    """Return the names of all suites."""
    return names_in("suites")


@cache
def hashes() -> dict[str, str]:
    """Return the frozen hash of each scenario, keyed by scenario name."""
    return _tables(HASHES)


def _tables(place: str) -> dict[str, Any]:
    return tomllib.loads((HOME / place).read_text(encoding="utf-8"))


def full_name(name: str) -> str:
    """Return the full name of a scenario; a name without a suffix means version -v1."""
    return f"{name}-v1" if f"{name}-v1" in hashes() else name


def check_names(names: Iterable[str]) -> None:
    """Raise a ScenarioError unless every name is that of a scenario, a suite or a file."""
    known = {*hashes(), *suite_names()}
    if wrong := [n for n in names if full_name(n) not in known and not Path(n).is_file()]:
        raise ScenarioError(*map(_unknown, wrong))


def _unknown(name: str) -> str:
    if name in suite_names():
        return f"{name} is a suite; use one of its scenarios (see `flexaxis show {name}`)"
    if name.endswith(".toml"):
        return f"{name}: no such file"
    hint = did_you_mean(name, [*suite_names(), *scenario_names()])
    return (
        f"unknown scenario {name!r}.{hint} `flexaxis list scenarios --all` shows all scenarios. "
        "You can also use the path of a TOML file"
    )


def find_scenario(name: str) -> Scenario:
    """Return the scenario with a given name in the catalogue, or read a scenario from a TOML file.

    A scenario name without a suffix means version -v1. In version -v2 of a scenario, the fault
    onset is random and depends on the seed.

    Raises
    ------
    ScenarioError
        If the name is neither that of a scenario nor that of a file, or if the file contains
        errors. The error is also raised if a scenario in the catalogue does not match its frozen
        hash.
    """
    from flexaxis.sim.scenario import load_scenario, scenario_from

    name = full_name(name)
    if name in scenario_names():
        return _frozen(scenario_from(_tables(f"scenarios/{name}.toml"), source=name), name)
    if name.endswith(DRAWN) and name in hashes():
        first = find_scenario(name.removesuffix(DRAWN) + "-v1")
        end = max(fault.at for fault in first.fault) + SPREAD + SCORED
        changes = {"onset_spread": SPREAD, "duration": max(first.duration, end), "name": name}
        if name in (streams := _tables(STREAMS)):
            changes["streams"] = streams[name]
        return _frozen(first.override(changes), name)
    if Path(name).is_file():
        return load_scenario(Path(name))
    raise ScenarioError(_unknown(name))


def _frozen(scenario: Scenario, name: str) -> Scenario:
    """Return a scenario if its content hash equals its frozen hash; otherwise raise an error.

    Without this check, results of a changed scenario could be combined with stored results of the
    original scenario.
    """
    frozen_hash, result = hashes().get(name), scenario.hash[:16]
    if frozen_hash is None:
        raise ScenarioError(
            f"{name}: the catalogue contains no hash of this scenario. When the file is final, add "
            f'the line "{name}" = "{result}" to {HOME / HASHES}. To use a scenario without a '
            "hash, give the path of its file"
        )
    if frozen_hash != result:
        raise ScenarioError(
            f"{name}: the scenario content has the hash {result}, but the catalogue contains the "
            f"hash {frozen_hash}. "
            "Use a new name for a changed scenario. If you have added a key to Scenario, set its "
            "default to None, which does not affect hashes."
        )
    return scenario


def find_suite(name: str) -> Suite:
    """Return the suite with a given name; in its file, estimators = "all" means all estimators."""
    from flexaxis.estimators.registry import REGISTRY

    table = _tables(f"suites/{name}.toml")
    swept = table.get("tradeoff", {"scenarios": (), "estimators": ()})
    own, others = ([*REGISTRY] if t["estimators"] == "all" else t["estimators"]
                   for t in (table, swept))  # fmt: skip
    return Suite(name, table["card"], _members(table), own, table["seeds"], swept["scenarios"],
                 others)  # fmt: skip


def _members(table: dict[str, Any]) -> list[str]:
    """Return the names of the scenarios in a suite, given the content of the suite file.

    A suite file lists groups, excluded groups or the names of scenarios. The suite contains version
    -v2 of each scenario in a group, or version -v1 if version -v2 does not exist.
    """
    if "groups" not in table and table["scenarios"] != "all":
        return list(table["scenarios"])
    groups = table.get("groups") or GROUPS.keys() - table["apart"]
    names = [line["name"] for line in scenarios() if line["group"] in groups]
    drawn = {name: name.removesuffix("-v1") + DRAWN for name in names}
    return [drawn[name] if drawn[name] in hashes() else name for name in names]


def select(names: Any, *, default: str = "smoke") -> Suite:
    """Combine all given scenarios and the scenarios of all given suites into one suite.

    Parameters
    ----------
    names : str, Path, Scenario, or several of them
        Names of suites, names of scenarios, paths of scenario files and Scenario objects, in any
        combination.
    default : str
        Name of a suite. If `names` does not contain a suite, the suite `default` determines the
        estimators and the number of seeds.

    Raises
    ------
    ScenarioError
        If a name is unknown or a file is invalid. The error message contains one line for each
        unknown name.
    """
    names = names if isinstance(names, list | tuple | set) else [names]
    texts = [str(name) for name in names if isinstance(name, str | Path)]
    check_names(texts)
    suites = {name: find_suite(name) for name in texts if name in suite_names()}
    result: dict[Any, Scenario] = {}
    for name in names:
        for each in suites[name].scenarios if str(name) in suites else [name]:
            scenario = find_scenario(str(each)) if isinstance(each, str | Path) else each
            result.setdefault((scenario.name, scenario.hash), scenario)
    if not result:
        raise ScenarioError("no scenario is given: name at least one scenario, such as fm_step")
    first = (*suites.values(), find_suite(default))[0]
    swept = [find_scenario(name) for name in first.swept_scenarios] if suites else []
    name = ", ".join(getattr(each, "name", str(each)) for each in names)
    return replace(first, name=name, scenarios=[*result.values()], swept_scenarios=swept)


def scenarios(*, group: str = "", find: str = "") -> list[Line]:
    """Return the name, group, difficulty, faults and description (card) of each matching scenario.

    The entry ``faults`` of a scenario contains the names of the parameters that change.

    Parameters
    ----------
    group : str
        Name of the scenario group to list (default: all groups).
    find : str
        Text to search for in the name, group, difficulty, faults and description of each scenario.
        The search ignores case.

    Raises
    ------
    FlexaxisError
        If no scenario group has the name `group`.
    """
    if group and group not in GROUPS:
        raise FlexaxisError(unknown("group", group, GROUPS))
    lines = []
    for name in scenario_names():
        table = _tables(f"scenarios/{name}.toml")
        changed = ", ".join(dict.fromkeys(fault["parameter"] for fault in table.get("fault", ())))
        known = {key: table[key] for key in ("group", "difficulty", "card")}
        lines.append({"name": name, "faults": changed, **known})
    lines.sort(key=lambda line: [*GROUPS].index(line["group"]))
    return [line for line in _with(find, lines) if group in ("", line["group"])]


def _with(find: str, lines: list[Line]) -> list[Line]:
    return [each for each in lines if find.lower() in " ".join(each.values()).lower()]


def suites(find: str = "") -> list[Line]:
    """Return the name and description (card) of each suite that contains the text `find`."""
    lines = [{"name": n, "card": _tables(f"suites/{n}.toml")["card"]} for n in suite_names()]
    return _with(find, lines)


def faults(find: str = "") -> list[Line]:
    """Return each physical fault, its parameter, and the scenarios that change the parameter."""
    from flexaxis.sim.tables.faults import CAUSES

    lines = scenarios()
    result = []
    for fault, parameter in CAUSES.items():
        names = [line["name"].removesuffix("-v1") for line in lines if line["faults"] == parameter
                 and line["group"] not in ("control", "known")]  # fmt: skip
        result.append({"fault": fault, "parameter": parameter, "scenarios": ", ".join(names)})
    return _with(find, result)
