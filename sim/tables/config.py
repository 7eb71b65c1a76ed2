"""Define the base class and the value types of all scenario tables."""

from __future__ import annotations

from typing import Annotated, Any, NoReturn, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


class Config(BaseModel):
    """Immutable table of a scenario, in which wrong types and unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Frozen(dict[str, float]):
    """An immutable dict of numbers, so that a hash computed from the numbers remains valid."""

    __slots__ = ()

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a scenario cannot be changed; create a new one with its `override`")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


Values = Annotated[dict[str, float], AfterValidator(Frozen)]
LARGEST = 1e9
"""Largest allowed value of any quantity in SI units; a larger value probably has a wrong unit."""

Word = Annotated[str, Field(pattern=r"^[^\s/\\\p{Cc}\p{Cf}]+$")]
"""Name without blanks, slashes or control characters, so that it can be a file name."""

Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the table classes in a union such as ``Fault``, keyed by ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
