"""What all tables of a scenario have in common: frozen, strict, no unknown keys."""

from __future__ import annotations

from typing import Annotated, Any, NoReturn, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


class Config(BaseModel):
    """A table of a scenario: immutable, and no key or type is guessed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Frozen(dict[str, float]):
    """A table of numbers that cannot change: what has it as a part has a hash that is kept."""

    __slots__ = ()

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a scenario cannot change; make another one with its `override`")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


Values = Annotated[dict[str, float], AfterValidator(Frozen)]
LARGEST = 1e9
"""No quantity of an axis, its loop or a run is larger in SI: that is a slip of the unit."""

Word = Annotated[str, Field(pattern=r"^[^\s/\\\p{Cc}\p{Cf}]+$")]
"""A name: it may become that of a file, and stands in terminals, which it must not drive."""

Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the tables that a union such as ``Fault`` may be, by their ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
