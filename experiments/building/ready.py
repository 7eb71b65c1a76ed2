"""Estimators at their start, made once: who is offered the same again is reset, not made anew.

To make an estimator takes as long as to run it on a few thousand samples. What it becomes depends
on its text and on what it is offered, not on the scenario, of which most offer the same. Only the
registered ones are kept, which a reset brings back to the last bit; code of users is made for each
record, as its author expects.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from functools import cache, partial
from hashlib import sha256
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.estimator_text import Spec, build, check_fits, made, parse
from flexaxis.experiments.building.offer import Misfit, offer_of, offered_to, torque_of
from flexaxis.sim.scenario import Scenario

KEPT = 48  # estimators a thread: the registered ones, at two settings or on two axes


class _Kept(threading.local):
    """The estimators of a thread, the least recently used first."""

    def __init__(self) -> None:
        self.estimators = OrderedDict[str, Any]()


_kept = _Kept()


def ready(spec: Spec, scenario: Scenario) -> Estimator:
    """Return an estimator at its start, as `build` does: the numbers are the same.

    A registered one is lent until this thread asks for it again.
    """
    if id(spec.make) not in _factories():
        return build(spec, scenario)
    offer, known = offer_of(scenario), _kept.estimators
    onsets = tuple(event.index for event in scenario.events())
    offered = offered_to(spec, offer, partial(torque_of, scenario), onsets=onsets)
    content = [
        spec.text,
        id(spec.make),
        [(name, _content(value)) for name, value in sorted(spec.options.items())],
        [(name, _content(value)) for name, value in sorted(offered.items())],
        offer.model,
        sorted(offer.nominal.items()),
        offer.period,
    ]
    key = sha256(repr(content).encode()).hexdigest()
    estimator = known.pop(key, None)
    if estimator is None:
        estimator = made(spec, offer.axis(spec.text), offer.period, offered)
    else:
        estimator.reset()
    if hasattr(estimator, "reset"):
        known[key] = estimator
        while len(known) > KEPT:
            known.popitem(last=False)
    check_fits(spec.text, estimator.names, estimator.output, scenario)
    return estimator


def _content(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    return value.dtype.str, value.shape, sha256(value.tobytes()).digest()  # repr leaves out


@cache
def _factories() -> frozenset[int]:
    return frozenset(id(entry.factory) for entry in REGISTRY.values())


def readable(
    scenarios: Sequence[Scenario], estimators: Iterable[str]
) -> tuple[list[Scenario], dict[str, str]]:
    """Return the scenarios that all estimators can read, and of the others the reason, by name.

    Where they can read none together, all are returned, and whoever runs them is told why they
    cannot be run: there is nothing to leave out.

    Parameters
    ----------
    scenarios : sequence of Scenario
    estimators : iterable of str
        Whatever they name is made on the way.
    """
    specs = [parse(text) for text in dict.fromkeys(estimators)]
    left: dict[str, str] = {}
    for scenario in scenarios:
        for spec in specs:
            try:
                ready(spec, scenario)
            except Misfit as error:
                left.setdefault(scenario.name, str(error))
            except EstimatorError:  # of another kind: told where it is to be run
                continue
    kept = [scenario for scenario in scenarios if scenario.name not in left]
    return (kept, left) if kept else (list(scenarios), {})
