"""The names of scenarios, suites and estimators, without reading what is behind them.

A wrong name is told before anything heavy is imported, so here nothing heavy is.
"""

from __future__ import annotations

import tomllib
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from flexaxis.sim.errors import ScenarioError, did_you_mean

HOME = files("flexaxis.experiments.catalogue")
HASHES = "hashes.toml"
DRAWN = "-v2"
"""Ends the name of a scenario that is its -v1 with an onset that is drawn."""

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
    """Return the names of the catalogue's scenarios: its files, and those whose onset is drawn."""
    drawn = (name for name in hashes() if name.endswith(DRAWN))
    return sorted({*tomls("scenarios"), *drawn})


def suite_names() -> list[str]:
    """Return the names of the suites."""
    return list(tomls("suites"))


def is_path(name: str) -> bool:
    """Whether a name stands for a file of a scenario, whatever the catalogue holds."""
    return name.endswith(".toml") or Path(name).is_file()


def unknown_scenario(name: str) -> ScenarioError:
    """Return the error for a name that is neither in the catalogue nor a file."""
    if name in suite_names():
        return ScenarioError(
            f"{name} is a suite of scenarios: name one of them; `flexaxis show {name}` lists them"
        )
    known = [*scenario_names(), *suite_names()]
    return ScenarioError(
        f"unknown scenario {name!r}.{did_you_mean(name, known)} "
        "`flexaxis list` shows the catalogue; a path to a TOML file works too"
    )
