"""The file of settings that were found, as estimators/tuned.toml: write one, forget one."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import Tuning
from flexaxis.experiments.storage.files import write_text
from flexaxis.experiments.studies.tuning import Tuned, tuning_scenario
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.reading import read_toml
from flexaxis.sim.toml_text import toml_text


def save(path: Path, name: str, found: Tuned, *, command: str) -> None:
    """Write a setting to a file like estimators/tuned.toml, in the place of the one it had."""
    tables, at = _others(path, name), tuning_scenario()
    new = Tuning(
        estimator=name,
        knob=found.knob,
        value=found.value,
        setting=found.setting,
        match=found.match,
        ratio=round(found.ratio, 4),
        command=command,
        model=at.preset,
        identify=at.identify,
        period=at.period,
        noise=at.noise.speed,
    )
    _write(path, [*tables, asdict(new)])


def forget(path: Path, name: str) -> None:
    """Remove the setting of an estimator from such a file: what was found is no match any more."""
    _write(path, _others(path, name))


def _others(path: Path, name: str) -> list[dict[str, Any]]:
    """Return what the file holds besides one setting."""
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    return [t for t in known.get("tuned", []) if t["estimator"] != name]


def _write(path: Path, tables: list[dict[str, Any]]) -> None:
    rank = {name: place for place, name in enumerate(REGISTRY)}
    tables.sort(key=lambda t: rank.get(t["estimator"], len(rank)))
    text = "# Written by `flexaxis tune`; docs/scores.md explains.\n" + toml_text({"tuned": tables})
    write_text(path, text)
