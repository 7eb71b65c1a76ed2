"""What all tables of a scenario have in common: frozen, strict, no unknown keys."""

from __future__ import annotations

from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field


class Config(BaseModel):
    """A table of a scenario: immutable, and no key or type is guessed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the tables that a union such as ``Fault`` may be, by their ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
