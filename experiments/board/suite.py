"""What every entry of a board is scored on: frozen scenarios and seeds, and their identity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.running.seeds import FIRST
from flexaxis.experiments.scoring.ranking import REFERENCE
from flexaxis.experiments.scoring.tracks import NUISANCE, track_of
from flexaxis.sim.scenario import Scenario

NAME = "board-v1"
TUNING, REPORTING = range(100), range(1000, 5000)
"""Seeds that estimators may be tuned on, and those that are kept for reporting."""
QUICK_SEEDS = 5
"""The fewest of which there are intervals; an entry with them is for trying."""


@dataclass(frozen=True)
class Board:
    """Scenarios and seeds.

    Attributes
    ----------
    name : str
    scenarios : tuple of Scenario
    seeds : tuple of int
    """

    name: str
    scenarios: tuple[Scenario, ...]
    seeds: tuple[int, ...]

    @cached_property
    def hash(self) -> str:
        """SHA-256 of names, contents and seeds."""
        content = [[s.name, s.hash] for s in self.scenarios]
        return sha256(dumps([content, list(self.seeds)]).encode()).hexdigest()

    @property
    def hashes(self) -> dict[str, str]:
        """Identity of each scenario, by name."""
        return {scenario.name: scenario.hash for scenario in self.scenarios}

    @property
    def faults(self) -> tuple[Scenario, ...]:
        """The scenarios on which knobs are turned, to compare at equal noise."""
        return tuple(s for s in self.scenarios if track_of(s) != NUISANCE)

    @property
    def nuisances(self) -> tuple[Scenario, ...]:
        """The scenarios that are run as set."""
        return tuple(s for s in self.scenarios if track_of(s) == NUISANCE)

    def quick(self) -> Board:
        """Return the same with few seeds, for trying."""
        return Board(self.name, self.scenarios, self.seeds[:QUICK_SEEDS])


def board() -> Board:
    """Return the frozen one."""
    found = find_suite(NAME)
    scenarios = tuple(find_scenario(name) for name in found.scenarios)
    return Board(NAME, scenarios, tuple(range(FIRST, FIRST + found.seeds)))


__all__ = ["NAME", "QUICK_SEEDS", "REFERENCE", "REPORTING", "TUNING", "Board", "board"]
