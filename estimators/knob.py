"""The knob of an estimator (the option that trades speed against noise) and its tuned settings."""

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean

FARTHEST = 1024.0  # largest factor by which a position may differ from the usual position
FORGETS = 0.9  # an option with a default between this value and 1 is a forgetting factor

TRANSFORMS: Mapping[str, Callable[[float], float]] = {
    "": lambda x: x,
    "1-": lambda x: 1 - x,
    "1/": lambda x: 1 / x if x else math.inf,
}
"""Functions that convert an option's value to a knob position; each is its own inverse."""


@dataclass(frozen=True)
class Knob:
    """
    An option expressed as a position: a higher position makes estimates faster and noisier.

    Attributes
    ----------
    name : str
        Name of the option.
    transform : {"", "1-", "1/"}
        Name of the conversion from the value of the option to the position.
    usual : float
        Position of the option's default.
    least, most : float
        Lowest and highest position.
    """

    name: str
    transform: str
    usual: float
    least: float
    most: float

    def at(self, position: float) -> dict[str, float] | None:
        """Return the option's name and value at a position, or None if it is out of range."""
        if not self.least <= position <= self.most:
            return None
        return {self.name: self.value(position)}

    def value(self, position: float) -> float:
        """Return the value of the option at a position."""
        return TRANSFORMS[self.transform](position)

    position = value
    """Return the position of a value: each transform is its own inverse, so `value` does both."""


def make_knob(declared: Any, defaults: Mapping[str, Any]) -> Knob:
    """
    Return the knob that an estimator declares.

    Parameters
    ----------
    declared : str
        Declaration of the knob: ``"gain"`` for an option that increases with speed, ``"1-lam"`` for
        a forgetting factor λ with the position 1−λ, and ``"1/window"`` for an option that decreases
        with speed. A name alone is also treated as a forgetting factor if its default is in
        [0.9, 1).
    defaults : mapping
        Options of the estimator, with their defaults.

    Raises
    ------
    EstimatorError
        If the declaration does not name an option with a suitable default.

    Examples
    --------
    >>> make_knob("1-lam", {"lam": 0.99}).at(0.02)
    {'lam': 0.98}
    """
    read = re.fullmatch(r"(1-|1/)?\s*(\w+)", str(declared).strip())
    if read is None:
        raise EstimatorError(f'its `knob` is {declared!r}; write "gain", "1-lam" or "1/window"')
    transform, name = read[1] or "", read[2]
    value = defaults.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise EstimatorError(
            f"its `knob` {name!r} is not an option whose default is a number above 0: "
            + did_you_mean(name, [n for n, v in defaults.items() if isinstance(v, int | float)])
        )
    if not transform and FORGETS <= value < 1:
        transform = "1-"
    usual = TRANSFORMS[transform](value)
    most = usual * FARTHEST
    if transform == "1-":
        most = min(most, math.nextafter(1.0, 0.0))
        if not 0 < usual < 1:
            raise EstimatorError(f"its `knob` {declared!r} needs a default between 0 and 1")
    return Knob(name, transform, usual, usual / FARTHEST, most)


@lru_cache
def tunings() -> Mapping[str, Mapping[str, Any]]:
    """
    Return the tuned settings in ``tuned.toml``, by the name of the estimator.

    A setting has the keys ``estimator``, ``knob`` (name of the option), ``value``, ``setting`` (in
    the format of ``--estimator``), ``match`` (the matched noise: "excess" for the excess prediction
    error, or the name of the parameter whose standard deviation was matched), ``ratio`` (the
    matched noise divided by that of `rpem-forgetting` with λ = 0.995; for the excess error, the
    square root of this quotient), ``command`` (the command that determined the setting), ``model``
    (``"n1"``, the nominal axis), ``identify`` (identified parameters), ``period`` [s] and ``noise``
    (standard deviation of the noise of y during tuning [rad/s]). A setting is used at any noise
    level.
    """
    text = files("flexaxis.estimators").joinpath("tuned.toml").read_text(encoding="utf-8")
    return {table["estimator"]: table for table in tomllib.loads(text)["tuned"]}
