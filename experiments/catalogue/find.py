"""The catalogue: scenarios and suites by name or from a file, and a line on each for `list`.

Nothing heavy is imported before a name is known to be right, so that a typo is answered at once.
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
"""Ends the name of a scenario that is its -v1 with an onset that is drawn for each seed."""
SPREAD = 3.0  # s, `onset_spread` of every -v2
SCORED = 5.0  # s that each of them lasts at least after its last fault, wherever that is drawn

GROUPS = {
    "nominal": "nothing happens",
    "steps": "one parameter jumps",
    "wear": "one parameter changes over seconds",
    "intermittent": "one parameter jumps to and fro",
    "several": "more than one change",
    "excitation": "another motion than the full multisine",
    "sensors": "sensors, and delays between the axis and its log",
    "mismatch": "effects that the linear model does not describe",
    "nuisance": "changes that are no faults",
    "known": "faults on axes whose other parameters are known with errors",
    "drives": "commercial drives, with friction and faults of their own",
    "control": "estimates drive the controller",
    "chains": "axes of other masses than the paper's",
    "ground": "conditions under which good estimators have failed",
}
"""The groups of the catalogue, in the order in which it is read."""

FAULTS = {
    "worn or dry motor bearing, dragging brake": "f_m",
    "worn gear, failing gear bearing": "f_g",
    "seizing bearing of the arm": "f_a",
    "tight seal, preload, dirt (dry friction)": "f_c",
    "demagnetised motor, lost phase": "k_T",
    "load picked up, tool changed": "J_a",
    "loose coupling, cracked gear tooth": "k_g",
    "loose or cracked joint of the arm": "k_a",
    "aged damper in the gear coupling": "d_g",
    "aged damper in the arm coupling": "d_a",
    "part added to the motor shaft": "J_m",
    "part added to the gear": "J_g",
}
"""The parameter that changes with each physical fault."""

Line = dict[str, str]


@dataclass(frozen=True)
class Suite:
    """Which scenarios, which estimators, how many seeds; scenarios are names, or as `select` finds.

    `swept_scenarios` and `swept_estimators` are those that are compared at equal noise.
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
    """Return the names of the scenarios; those with a drawn onset are not listed."""
    return names_in("scenarios")


def suite_names() -> list[str]:
    """Return the names of the suites."""
    return names_in("suites")


@cache
def hashes() -> dict[str, str]:
    """Return the hash of the content of each scenario."""
    return _tables(HASHES)


def _tables(place: str) -> dict[str, Any]:
    return tomllib.loads((HOME / place).read_text(encoding="utf-8"))


def full_name(name: str) -> str:
    """Return the name of a scenario with its suffix; without one, -v1 is meant."""
    return f"{name}-v1" if f"{name}-v1" in hashes() else name


def check_names(names: Iterable[str]) -> None:
    """Raise a ScenarioError with a line for each name that is no scenario, suite or file."""
    known = {*hashes(), *suite_names()}
    if wrong := [n for n in names if full_name(n) not in known and not Path(n).is_file()]:
        raise ScenarioError(*map(_unknown, wrong))


def _unknown(name: str) -> str:
    if name in suite_names():
        return f"{name} is a suite: name one of its scenarios; `flexaxis show {name}` lists them"
    if name.endswith(".toml"):
        return f"{name}: no such file"
    hint = did_you_mean(name, [*suite_names(), *scenario_names()])
    return (
        f"unknown scenario {name!r}.{hint} `flexaxis list` shows the catalogue; a path to a TOML "
        "file works too"
    )


def find_scenario(name: str) -> Scenario:
    """Return a scenario by its catalogue name or from a TOML file.

    Without a suffix, -v1 is meant. The onset of a -v2 is drawn by seed.

    Raises
    ------
    ScenarioError
        If there is neither such a name nor such a file, the file has errors, or the content of a
        catalogue scenario does not match the hash of its name.
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
    """Return a scenario whose content has the hash of its name.

    Other content would be pooled with stored results of that name without notice.
    """
    frozen_hash, result = hashes().get(name), scenario.hash[:16]
    if frozen_hash is None:
        raise ScenarioError(
            f"{name}: not frozen yet; when it is as it should be, add the line "
            f'"{name}" = "{result}" to {HOME / HASHES}; until then, run it from its path'
        )
    if frozen_hash != result:
        raise ScenarioError(
            f"{name}: the content has the hash {result}, but the frozen one is {frozen_hash}; "
            "give a changed scenario a new name (and a new key of Scenario the default None, which "
            "changes no hash)"
        )
    return scenario


def find_suite(name: str) -> Suite:
    """Return a suite by its name, with "all" written out."""
    from flexaxis.estimators.registry import REGISTRY

    table = _tables(f"suites/{name}.toml")
    swept = table.get("tradeoff", {"scenarios": (), "estimators": ()})
    own, others = ([*REGISTRY] if t["estimators"] == "all" else t["estimators"]
                   for t in (table, swept))  # fmt: skip
    return Suite(name, table["card"], _members(table), own, table["seeds"], swept["scenarios"],
                 others)  # fmt: skip


def _members(table: dict[str, Any]) -> list[str]:
    """Return the scenarios of a suite: those of some groups, all but some groups, or those named.

    A scenario whose onset can be drawn takes part with a drawn one.
    """
    if "groups" not in table and table["scenarios"] != "all":
        return list(table["scenarios"])
    groups = table.get("groups") or GROUPS.keys() - table["apart"]
    names = [line["name"] for line in scenarios() if line["group"] in groups]
    drawn = {name: name.removesuffix("-v1") + DRAWN for name in names}
    return [drawn[name] if drawn[name] in hashes() else name for name in names]


def select(names: Any, *, default: str = "smoke") -> Suite:
    """Turn names of suites and scenarios into scenarios, with the estimators of the first suite.

    Parameters
    ----------
    names : str, Path, Scenario, or several of them
        Suites, catalogue names, TOML paths and scenarios, mixed.
    default : str
        The suite whose estimators and number of seeds are meant without a suite.

    Raises
    ------
    ScenarioError
        With one line for each name that is wrong, or for each problem of a file.
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
        raise ScenarioError("name at least one scenario, such as fm_step")
    first = (*suites.values(), find_suite(default))[0]
    swept = [find_scenario(name) for name in first.swept_scenarios] if suites else []
    name = ", ".join(getattr(each, "name", str(each)) for each in names)
    return replace(first, name=name, scenarios=[*result.values()], swept_scenarios=swept)


def scenarios(*, group: str = "", find: str = "") -> list[Line]:
    """Return name, group, difficulty, faults (parameters) and card of scenarios.

    Parameters
    ----------
    group : str
        Only those of one group.
    find : str
        Only those with this text in one of these, in either case.

    Raises
    ------
    FlexaxisError
        If there is no such group.
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
    """Return name and card of suites, those that have some text."""
    lines = [{"name": n, "card": _tables(f"suites/{n}.toml")["card"]} for n in suite_names()]
    return _with(find, lines)


def faults(find: str = "") -> list[Line]:
    """Return fault, parameter and scenarios: which scenarios a physical fault is simulated by."""
    lines = scenarios()
    result = []
    for fault, parameter in FAULTS.items():
        names = [line["name"].removesuffix("-v1") for line in lines if line["faults"] == parameter
                 and line["group"] not in ("control", "known")]  # fmt: skip
        result.append({"fault": fault, "parameter": parameter, "scenarios": ", ".join(names)})
    return _with(find, result)
