"""What is run at a time: a scenario at a point of a sweep, its estimators, some seeds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.scenario import Scenario


@dataclass(frozen=True)
class Entry:
    """An estimator at one setting of its swept options.

    Attributes
    ----------
    method : str
        As it stands in the study.
    text : str
        With the options set.
    axes : dict
        The options, by their swept keys.
    code : str, optional
        Digest of the code of a user, as it was when this was planned.
    """

    method: str
    text: str
    axes: Mapping[str, Any]
    code: str | None = None


@dataclass(frozen=True)
class Variant:
    """A scenario at one setting of its swept keys, and the estimators that get its records."""

    base: Scenario
    axes: Mapping[str, Any]
    hash: str
    duration: float
    entries: tuple[Entry, ...]
    common: bool = True

    def scenario(self) -> Scenario:
        """Return the scenario: made when it is needed, for a plan may hold many."""
        return varied(self.base, self.axes, common=self.common)


def varied(base: Scenario, axes: Mapping[str, Any], *, common: bool = True) -> Scenario:
    """Return a point of a sweep: by default with the random numbers of the scenario it varies."""
    return base.override(axes, inherit=common) if axes else base


def find_point(bases: Sequence[Scenario], axes: Mapping[str, Any], key: str) -> Variant | None:
    """Return the point of a sweep that has a hash; None where no scenario gives it.

    Parameters
    ----------
    bases : sequence of Scenario
        Of the study.
    axes : mapping
        Values of the swept keys of the scenario.
    key : str
        Hash of the scenario at the point.
    """
    for base in bases:
        for common in (True, False):
            try:
                found = varied(base, axes, common=common)
            except ScenarioError:  # the axes are those of another scenario of the study
                continue
            if found.hash == key:
                return Variant(base, axes, key, found.duration, (), common)
    return None


@dataclass(frozen=True)
class Unit:
    """Work that one process does at a time: some seeds of variants that share their records.

    Attributes
    ----------
    variants : tuple of Variant
        Each with those of its estimators that are to be run.
    seeds : tuple of int
    repeat : int
        As in `simulate`: 0, or the number of another noise on the same runs.
    """

    variants: tuple[Variant, ...]
    seeds: tuple[int, ...]
    repeat: int = 0

    def apart(self) -> Iterator[Unit]:
        """Yield the same case by case."""
        for variant in self.variants:
            for entry in variant.entries:
                for seed in self.seeds:
                    yield Unit((replace(variant, entries=(entry,)),), (seed,), self.repeat)

    @property
    def cases(self) -> int:
        """Number of cases."""
        return sum(len(variant.entries) for variant in self.variants) * len(self.seeds)

    def __str__(self) -> str:
        seeds = f"{self.seeds[0]} … {self.seeds[-1]}" if self.seeds[1:] else str(self.seeds[0])
        first, *more = self.variants
        names = ", ".join(entry.text for entry in first.entries)
        others = f" and {len(more)} variants of it" if more else ""
        return f"{first.scenario().name}{others}, seeds {seeds}, {names}"
