"""Define the base class of all scenario tables and the types of their values."""

from __future__ import annotations

from typing import Annotated, Any, NoReturn, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


class Config(BaseModel):
    """Base class of option tables, which are immutable and reject unknown keys and wrong types."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Frozen(dict[str, float]):
    """Immutable dict of numbers, so that the hash of a scenario remains valid."""

    __slots__ = ()

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a scenario cannot be changed; create a new scenario with `override`")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


Values = Annotated[dict[str, float], AfterValidator(Frozen)]
LARGEST = 1e9
"""Upper limit of scenario values in SI units; a larger value is probably in the wrong unit."""

Word = Annotated[str, Field(pattern=r"^[^\s/\\\p{Cc}\p{Cf}]+$")]
"""Type of a name that can also be a file name: no blanks, slashes or control characters."""

Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST)]


def kinds(union: Any) -> dict[str, type[BaseModel]]:
    """Return the table classes in a union type such as ``Fault``, keyed by ``kind``."""
    tables = get_args(get_args(union)[0])
    return {table.model_fields["kind"].default: table for table in tables}
