"""Estimators at their start, made once: who is offered the same again is reset, not made anew.

To make an estimator takes as long as to run it on a few thousand samples. What it becomes depends
on its text and on what it is offered, not on the scenario, of which most offer the same. Only the
registered ones are kept, which a reset brings back to the last bit; code of users is made for each
record, as its author expects.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from hashlib import sha256
from typing import Any

import numpy as np

from flexaxis.estimators.protocol import Estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.offer import offer_of, torque_of
from flexaxis.experiments.building.offering import offered_to
from flexaxis.experiments.building.specs import Spec, build, check_fits, made
from flexaxis.sim.scenario import Scenario

KEPT = 48  # estimators a thread: the registered ones, at two settings or on two axes
TRIED = 8192  # of which names and output are remembered, some 100 bytes each


@dataclass(frozen=True)
class _Order:
    """What an estimator is made of, told apart by its content."""

    digest: str
    spec: Spec = field(compare=False)
    nominal: Mapping[str, float] = field(compare=False)
    period: float = field(compare=False)
    offered: Mapping[str, Any] = field(compare=False)

    def made(self) -> Estimator:
        """Return a new one; errors as from `build`."""
        return made(self.spec, dict(self.nominal), self.period, self.offered)


class _Kept(threading.local):
    """The estimators of a thread, the least recently used first."""

    def __init__(self) -> None:
        self.estimators = OrderedDict[str, Any]()


_kept = _Kept()


def ready(spec: Spec, scenario: Scenario) -> Estimator:
    """Return an estimator at its start, as `build` does: the numbers are the same.

    A registered one is lent until this thread asks for it again.
    """
    if not _is_registered(spec):
        return build(spec, scenario)
    order = _ordered(spec, scenario)
    estimator = _kept.estimators.pop(order.digest, None)
    if estimator is None:
        estimator = order.made()
    else:
        estimator.reset()
    check_fits(spec.text, estimator.names, estimator.output, scenario)
    if hasattr(estimator, "reset"):
        _kept.estimators[order.digest] = estimator
        while len(_kept.estimators) > KEPT:
            _kept.estimators.popitem(last=False)
    return estimator


def check_made(spec: Spec, scenario: Scenario) -> None:
    """Raise what `build` would; a registered one is made once for all that offer the same."""
    if not _is_registered(spec):
        build(spec, scenario)
        return
    order = _ordered(spec, scenario)
    if order.digest not in _known:
        estimator = order.made()
        if len(_known) >= TRIED:
            _known.clear()
        _known[order.digest] = tuple(estimator.names), estimator.output
    check_fits(spec.text, *_known[order.digest], scenario)


_known: dict[str, tuple[Sequence[str], str]] = {}  # names and output of what was made, by content


def _ordered(spec: Spec, scenario: Scenario) -> _Order:
    offer = offer_of(scenario)
    onsets = tuple(event.index for event in scenario.events())
    offered = offered_to(spec, offer, partial(torque_of, scenario), onsets=onsets)
    content = [
        spec.text,
        id(spec.make),
        [(name, _content(value)) for name, value in sorted(spec.options.items())],
        sorted(offer.nominal.items()),
        offer.period,
    ]
    content += [(name, _content(value)) for name, value in sorted(offered.items())]
    digest = sha256(repr(content).encode()).hexdigest()
    return _Order(digest, spec, offer.nominal, offer.period, offered)


def _content(value: Any) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    return value.dtype.str, value.shape, sha256(value.tobytes()).digest()  # repr leaves out


@lru_cache(maxsize=1)
def _factories() -> frozenset[int]:
    return frozenset(id(entry.factory) for entry in REGISTRY.values())


def _is_registered(spec: Spec) -> bool:
    return id(spec.make) in _factories()
