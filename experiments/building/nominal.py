"""The nominal values as a user's estimator is given them: a dict that knows what was meant."""

from __future__ import annotations

from flexaxis.sim.errors import did_you_mean


class UnknownParameter(KeyError):
    """No parameter has this name, or it is not told; says which is nearest."""

    def __str__(self) -> str:
        return str(self.args[0])


class Nominal(dict[str, float]):
    """Nominal values by parameter."""

    def __missing__(self, name: str) -> float:
        """Refuse a name that is not there."""
        hint = did_you_mean(str(name), self)
        raise UnknownParameter(f"nominal has no {name!r}.{hint} It has: {', '.join(self)}")
