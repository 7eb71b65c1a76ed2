"""The names of scenarios, suites and estimators, without reading what is behind them.

A wrong name is told before anything heavy is imported, so here nothing heavy is.
"""

from __future__ import annotations

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from flexaxis.sim.errors import ScenarioError, did_you_mean

HOME = files("flexaxis.experiments.catalogue")


def tomls(folder: str) -> dict[str, Traversable]:
    """Return the TOML files in a folder of the catalogue, by name."""
    found = (f for f in (HOME / folder).iterdir() if f.name.endswith(".toml"))
    return {f.name.removesuffix(".toml"): f for f in sorted(found, key=lambda f: f.name)}


def scenario_names() -> list[str]:
    """Return the names of the catalogue's scenarios."""
    return list(tomls("scenarios"))


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
