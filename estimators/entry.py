"""What the registry knows of an estimator: name, how it is made, its options, knob and look."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flexaxis.estimators.tuned import Tuning, at_equal_noise

if TYPE_CHECKING:
    from flexaxis.estimators.protocol import Estimator

GIVEN = ("identify", "output", "P0", "torque", "onsets")  # by who builds it, and no options


@dataclass(frozen=True)
class Entry:
    """
    A registered estimator.

    Attributes
    ----------
    name : str
    summary : str
        One line for lists and reports.
    factory : callable
        ``factory(nominal, period, *, identify, output, P0=None, torque=None, <options>)``. θ(0) is
        read from ``nominal``, a mapping of physical parameters to values for the paper's axis, or
        another model with its own. ``P0`` is P(0) of the methods that have one: as given, else by
        the paper's recipe on ``torque``, the (N,) torque of a nominal run; the others take and
        leave it.
    knob : str or None
        The option that trades tracking speed against variance.
    default : float or None
        Of the knob, on an axis for which it was not tuned; a forgetting factor for 5 ms, as
        which it stands for a time constant.
    rank : float
        Place in lists, and when looks are given out for a page.
    laws : bool
        Whether it can be asked to identify parameters of friction and other laws; who cannot is
        asked for the others.
    """

    name: str
    summary: str
    factory: Callable[..., "Estimator"]
    knob: str | None = None
    default: float | None = None
    rank: float = 100.0
    laws: bool = False

    @property
    def options(self) -> Mapping[str, Any]:
        """Names of the options with their defaults on the nominal axis, as the factory has them."""
        signature = inspect.signature(self.factory).parameters.values()
        found = {p.name: p.default for p in signature if p.kind is p.KEYWORD_ONLY}
        options = {name: value for name, value in found.items() if name not in GIVEN}
        if self.knob is not None and options.get(self.knob) is None:
            options[self.knob] = self.tuning.value if self.tuning else self.default or 0.0
        return options

    @property
    def tuning(self) -> Tuning | None:
        """What its knob is on the axis that it was tuned for, if that is its default there."""
        left_open = inspect.signature(self.factory).parameters.get(self.knob or "")
        if left_open is None or left_open.default is not None:
            return None
        return at_equal_noise(self.name)
