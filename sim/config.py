"""What all tables of a scenario have in common: frozen, strict, no unknown keys."""

from __future__ import annotations

from typing import Annotated, Any, Protocol, get_args

from pydantic import BaseModel, ConfigDict, Field


class Config(BaseModel):
    """A table of a scenario: immutable, and no key or type is guessed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Table(Protocol):
    """What every table of axis, loop and sensors says of itself."""

    @property
    def exact(self) -> bool:
        """Whether the linear model describes what is logged with it, as it is configured."""

    def in_words(self) -> str:
        """Return what it does as it is configured, in a few words; nothing if it does nothing."""


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the tables that a union such as ``Fault`` may be, by their ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
