"""Define the error classes of the simulation, and suggest corrections for misspelt words."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class FlexaxisError(ValueError):
    """Base class of all errors that report invalid input or a failed simulation."""


class ParameterError(FlexaxisError):
    """A parameter of the axis is unknown, or its value is physically impossible."""


class ScenarioError(FlexaxisError):
    """A scenario is invalid; the error message contains one line for each problem.

    Attributes
    ----------
    problems : tuple of str
        Lines of the error message, one per problem.
    """

    def __init__(self, *problems: str) -> None:
        super().__init__("\n".join(problems))
        # `problems` is derived from the message, because pickle passes only the message.
        self.problems = tuple(str(self).splitlines())


class RecordError(FlexaxisError):
    """A record of a run is invalid, or its file cannot be read or written."""


class SimulationError(FlexaxisError):
    """The physics engine issued a warning, or an angle or speed of the axis is not finite.

    Attributes
    ----------
    run : int
        Index of the failed run in the batch.
    time : float
        Simulated time at the end of the simulation step that failed [s].
    reason : str
        Cause of the failure, such as a warning from the physics engine.
    """

    def __init__(self, message: str, run: int, time: float, reason: str) -> None:
        super().__init__(message, run, time, reason)  # pickle requires all arguments
        self.run, self.time, self.reason = run, time, reason

    def __str__(self) -> str:
        return str(self.args[0])


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint with the known word closest to `word`, or "" if no word is similar.

    Examples
    --------
    >>> did_you_mean("k_t", ["k_T", "J_m"])
    " Did you mean 'k_T'?"
    >>> did_you_mean("apple", ["k_T", "J_m"])
    ''
    """
    spelt = {name.lower().lstrip("-"): name for name in known}
    # a `word` that was read from a file may be a number; the dashes of options are no similarity
    near = get_close_matches(str(word).lower().lstrip("-"), spelt, n=1)
    return f" Did you mean {spelt[near[0]]!r}?" if near else ""


def unknown(kind: str, word: str, known: Iterable[str]) -> str:
    """Return the error message for an unknown word, with a list of all known words.

    Examples
    --------
    >>> unknown("preset", "N1", ["n1", "n2", "wg"])
    "unknown preset 'N1'; known presets are n1, n2, wg. Did you mean 'n1'?"
    """
    known = list(known)
    words = ", ".join(known)
    return f"unknown {kind} {word!r}; known {kind}s are {words}.{did_you_mean(word, known)}"
