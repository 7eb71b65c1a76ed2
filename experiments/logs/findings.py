"""Findings (severity, text, remedy) about a log, and the error for a log that cannot be used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from flexaxis.sim.conflicts import explain
from flexaxis.sim.errors import FlexaxisError

Kind = Literal["problem", "note", "info", "ok"]
MARKS: dict[Kind, str] = {"problem": "✗", "note": "!", "info": "·", "ok": "✓"}
"""Symbol of each kind of finding, in order of decreasing severity."""


class LogError(FlexaxisError):
    """Error for a log that cannot be used. The message gives the reason and the next step."""


def checked(kind: type[BaseModel], tables: Mapping[str, Any], source: object) -> Any:
    """Convert nested tables, for example from a TOML file, to a pydantic model of class `kind`.

    Raises
    ------
    LogError
        If a key is unknown or has a wrong value. The message has one line for each such key, and
        each line begins with `source`.
    """
    try:
        return kind(**tables)
    except ValidationError as error:
        lines = (f"{source}: {key}: {text}" for key, text in explain(error, kind))
        raise LogError("\n".join(lines)) from error


@dataclass(frozen=True)
class Finding:
    """A statement about a log or about the estimates from a log.

    Attributes
    ----------
    kind : {"problem", "note", "info", "ok"}
        Severity: a problem that spoils estimates, a warning, information, or a passed check.
    text : str
        Text of the finding.
    name : str
        Name of the check; empty if the finding does not come from a check.
    command : str
        Command-line option that solves the problem, or an empty string.
    """

    kind: Kind
    text: str
    name: str = ""
    command: str = ""

    @property
    def sentence(self) -> str:
        """Name of the check, text of the finding, and the command-line option to type."""
        name = f"{self.name}: " if self.name else ""
        return f"{name}{self.text}" + (f". Type: {self.command}" if self.command else "")


def ordered(every: Iterable[Finding]) -> list[Finding]:
    """Return the findings sorted by severity, the most severe first."""
    return sorted(every, key=lambda one: [*MARKS].index(one.kind))


def texts_of(every: Iterable[Finding], *kinds: Kind) -> list[str]:
    """Return the sentences of all findings of the given kinds."""
    return [one.sentence for one in every if one.kind in kinds]
