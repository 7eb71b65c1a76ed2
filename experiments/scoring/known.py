"""Scenarios as keys: what is made of one is remembered for all that have its content."""

from __future__ import annotations

from dataclasses import dataclass, field

from flexaxis.sim.scenario import Scenario


@dataclass(frozen=True)
class Known:
    """A scenario, told apart by a digest of what matters of it to whoever remembers."""

    digest: str
    scenario: Scenario = field(compare=False)

    @classmethod
    def of(cls, scenario: Scenario) -> Known:
        """Return a scenario, told apart by its content."""
        return cls(scenario.hash, scenario)
