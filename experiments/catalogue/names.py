"""The names of scenarios, suites and estimators, and a line on each, for the table of `list`.

A wrong name is told before anything heavy is imported, so here nothing heavy is. To make the lines
takes a second, for all scenarios are read: they are kept in the user's cache, with a digest of all
that they are made of.
"""

from __future__ import annotations

import json
import tomllib
from contextlib import suppress
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from flexaxis.experiments.files import digest_of
from flexaxis.sim.errors import FlexaxisError, ScenarioError, did_you_mean, unknown
from flexaxis.sim.files import atomic

HOME = files("flexaxis.experiments.catalogue")
HASHES = "hashes.toml"
DRAWN = "-v2"
"""Ends the name of a scenario that is its -v1 with an onset that is drawn."""
SPREAD = 3.0  # s, `onset_spread` of every -v2

GROUPS = {
    "nominal": "nothing happens",
    "steps": "one parameter jumps",
    "wear": "one parameter changes over seconds",
    "intermittent": "one parameter jumps to and fro",
    "several": "more than one change",
    "excitation": "other motion than the full multisine",
    "sensors": "what lies between axis and log",
    "mismatch": "an axis that the linear model does not describe",
    "nuisance": "changes that are no faults",
    "drives": "drives that exist, with friction and faults of their own",
    "control": "estimates drive the controller",
    "chains": "axes of other masses than the paper's",
    "ground": "where estimators have failed that do well on all the others",
}
"""The groups of the catalogue, in the order in which it is read."""


def tomls(folder: str) -> dict[str, Traversable]:
    """Return the TOML files in a folder of the catalogue, by name."""
    found = (f for f in (HOME / folder).iterdir() if f.name.endswith(".toml"))
    return {f.name.removesuffix(".toml"): f for f in sorted(found, key=lambda f: f.name)}


def toml_of(folder: str, name: str) -> Traversable | None:
    """Return the TOML file of a name in a folder of the catalogue, None where it has none."""
    found = HOME / folder / f"{name}.toml"
    return found if name.replace("-", "_").isidentifier() and found.is_file() else None


def hashes() -> dict[str, str]:
    """Return what the names of the catalogue's scenarios are frozen with."""
    found: dict[str, str] = tomllib.loads((HOME / HASHES).read_text(encoding="utf-8"))
    return found


def scenario_names() -> list[str]:
    """Return the names of the catalogue's scenarios; twins with a drawn onset are not listed."""
    return list(tomls("scenarios"))


def full_name(name: str) -> str:
    """Return the name of a scenario with its suffix; without one, -v1 is meant."""
    first = f"{name}-v1"
    return first if toml_of("scenarios", first) else name


def is_scenario(name: str) -> bool:
    """Whether the catalogue has a scenario of this name, twins with a drawn onset included."""
    return full_name(name) in hashes()


def suite_names() -> list[str]:
    """Return the names of the suites."""
    return list(tomls("suites"))


def suite_card(name: str) -> str:
    """Return what a suite is, in its own words."""
    card: str = tomllib.loads(tomls("suites")[name].read_text(encoding="utf-8"))["card"]
    return card


def is_path(name: str) -> bool:
    """Whether a name stands for a file of a scenario, whatever the catalogue holds."""
    return name.endswith(".toml") or Path(name).is_file()


def unknown_scenario(name: str) -> ScenarioError:
    """Return the error for a name that is neither in the catalogue nor a file."""
    if name in suite_names():
        return ScenarioError(
            f"{name} is a suite of scenarios: name one of them; `flexaxis show {name}` lists them"
        )
    known = [*suite_names(), *scenario_names(), *(n.removesuffix("-v1") for n in scenario_names())]
    return ScenarioError(
        f"unknown scenario {name!r}.{did_you_mean(name, known)} "
        "`flexaxis list` shows the catalogue; a path to a TOML file works too"
    )


Line = dict[str, str]


def scenario_lines(*, group: str = "", find: str = "") -> list[Line]:
    """Return the scenarios: name, group, difficulty, content, summary.

    Parameters
    ----------
    group : str
        Only those of one group.
    find : str
        Only those with this text anywhere, in either case.

    Raises
    ------
    FlexaxisError
        If there is no such group.
    """
    if group and group not in GROUPS:
        raise FlexaxisError(unknown("group", group, GROUPS))
    return [line for line in lines("scenarios", find=find) if group in ("", line["group"])]


def lines(kind: str, *, find: str = "") -> list[Line]:
    """Return the lines of scenarios, suites or estimators that hold a text in any of their values.

    Suites have name and summary, estimators name, summary and tuned_for.
    """
    wanted = find.lower()
    return [line for line in _kept()[kind] if any(wanted in v.lower() for v in line.values())]


@cache
def _kept() -> dict[str, list[Line]]:
    from flexaxis.estimators.models.compiler import user_cache

    digest = digest_of("sim", "estimators", "models_mjcf", "experiments.catalogue")
    try:
        path = user_cache() / "flexaxis" / "catalogue.json"
    except RuntimeError:  # who has no home has no cache
        return _made()
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["digest"] == digest:
            return {kind: kept[kind] for kind in ("scenarios", "suites", "estimators")}
    found = _made()
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path) as part:
            part.write_text(json.dumps(found | {"digest": digest}), encoding="utf-8")
    return found


def _made() -> dict[str, list[Line]]:
    from flexaxis.estimators.registry import REGISTRY

    return {
        "scenarios": [_scenario(name) for name in scenario_names()],
        "suites": [{"name": name, "summary": suite_card(name)} for name in suite_names()],
        "estimators": [
            {"name": e.name, "summary": e.summary, "tuned_for": e.tuning.axis if e.tuning else ""}
            for e in REGISTRY.values()
        ],
    }


def _scenario(name: str) -> Line:
    from flexaxis.experiments.catalogue import card
    from flexaxis.sim.scenario import parse_scenario

    file = tomls("scenarios")[name]
    scenario = parse_scenario(file.read_text(encoding="utf-8"), source=name)
    return {
        "name": name,
        "group": scenario.group or "",
        "difficulty": scenario.difficulty or "",
        "content": card.in_a_line(scenario),
        "summary": scenario.card,
    }
