"""The estimators by name: modules of methods/ bring their own entries."""

import inspect
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexaxis.estimators import methods
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.knob import Declared, Knob, make_knob, options_of
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.problem import Nominal, make_problem
from flexaxis.estimators.tuned import Tuning, at_equal_noise

if TYPE_CHECKING:
    from flexaxis.estimators.protocol import Estimator

GIVEN = ("identify", "output", "P0", "torque", "bounds", "onsets")  # by who builds it: no options


@dataclass(frozen=True)
class Entry:
    """
    A registered estimator.

    Attributes
    ----------
    name : str
    summary : str
        One line for lists and reports.
    make : callable
        ``make(problem, *, <its own options>)``, of a `flexaxis.estimators.problem.Problem`.
    knob : str, path or None
        What trades tracking speed against variance, as for `flexaxis.estimators.knob.make_knob`.
    default : float or None
        Of the one option that is the knob, on an axis for which it was not tuned; a forgetting
        factor for 5 ms, as which it stands for a time constant.
    rank : float
        Place in lists, and when looks are given out for a page.
    laws : bool
        Whether it can be asked to identify parameters of friction and other laws; who cannot is
        asked for the others.
    told_noise : bool
        Whether it makes use of the noise of y where that is told.
    """

    name: str
    summary: str
    make: Callable[..., "Estimator"]
    knob: Declared | None = None
    default: float | None = None
    rank: float = 100.0
    laws: bool = False
    told_noise: bool = True

    @cached_property
    def factory(self) -> Callable[..., "Estimator"]:
        """
        The door for who builds it from plain values.

        ``factory(nominal, period, *, identify, output, P0, torque, noise, bounds, <options>)``.
        θ(0) is read from ``nominal``, a mapping of physical parameters to values for the paper's
        axis, or another model with its own. ``P0`` is P(0) of the methods that have one: as given,
        else by the paper's recipe on ``torque``, the (N,) torque of a nominal run; the others take
        and leave it.
        """
        own = [*inspect.signature(self.make).parameters.values()][1:]
        every = inspect.signature(make_problem).parameters
        asked = {n: p for n, p in every.items() if n != "noise" or self.told_noise}

        def factory(nominal: Nominal, period: float, **arguments: Any) -> "Estimator":
            if unknown := arguments.keys() - asked.keys() - {p.name for p in own}:
                raise TypeError(f"{self.name} has no option {min(unknown)!r}")
            problem = make_problem(
                nominal, period, **{k: v for k, v in arguments.items() if k in asked}
            )
            return self.make(problem, **{k: v for k, v in arguments.items() if k not in asked})

        signature = inspect.Signature([*asked.values(), *own])
        factory.__signature__ = signature  # type: ignore[attr-defined]
        return factory

    @property
    def options(self) -> Mapping[str, Any]:
        """Names of the options with their defaults on the nominal axis, as the factory has them."""
        options, tuning = self._own, self.tuning
        if isinstance(self.knob, str):
            (name,) = options_of(self.knob)
            if options.get(name) is None:
                options[name] = tuning.value if tuning else self.default or 0.0
        elif self.knob is not None and tuning:
            options |= make_knob(self.knob, options, usual=tuning.value).turned(1.0) or {}
        return options

    @property
    def turning(self) -> Knob | None:
        """Its knob, which stands where it was tuned to."""
        if self.knob is None:
            return None
        usual = self.tuning.value if self.tuning else 1.0
        return make_knob(self.knob, self.options, usual=usual)

    @property
    def tuning(self) -> Tuning | None:
        """What its knob is on the axis that it was tuned for, if that is its default there."""
        if self.knob is None:
            return None
        own = self._own
        left_open = all(name in own and own[name] is None for name in options_of(self.knob))
        return at_equal_noise(self.name) if left_open else None

    @property
    def _own(self) -> dict[str, Any]:
        """The options with their defaults, as the factory's signature has them."""
        signature = inspect.signature(self.factory).parameters.values()
        keywords = {p.name: p.default for p in signature if p.kind is p.KEYWORD_ONLY}
        return {name: value for name, value in keywords.items() if name not in GIVEN}


DEFAULT_IDENTIFY = PAPER


class _Unknown(EstimatorError, KeyError):
    """No estimator has this name: what a mapping raises, in words for a user."""

    __str__ = Exception.__str__  # not the repr, as of a KeyError


class _Registry(Mapping[str, Entry]):
    """Entries by name, in the order of their rank; read when first asked for."""

    def __getitem__(self, name: str) -> Entry:
        if name not in _entries():
            raise _Unknown(f"unknown estimator {name!r}: {did_you_mean(str(name), _entries())}")
        return _entries()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_entries())

    def __len__(self) -> int:
        return len(_entries())


REGISTRY: Mapping[str, Entry] = _Registry()
"""
All registered estimators: every `ENTRIES` of a module of `flexaxis.estimators.methods`.

A name that is not there raises an error that is an `EstimatorError` and a `KeyError`.
"""


@lru_cache
def _entries() -> Mapping[str, Entry]:
    modules = pkgutil.iter_modules(methods.__path__, methods.__name__ + ".")
    entries = [e for m in modules for e in getattr(import_module(m.name), "ENTRIES", ())]
    return {e.name: e for e in sorted(entries, key=lambda e: e.rank)}
