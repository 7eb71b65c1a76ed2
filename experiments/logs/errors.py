"""The error for a log that cannot be used."""

from flexaxis.sim.errors import FlexaxisError


class LogError(FlexaxisError):
    """A log cannot be read or used: what is wrong, what is needed, what to do."""
