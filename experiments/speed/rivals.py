"""The paper's method by matrix exponentials, and by ours: what the exponential costs."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from flexaxis.estimators import LiteralRpem, Rpem
from flexaxis.estimators.sampling.extended import extended_system
from flexaxis.experiments.speed.problem import BOX, IDENTIFY, Problem
from flexaxis.experiments.speed.rounds import Contender, timed

Array = NDArray[np.float64]

UNIT = "expm"
P0 = (2.97e-4, 5.19e-5, 4.69e-6)
FEW, REPEATS = 600, 25  # samples of what is slow, runs of what is fast
TERMS = 16  # of the series that the NumPy loop takes


def rivals(given: Problem) -> list[Contender]:
    """Return the matrix exponential, what uses it, and what does without."""
    parametrization = given.parametrization
    F, G, _ = extended_system(parametrization, parametrization.theta)
    block = np.zeros((len(F) + 1, len(F) + 1))
    block[:-1, :-1], block[:-1, -1:] = F * given.period, G * given.period
    literal = LiteralRpem(given.model, **_options(given))
    u, y = given.u[:FEW], given.y[:FEW]
    return [
        Contender(UNIT, "one scipy.linalg.expm of the 21×21 extended matrix", UNIT,
                  timed(lambda: [expm(block) for _ in range(FEW)], FEW)),
        Contender("literal-rpem", "the paper word for word, expm in every sample", UNIT,
                  timed(lambda: literal.run(u, y), FEW)),
        Contender("c2d", "one control.c2d of the extended system", UNIT,
                  timed(_c2d(F, G, given.period, FEW), FEW)),
        Contender("numpy-action", f"{TERMS} products of the extended matrix with the state, NumPy",
                  UNIT, timed(_numpy_action(block, TERMS, FEW), FEW)),
        *_ours(given),
    ]  # fmt: skip


def _options(given: Problem) -> dict:
    theta = given.parametrization.theta
    bounds = BOX[0] * theta, BOX[1] * theta
    return {"identify": IDENTIFY, "P0": P0, "bounds": bounds, "period": given.period}


def _ours(given: Problem) -> list[Contender]:
    """Return Rpem on one thread and on two, both by the clock on the wall too."""
    one, *two = (Rpem(given.model, **_options(given)) for _ in range(3))
    samples = REPEATS * len(given.u)

    def run(rpem: Rpem) -> None:
        for _ in range(REPEATS):
            rpem.run(given.u, given.y)

    def both() -> None:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(run, two))

    wall, alone = time.perf_counter, "rpem-run-wall"
    return [
        Contender("rpem-run", "Rpem.run, one run on one thread", UNIT,
                  timed(lambda: run(one), samples)),
        Contender(alone, "the same by the clock on the wall", alone,
                  timed(lambda: run(one), samples, wall)),
        Contender("rpem-run-2-threads", "Rpem.run, two runs on two threads, a run-sample, "
                  "by the clock on the wall", alone, timed(both, 2 * samples, wall)),
    ]  # fmt: skip


def _c2d(F: Array, G: Array, period: float, count: int) -> Callable[[], object]:
    import control

    system = control.ss(F, G, np.eye(len(F)), np.zeros((len(F), 1)))
    return lambda: [control.c2d(system, period) for _ in range(count)]


def _numpy_action(block: Array, order: int, count: int) -> Callable[[], object]:
    """Return the propagation by products of the extended matrix with the state, no exponential."""

    def work() -> None:
        X = np.ones(len(block))
        for _ in range(count):
            v = X
            for k in range(1, order + 1):
                v = block @ v / k
                X = X + v

    return work
