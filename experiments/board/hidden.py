"""Seeds that no entrant knew, and faults that come at another time: drawn by whoever verifies."""

from __future__ import annotations

import os
from dataclasses import dataclass
from hashlib import sha256
from random import Random
from typing import Any

from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.suite import REPORTING, TUNING
from flexaxis.sim.scenario import Scenario

FIRST, LAST = 10_000, 2**63 - 1  # what a signed integer of 64 bits holds: nobody can try all
EARLIER = 1.0, 3.0  # s that a fault comes before its time in the catalogue


@dataclass(frozen=True)
class Draw:
    """What is drawn.

    Attributes
    ----------
    token : str
        What it is drawn from, to be printed afterwards: with it everything is repeated.
    """

    token: str

    @classmethod
    def new(cls, given: str | None = None) -> Draw:
        """Return a new one of the system's randomness, or one that was printed.

        Raises
        ------
        EntryError
            If what is given is no such text.
        """
        if given is not None and not (given.isalnum() and 8 <= len(given) <= 64):
            raise EntryError(f"--seed-from {given!r}: give what was printed, such as 3f2a9c51d07b")
        return cls(given or os.urandom(16).hex())

    def seeds(self, number: int) -> list[int]:
        """Return that many seeds, none of which is for tuning or for reporting."""
        assert max(TUNING[-1], REPORTING[-1]) < FIRST
        return Random(f"{self.token} seeds").sample(range(FIRST, LAST), number)

    def random(self, purpose: str) -> Random:
        """Return random numbers for something else."""
        return Random(f"{self.token} {purpose}")

    def moved(self, scenario: Scenario) -> Scenario:
        """Return a scenario whose faults come earlier, in other noise and motion.

        With those of the scenario itself, the first sample that differs would give the fault away.
        """
        by = round(self.random(scenario.name).uniform(*EARLIER), 2)
        changes: dict[str, Any] = {
            f"fault[{i}].at": fault.at - by for i, fault in enumerate(scenario.fault)
        }
        other = sha256(f"{self.token} {scenario.key} moved".encode()).hexdigest()
        return scenario.override(changes | {"streams": other})
