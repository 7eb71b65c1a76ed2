"""Base class and value types of all scenario tables."""

from __future__ import annotations

from typing import Annotated, Any, NoReturn, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


class Config(BaseModel):
    """A table of a scenario: immutable, with strictly checked types; unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Frozen(dict[str, float]):
    """An immutable dict of numbers; a hash computed from the numbers therefore remains valid."""

    __slots__ = ()

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a scenario cannot be changed; create a new one with its `override`")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


Values = Annotated[dict[str, float], AfterValidator(Frozen)]
LARGEST = 1e9
"""Largest allowed value of any quantity in SI units; a larger value is likely in a wrong unit."""

Word = Annotated[str, Field(pattern=r"^[^\s/\\\p{Cc}\p{Cf}]+$")]
"""A name without blanks, slashes and control characters, which can be used as a file name."""

Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the table classes of a union such as ``Fault``, keyed by their ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
