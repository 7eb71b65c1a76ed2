"""What every entry of a board is scored on: frozen scenarios and seeds, and their identity."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.running.seeds import FIRST
from flexaxis.experiments.scoring.tracks import NUISANCE, track_of
from flexaxis.experiments.storage.files import dumps
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

SUITE = "board-v2"
"""The one suite that entries are made on; to move on to another, change its name here."""
TUNING, REPORTING = range(100), range(1000, 5000)
"""Seeds that estimators may be tuned on, and those that are kept for reporting."""
QUICK_SEEDS = 5
"""The fewest of which there are intervals; an entry with them is for trying."""


class EntryError(FlexaxisError):
    """An entry cannot be made, read or trusted; one line for each problem.

    Attributes
    ----------
    problems : tuple of str
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        self.problems = problems


@dataclass(frozen=True)
class Board:
    """What every entry is scored on: a name, scenarios and seeds."""

    name: str
    scenarios: tuple[Scenario, ...]
    seeds: tuple[int, ...]

    @cached_property
    def hash(self) -> str:
        """SHA-256 of names, contents and seeds."""
        content = [[[s.name, s.hash] for s in self.scenarios], list(self.seeds)]
        return sha256(dumps(content).encode()).hexdigest()

    @property
    def faults(self) -> tuple[Scenario, ...]:
        """The scenarios on which knobs are turned, to compare at equal noise."""
        return tuple(s for s in self.scenarios if track_of(s) != NUISANCE)

    def quick(self) -> Board:
        """Return the same with few seeds, for trying."""
        return Board(self.name, self.scenarios, self.seeds[:QUICK_SEEDS])


def board() -> Board:
    """Return the frozen one."""
    found = find_suite(SUITE)
    scenarios = tuple(find_scenario(name) for name in found.scenarios)
    return Board(SUITE, scenarios, tuple(range(FIRST, FIRST + found.seeds)))
