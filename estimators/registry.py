"""All registered estimators, collected from `ENTRIES` in the modules of `methods`."""

import inspect
import pkgutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

from flexaxis.estimators import methods
from flexaxis.estimators.errors import EstimatorError, did_you_mean
from flexaxis.estimators.knob import Knob, make_knob, tunings
from flexaxis.estimators.problem import Problem

if TYPE_CHECKING:
    from flexaxis.estimators.protocol import Estimator

GIVEN = ("identify", "output", "P0", "torque", "bounds", "onsets")  # set by the suite


@dataclass(frozen=True)
class Entry:
    """
    The registry entry of an estimator.

    Attributes
    ----------
    name : str
        Name of the estimator.
    summary : str
        One-line description of the estimator for lists and reports.
    make : callable
        Function ``make(problem, *, <own options>)`` that constructs the estimator for a
        `flexaxis.estimators.problem.Problem`.
    knob : str or None
        Declaration of the tuning parameter, in the format that `flexaxis.estimators.knob.make_knob`
        accepts.
    default : float or None
        Default value of the tuning parameter for an axis without tuned values. The default value of
        a forgetting factor applies to a sampling period of 5 ms; at any other period, the factor is
        adapted to keep its time constant.
    rank : float
        Sort key that determines the order of the estimators in lists and the assignment of plot
        colours.
    laws : bool
        Whether the estimator can identify parameters of friction and other nonlinear torques. If
        False, the estimator identifies only parameters of the linear model.
    told_noise : bool
        Whether the estimator uses a known noise level of y.
    """

    name: str
    summary: str
    make: Callable[..., "Estimator"]
    knob: str | None = None
    default: float | None = None
    rank: float = 100.0
    laws: bool = False
    told_noise: bool = True

    @cached_property
    def factory(self) -> Callable[..., "Estimator"]:
        """
        Function that constructs the estimator from nominal values, period and options.

        The signature is ``factory(nominal, period, *, identify, output, P0, torque, noise, bounds,
        <options>)``. The argument ``nominal`` either maps the physical parameters of the three-mass
        axis to their values, or is a model with its own nominal values. The nominal values
        determine θ(0). The argument ``P0`` is the initial matrix P(0); estimators that have no P(0)
        ignore it. By default, `flexaxis.estimators.offline.priors.nominal_P` computes P(0) from the
        argument ``torque``, which is the motor torque (N,) of a nominal motion.
        """
        own = [*inspect.signature(self.make).parameters.values()][1:]
        every = inspect.signature(Problem).parameters
        asked = {n: p for n, p in every.items() if n != "noise" or self.told_noise}
        signature = inspect.Signature([*asked.values(), *own])

        def factory(*arguments: Any, **options: Any) -> "Estimator":
            given = signature.bind(*arguments, **options).arguments
            problem = Problem(**{name: given.pop(name) for name in asked if name in given})
            return self.make(problem, **given)

        factory.__signature__ = signature  # type: ignore[attr-defined]
        return factory

    @property
    def options(self) -> Mapping[str, Any]:
        """Names of the estimator options, and their default values on the nominal axis."""
        parameters = inspect.signature(self.factory).parameters.values()
        options = {
            p.name: p.default
            for p in parameters
            if p.kind is p.KEYWORD_ONLY and p.name not in GIVEN
        }
        if self.knob:
            name = self.knob.removeprefix("1-").removeprefix("1/")
            if options[name] is None:
                options[name] = tunings().get(self.name, {}).get("value", self.default)
        return options

    @property
    def turning(self) -> Knob | None:
        """Tuning parameter of the estimator, or None if the estimator has no tuning parameter."""
        return make_knob(self.knob, self.options) if self.knob else None


class _Unknown(EstimatorError, KeyError):
    """A KeyError for an unknown estimator name, with a readable error message."""

    __str__ = Exception.__str__  # KeyError.__str__ would show the repr of the message


class _Registry(Mapping[str, Entry]):
    """Entries keyed by estimator name, sorted by rank; the first access imports `methods`."""

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
All registered estimators, from the `ENTRIES` of the modules in `flexaxis.estimators.methods`.

An unknown estimator name raises an error that is both an `EstimatorError` and a `KeyError`.
"""


@lru_cache
def _entries() -> Mapping[str, Entry]:
    modules = pkgutil.iter_modules(methods.__path__, methods.__name__ + ".")
    entries = [e for m in modules for e in getattr(import_module(m.name), "ENTRIES", ())]
    return {e.name: e for e in sorted(entries, key=lambda e: e.rank)}
