"""The knob of an estimator, the option that buys speed with noise, and tuned settings of it."""

import math
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.models.meaning import moves_as
from flexaxis.estimators.models.model import Model

FARTHEST = 1024.0  # times its usual position, to either side
FORGETS = 0.9  # an option with a default from here to 1 is a forgetting factor

TRANSFORMS: Mapping[str, Callable[[float], float]] = {
    "": lambda x: x,
    "1-": lambda x: 1 - x,
    "1/": lambda x: 1 / x if x else math.inf,
}
"""From the value of an option to the position of its knob, and back."""


@dataclass(frozen=True)
class Knob:
    """
    An option by position: the farther, the quicker and the noisier.

    Attributes
    ----------
    name : str
        The option.
    transform : {"", "1-", "1/"}
        From its value to the position.
    usual : float
        Position of the default.
    least, most : float
        Range of positions.
    """

    name: str
    transform: str
    usual: float
    least: float
    most: float

    def at(self, position: float) -> dict[str, float] | None:
        """Return the option at a position, None if that is out of range."""
        if not self.least <= position <= self.most:
            return None
        return {self.name: self.value(position)}

    def turned(self, factor: float) -> dict[str, float] | None:
        """Return the option at a multiple of the usual position, None if that is out of range."""
        return self.at(self.usual * factor)

    def value(self, position: float) -> float:
        """Return the value of the option at a position."""
        return TRANSFORMS[self.transform](position)

    position = value
    """The position of a value: each transform is its own inverse."""


def make_knob(declared: Any, defaults: Mapping[str, Any]) -> Knob:
    """
    Return the knob that an estimator declares.

    Parameters
    ----------
    declared : str
        ``"gain"``: this option, which grows with speed; ``"1-lam"``: a forgetting factor, turned in
        1−λ; ``"1/window"``: an option that falls with speed. A name alone with a default in
        [0.9, 1) is a forgetting factor, too.
    defaults : mapping
        The options of the estimator, with their defaults.

    Raises
    ------
    EstimatorError
        If it does not name an option with a suitable default.

    Examples
    --------
    >>> make_knob("1-lam", {"lam": 0.99}).turned(2.0)
    {'lam': 0.98}
    """
    read = re.fullmatch(r"(1-|1/)?\s*(\w+)", str(declared).strip())
    if read is None:
        raise EstimatorError(f'its `knob` is {declared!r}; write "gain", "1-lam" or "1/window"')
    transform, name = read[1] or "", read[2]
    value = defaults.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise EstimatorError(
            f"its `knob` {name!r} is no option with a number above 0 as default: "
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


PERIODS_AGREE = 1e-6  # relative


@dataclass(frozen=True)
class Tuning:
    """
    A tuned setting, the command that found it, and its axis.

    Attributes
    ----------
    estimator, knob : str
    value : float
        Of the knob.
    setting : str
        The estimator with the tuned option, as for ``--estimator``.
    match : str
        The measure of noise that was matched: "excess", the excess prediction error, or the name of
        a parameter, for its standard deviation.
    ratio : float
        Its noise over that of `rpem-forgetting` at λ = 0.995, on the nominal axis; for the excess
        error the square root of the ratio.
    command : str
        Command that found it.
    model : str
        The axis by name: ``"n1"``.
    identify : tuple of str
        Identified parameters.
    period : float
        Sampling period [s].
    noise : float
        Standard deviation of the output [rad/s]. A setting is applied at any noise.
    """

    estimator: str
    knob: str
    value: float
    setting: str
    match: str
    ratio: float
    command: str
    model: str
    identify: Sequence[str]
    period: float
    noise: float

    def holds_for(self, model: Model, period: float, identify: Sequence[str]) -> bool:
        """
        Return whether it was found for this axis, in any units.

        Parameters
        ----------
        model : Model
            With the nominal values from which the estimator starts.
        period : float
            Sampling period [s].
        identify : sequence of str
            Parameters to identify, in any order.
        """
        return (
            sorted(self.identify) == sorted(identify)
            and abs(period / self.period - 1) < PERIODS_AGREE
            and moves_as(model, self.model)
        )


@lru_cache
def tunings() -> tuple[Tuning, ...]:
    """Return all settings of ``tuned.toml``."""
    text = files("flexaxis.estimators").joinpath("tuned.toml").read_text(encoding="utf-8")
    return tuple(Tuning(**table) for table in tomllib.loads(text)["tuned"])


def at_equal_noise(estimator: str) -> Tuning | None:
    """Return the tuned setting of an estimator, None if there is none."""
    return next((t for t in tunings() if t.estimator == estimator), None)
