"""The knob of an estimator: the way through its options on which it buys speed with noise."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from flexaxis.estimators.errors import EstimatorError, did_you_mean

Options = Mapping[str, float]
Way = Callable[[float], Options]
Declared = str | Way

FARTHEST = 1024.0  # times its usual position, to either side
FORGETS = 0.9  # an option alone with a default from here to 1 is a forgetting factor

_WORDS = r"(1-|1/)?\s*(\w+)"
_OF: Mapping[str, Callable[[float], float]] = {
    "": lambda x: x,
    "1-": lambda x: 1 - x,
    "1/": lambda x: 1 / x if x else math.inf,
}
"""What an option is turned in, each its own inverse."""


@dataclass(frozen=True)
class Knob:
    """
    The options of an estimator by position: the farther, the quicker and the noisier.

    Attributes
    ----------
    names : tuple of str
        Of the options that it turns.
    way : callable
        ``way(position)``: the options there.
    usual : float
        Where the estimator stands if nothing is said.
    least, most : float
        Between these positions it can be turned.
    transform : str or None
        Of one option: "", "1-" or "1/", as it is turned in; None for a path.
    """

    names: tuple[str, ...]
    way: Way
    usual: float
    least: float
    most: float
    transform: str | None = None

    @property
    def label(self) -> str:
        """The option that it turns, or the options, in words."""
        return ", ".join(self.names)

    def at(self, position: float) -> dict[str, float] | None:
        """Return the options at a position, None where it cannot be turned so far."""
        if not self.least <= position <= self.most:
            return None
        return dict(self.way(position))

    def turned(self, factor: float) -> dict[str, float] | None:
        """Return the options at a multiple of the usual position, None where it is out of range."""
        return self.at(self.usual * factor)

    def value(self, position: float) -> float:
        """Return what is said of a position: the value of the one option, of a path itself."""
        return position if self.transform is None else _OF[self.transform](position)

    position = value
    """Where a value is: each transform is its own inverse."""


def make_knob(declared: Declared, defaults: Mapping[str, Any], *, usual: float = 1.0) -> Knob:
    """
    Return the knob that an estimator declares.

    Parameters
    ----------
    declared : str or callable
        ``"gain"``: this option, which grows with speed; ``"1-lam"``: λ, turned in 1−λ and never
        at 1; ``"1/window"``: an option that falls with speed. A name alone whose default lies in
        [0.9, 1) is a forgetting factor, whatever it is called. Several options are a function of
        the position, with 1 the usual one, that returns them by name.
    defaults : mapping
        The options of the estimator, with their defaults.
    usual : float
        Where on a path it stands if nothing is said.

    Raises
    ------
    EstimatorError
        If it names what is no option, or positions and values that cannot be.

    Examples
    --------
    >>> make_knob("1-lam", {"lam": 0.99}).turned(2.0)
    {'lam': 0.98}
    >>> make_knob(lambda x: {"walk": 0.001 * x, "jump": 0.1}, {"walk": 0.001, "jump": 0.2}).at(2.0)
    {'walk': 0.002, 'jump': 0.1}
    """
    if isinstance(declared, str):
        return _of_one(declared, defaults)
    if not callable(declared):
        raise EstimatorError(
            f"its `knob` is {declared!r}; give an option by name, or a function of a position "
            "that returns options"
        )
    names = tuple(_checked(declared(usual)))
    for name in names:
        if name not in defaults:
            raise EstimatorError(
                f"its `knob` {name!r} is no option: {did_you_mean(name, defaults)}"
            )
    return Knob(names, declared, usual, usual / FARTHEST, usual * FARTHEST)


def options_of(declared: Declared) -> tuple[str, ...]:
    """Return the names of the options that a knob turns: ("lam",) of "1-lam"."""
    if isinstance(declared, str):
        return (_read(declared)[1],)
    return tuple(_checked(declared(1.0)))


def _read(declared: str) -> tuple[str, str]:
    read = re.fullmatch(_WORDS, declared.strip())
    if read is None:
        raise EstimatorError(
            f'its `knob` {declared!r} cannot be read; write "gain", "1-lam" or "1/window", or a '
            "path through several options"
        )
    return read[1] or "", read[2]


def _of_one(declared: str, defaults: Mapping[str, Any]) -> Knob:
    transform, name = _read(declared)
    value = defaults.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise EstimatorError(
            f"its `knob` {name!r} is no option with a number above 0 as default: "
            + did_you_mean(name, [n for n, v in defaults.items() if isinstance(v, int | float)])
        )
    if not transform and FORGETS <= value < 1:
        transform = "1-"
    of = _OF[transform]
    usual = of(value)
    if transform == "1-" and not 0 < usual < 1:
        raise EstimatorError(f"its `knob` {declared!r} needs a default between 0 and 1")
    most = usual * FARTHEST
    if transform == "1-":
        most = min(most, math.nextafter(1.0, 0.0))
    return Knob((name,), lambda x: {name: of(x)}, usual, usual / FARTHEST, most, transform)


def _checked(options: Any) -> Options:
    """Return options that are a mapping of names to numbers above 0."""
    good = isinstance(options, Mapping) and options and all(
        isinstance(v, int | float) and not isinstance(v, bool) and 0 < v < math.inf
        for v in options.values()
    )  # fmt: skip
    if not good:
        raise EstimatorError(f"its `knob` gives {options!r}; give options with numbers above 0")
    checked: Options = options
    return checked
