"""The shipped estimators, as scenarios take them: by `run`, with and without a fault; by `step`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.specs import build, parse
from flexaxis.experiments.speed.problem import Problem
from flexaxis.experiments.speed.rivals import UNIT as EXPM
from flexaxis.experiments.speed.rounds import Contender, timed

Array = NDArray[np.float64]

UNIT = "rpem-forgetting"
"""The paper's method: what the others are times of, by `run` without a fault."""
LITERAL = "literal-rpem"  # an exponential in every sample; timed among the rivals
FEW = 1000  # samples that are taken one by one
WORK = 100_000  # samples of the fastest that are timed at once; of others as the time allows
SLOW = 0.04  # s, what a round may take with one that is slower


def registered() -> list[str]:
    """Return the names of all estimators that are timed by name."""
    return [name for name in REGISTRY if name != LITERAL]


def shipped(given: Problem, estimators: Sequence[str] = ()) -> list[Contender]:
    """Return three contenders for each estimator, the unit before all others.

    Parameters
    ----------
    given : Problem
    estimators : sequence of str
        As an `--estimator` option names them; all that are registered by default.
    """
    names = dict.fromkeys([UNIT, *(estimators or registered())])
    return [one for name in names for one in _three(given, name)]


def _three(given: Problem, name: str) -> Iterator[Contender]:
    estimator = build(parse(name), given.scenario)
    entry = REGISTRY.get(name.partition("[")[0])
    what = entry.summary if entry else name
    facts = {"estimator": name}
    quiet, fault = given.quiet, (given.u, given.y)
    for suffix, by, signals in (("", "run", quiet), (" fault", "run-fault", fault)):
        seconds = _runs(estimator, *signals)
        yield Contender(
            name + suffix,
            what if not suffix else f"{name} with a fault in 20 s",
            UNIT,
            seconds,
            faster=False,
            besides=EXPM,
            facts=facts | {"by": by},
        )
    yield Contender(
        f"{name} step",
        f"{name}, sample by sample from Python",
        UNIT,
        _steps(estimator, quiet[0][:FEW], quiet[1][:FEW]),
        faster=False,
        besides=EXPM,
        facts=facts | {"by": "step"},
    )


def _runs(estimator: Estimator, u: Array, y: Array) -> Callable[[], float]:
    """Time whole records, each from the start, as often as there is time for."""
    start = partial(restart, estimator)
    whole = timed(lambda: run_estimator(estimator, u, y), len(u), before=start)
    whole()  # compiles
    repeats = int(np.clip(SLOW / (whole() * len(u)), 1, WORK / len(u)))
    return lambda: float(np.mean([whole() for _ in range(repeats)]))


def _steps(estimator: Estimator, u: Array, y: Array) -> Callable[[], float]:
    pairs = list(zip(u.tolist(), y.tolist(), strict=True))
    step = estimator.step

    def work() -> None:
        for torque, speed in pairs:
            step(torque, speed)

    return timed(work, len(pairs), before=partial(restart, estimator))


def restart(estimator: Any) -> None:
    """Take an estimator back to its start, where it can be."""
    if hasattr(estimator, "reset"):
        estimator.reset()
