"""All doubts of a log: every `LOOK` of a module of this folder, in the order of its rank."""

from __future__ import annotations

import pkgutil
from functools import lru_cache
from importlib import import_module

from flexaxis.experiments.logs import doubts
from flexaxis.experiments.logs.doubts.doubt import Doubt, Look
from flexaxis.experiments.logs.doubts.evidence import Evidence, of_record
from flexaxis.experiments.logs.doubts.outliers import OUTLIERS
from flexaxis.sim.record import Record

SPOILT = 10  # rank from which looks judge how the torque moves the axis, as outliers hide


def doubts_of(record: Record) -> tuple[Doubt, ...]:
    """Return what is to be doubted of a record, and what is not, before any estimator runs.

    What only the log told from which it was imported (jitter, clipping, wrapping) is on the page
    of the import, and not here.

    Examples
    --------
    >>> remedies = [d.remedy for d in doubts_of(record) if d.remedy]  # doctest: +SKIP
    """
    return examine(of_record(record))


def examine(evidence: Evidence) -> tuple[Doubt, ...]:
    """Return everything that was looked at."""
    if evidence.still:
        return (still(evidence),)
    found: list[Doubt] = []
    for look in looks():
        if look.rank >= SPOILT and any(d.name == OUTLIERS and d.verdict != "ok" for d in found):
            break
        doubt = look.at(evidence)
        if doubt is not None:
            found.append(doubt)
    return tuple(found)


def still(evidence: Evidence) -> Doubt:
    """Return the only doubt of a log in which nothing happens."""
    text = "torque or motion are constant: nothing can be learnt from this log but its noise"
    seconds = len(evidence.time) * evidence.period
    return Doubt("motion", seconds, "s", "problem", text)


@lru_cache
def looks() -> tuple[Look, ...]:
    """Return the looks of all modules of this folder, in their order."""
    modules = pkgutil.iter_modules(doubts.__path__, doubts.__name__ + ".")
    found = [getattr(import_module(module.name), "LOOK", None) for module in modules]
    return tuple(sorted((look for look in found if look is not None), key=lambda look: look.rank))
