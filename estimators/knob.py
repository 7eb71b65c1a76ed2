"""The tuning parameter of an estimator, which trades the speed of its estimates against noise."""

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
"""Functions that convert an option value to a tuning position; each function is its own inverse."""


@dataclass(frozen=True)
class Knob:
    """
    The tuning parameter of an estimator; higher tuning positions make estimates faster and noisier.

    Attributes
    ----------
    name : str
        Name of the option that serves as the tuning parameter.
    transform : {"", "1-", "1/"}
        Name of the function that converts an option value to a tuning position and back.
    usual : float
        Tuning position that corresponds to the default value of the option.
    least, most : float
        Lowest and highest allowed tuning positions.
    """

    name: str
    transform: str
    usual: float
    least: float
    most: float

    def at(self, position: float) -> dict[str, float] | None:
        """Return the option name and value at ``position``, or None for a position out of range."""
        if not self.least <= position <= self.most:
            return None
        return {self.name: self.value(position)}

    def value(self, position: float) -> float:
        """Return the option value that corresponds to a tuning position."""
        return TRANSFORMS[self.transform](position)

    position = value
    """Return the tuning position of an option value, by the same formula as in `value`."""


def make_knob(declared: Any, defaults: Mapping[str, Any]) -> Knob:
    """
    Return the tuning parameter that an estimator declares in its attribute ``knob``.

    Parameters
    ----------
    declared : str
        Declaration of the tuning parameter. If the declaration is only an option name, such as
        ``"gain"``, larger values of the option make the estimates faster. With the prefix ``1-``,
        as in ``"1-lam"``, the option is a forgetting factor λ, whose tuning position is 1−λ. With
        the prefix ``1/``, as in ``"1/window"``, larger values of the option make the estimates
        slower. An option without a prefix is also treated as a forgetting factor if its default
        lies in [0.9, 1).
    defaults : mapping
        Names and default values of the estimator options.

    Raises
    ------
    EstimatorError
        If the declaration names no option of the estimator, or an option with an unsuitable
        default.

    Examples
    --------
    >>> make_knob("1-lam", {"lam": 0.99}).at(0.02)
    {'lam': 0.98}
    """
    read = re.fullmatch(r"(1-|1/)?\s*(\w+)", str(declared).strip())
    if read is None:
        raise EstimatorError(
            f"the attribute `knob` is {declared!r}, but must have a form "
            'such as "gain", "1-lam" or "1/window"'
        )
    transform, name = read[1] or "", read[2]
    value = defaults.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise EstimatorError(
            f"the attribute `knob` names {name!r}, which is not an option with a positive default: "
            + did_you_mean(name, [n for n, v in defaults.items() if isinstance(v, int | float)])
        )
    if not transform and FORGETS <= value < 1:
        transform = "1-"
    usual = TRANSFORMS[transform](value)
    most = usual * FARTHEST
    if transform == "1-":
        most = min(most, math.nextafter(1.0, 0.0))
        if not 0 < usual < 1:
            raise EstimatorError(
                f"the attribute `knob` is {declared!r}, which declares {name!r} to be a forgetting "
                f"factor, so the default of {name!r} must lie between 0 and 1"
            )
    return Knob(name, transform, usual, usual / FARTHEST, most)


@lru_cache
def tunings() -> Mapping[str, Mapping[str, Any]]:
    """
    Return the tuned settings from ``tuned.toml``, keyed by estimator name.

    Each tuned setting is a table with the following keys. The key ``estimator`` contains the
    estimator name, ``knob`` the name of the tuned option, and ``value`` the value of this option.
    The key ``setting`` contains the tuned setting in the format of the command-line option
    ``--estimator``. The tuning makes a noise measure equal to that of the estimator
    `rpem-forgetting` with λ = 0.995, and the key ``match`` names this measure. If ``match`` is
    "excess", the noise measure is the excess prediction error; otherwise ``match`` is the name of
    the parameter whose standard deviation was matched. The key ``ratio`` contains the matched noise
    measure divided by that of `rpem-forgetting`, or the square root of this quotient if ``match``
    is "excess". The key ``command`` contains the command that determined the setting. The keys
    ``model``, ``identify``, ``period`` [s] and ``noise`` describe the tuning conditions. The model
    ``"n1"`` is the nominal axis, and ``noise`` is the standard deviation of the noise in y [rad/s].
    The program uses a tuned setting regardless of the noise level in y.
    """
    text = files("flexaxis.estimators").joinpath("tuned.toml").read_text(encoding="utf-8")
    return {table["estimator"]: table for table in tomllib.loads(text)["tuned"]}
