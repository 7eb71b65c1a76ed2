"""How long a sample takes: the shipped estimators against their rivals, in one process.

Machines are shared and noisy, so every round measures all contenders one after the other, and what
is reported is the ratio to a matrix exponential within the round, its median and its range.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from flexaxis.estimators import LiteralRpem, Rpem, three_mass
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.sampling.extended import extended_system
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.plant import Plant
from flexaxis.sim.simulate import simulate

Array = NDArray[np.float64]
Timed = Callable[[], float]  # seconds a sample, measured now

IDENTIFY = ("k_T", "1/J_a", "f_m")
P0 = (2.97e-4, 5.19e-5, 4.69e-6)
BOX = (0.2, 5.0)  # times nominal
RUNS = 64  # of the plant
REGISTERED = {"rpem-forgetting": 25, "ekf": 15, "imm": 4, "ukf": 8, "moving-horizon": 3,
              "imm-friction": 1}  # fmt: skip
"""Estimators that are timed by name, with runs a round; the first is the unit of the others."""


@dataclass(frozen=True)
class Contender:
    """Something that is timed.

    Attributes
    ----------
    name, what : str
        What it is called, and in words.
    unit : str
        Name of the contender that its time is divided by.
    seconds : callable
        Measures once, and returns seconds a sample (of one run).
    faster : bool
        Whether to give unit over it ("times faster") rather than it over unit.
    """

    name: str
    what: str
    unit: str
    seconds: Timed
    faster: bool = True


def measure(rounds: int = 7) -> Iterator[list[dict[str, Any]]]:
    """Yield the table of ratios after each round.

    Yields
    ------
    list of dict
        ``name, what, us_per_sample`` (median), ``unit, faster, ratio, low, high``: median and
        range over the rounds so far.
    """
    contenders = [*_estimators(), *_plants()]
    for contender in contenders:
        contender.seconds()  # caches, first calls
    times: list[dict[str, float]] = []
    for _ in range(rounds):
        times.append({contender.name: contender.seconds() for contender in contenders})
        yield [_row(contender, times) for contender in contenders]


def _row(contender: Contender, times: list[dict[str, float]]) -> dict[str, Any]:
    own = np.array([round_[contender.name] for round_ in times])
    unit = np.array([round_[contender.unit] for round_ in times])
    ratios = unit / own if contender.faster else own / unit
    return {
        "name": contender.name,
        "what": contender.what,
        "us_per_sample": 1e6 * float(np.median(own)),
        "unit": contender.unit,
        "faster": contender.faster,
        "ratio": float(np.median(ratios)),
        "low": float(ratios.min()),
        "high": float(ratios.max()),
    }


def _timed(work: Callable[[], object], samples: int) -> Timed:
    def seconds() -> float:
        start = time.perf_counter()
        work()
        return (time.perf_counter() - start) / samples

    return seconds


def _estimators() -> list[Contender]:
    scenario = find_scenario("fm_step-v1")
    record = simulate(scenario, [0])[0]
    u, y = record.torque, record.speed
    assert y is not None  # a simulated record has all signals
    nominal = scenario.nominal.as_dict()
    model = three_mass(nominal)
    parametrization = model.parametrize(IDENTIFY)
    theta = parametrization.theta
    bounds = BOX[0] * theta, BOX[1] * theta
    rpem = Rpem(model, identify=IDENTIFY, P0=P0, bounds=bounds, period=0.005)
    literal = LiteralRpem(model, identify=IDENTIFY, P0=P0, bounds=bounds, period=0.005)
    ekf = joint_ekf(
        model, identify=IDENTIFY, P0=(0.1 * theta) ** 2, drift=(1e-4 * theta) ** 2, period=0.005
    )
    F, G, _ = extended_system(parametrization, theta)
    block = np.zeros((21, 21))
    block[:20, :20], block[:20, 20:] = F * scenario.period, G * scenario.period
    few, N = 600, len(u)
    unit = "expm"
    return [
        Contender(unit, "one scipy.linalg.expm of the 21×21 extended matrix", unit,
                  _timed(lambda: [expm(block) for _ in range(few)], few)),
        Contender("literal-rpem", "the paper word for word, expm in every sample", unit,
                  _timed(lambda: literal.run(u[:few], y[:few]), few)),
        Contender("c2d", "one control.c2d of the extended system", unit,
                  _timed(_c2d(F, G, scenario.period, few), few)),
        Contender("numpy-action", "16 products of the extended matrix with the state, NumPy", unit,
                  _timed(_numpy_action(block, 16, few), few)),
        Contender("rpem-run", "Rpem.run, one run on one thread", unit,
                  _timed(lambda: [rpem.run(u, y) for _ in range(25)], 25 * N)),
        Contender("rpem-run-2-threads", "Rpem.run, two runs on two threads, a run-sample",
                  "rpem-run", _timed(_threads(model, bounds, u, y), 50 * N)),
        Contender("rpem-step", "Rpem.step from Python, median", unit,
                  _steps(rpem, u, y, 50)),
        Contender("rpem-step-p99", "Rpem.step from Python, 99th percentile", unit,
                  _steps(rpem, u, y, 99)),
        Contender("ekf-run", "joint_ekf().run, one run on one thread", unit,
                  _timed(lambda: [ekf.run(u, y) for _ in range(3)], 3 * N)),
        *_filterpy(few),
        *_registered(u, y),
    ]  # fmt: skip


def _registered(u: Array, y: Array) -> list[Contender]:
    """Return shipped estimators as scenarios take them, and what one of them costs of the first."""
    scenario = find_scenario("fm_step-v1")
    found = []
    for name, repeats in REGISTERED.items():
        made: Any = REGISTRY[name].factory(
            scenario.nominal.as_dict(),
            scenario.period,
            identify=scenario.identify,
            output=scenario.output,
        )
        work = _repeated(made.run, u, y, repeats)
        summary = REGISTRY[name].summary
        time_of = _timed(work, repeats * len(u))
        found.append(Contender(name, summary, next(iter(REGISTERED)), time_of, faster=False))
    return found


def _repeated(run: Callable, u: Array, y: Array, repeats: int) -> Callable[[], object]:
    return lambda: [run(u, y) for _ in range(repeats)]


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


def _threads(model: Any, bounds: Any, u: Array, y: Array) -> Callable[[], object]:
    runs = [Rpem(model, identify=IDENTIFY, P0=P0, bounds=bounds, period=0.005) for _ in range(2)]

    def work() -> None:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(lambda rpem: [rpem.run(u, y) for _ in range(25)], runs))

    return work


def _steps(rpem: Rpem, u: Array, y: Array, percentile: float) -> Timed:
    pairs = list(zip(u.tolist(), y.tolist(), strict=True))

    def seconds() -> float:
        clock, step, marks = time.perf_counter, rpem.step, []
        for torque, speed in pairs:
            start = clock()
            step(torque, speed)
            marks.append(clock() - start)
        return float(np.percentile(marks, percentile))

    return seconds


def _filterpy(count: int) -> list[Contender]:
    """Return filterpy's filter, its algebra only: the Jacobians of a model come on top of it."""
    try:
        from filterpy.kalman import ExtendedKalmanFilter
    except ImportError:
        return []
    peer = ExtendedKalmanFilter(dim_x=8, dim_z=1)
    H = np.eye(1, 8)

    def work() -> None:
        for _ in range(count):
            peer.predict()
            peer.update(np.zeros(1), lambda x: H, lambda x: H @ x)

    return [
        Contender(
            "filterpy-ekf",
            "filterpy's ExtendedKalmanFilter, 8 states, without computing Jacobians",
            "expm",
            _timed(work, count),
        )
    ]


def _plants() -> list[Contender]:
    import mujoco

    from flexaxis.sim.controller import Controller

    scenario = find_scenario("fm_step-v1")
    steps = 200  # samples of 5 physics steps

    def loop() -> None:
        plant = Plant([scenario.nominal] * RUNS, period=scenario.period, substeps=5)
        controller = Controller(scenario.controller, RUNS, period=scenario.period)
        for _ in range(steps):
            plant.step(controller.torque(np.zeros(RUNS), plant.angle_m))

    model = Plant([scenario.nominal], period=scenario.period, substeps=5).model(0)
    data = mujoco.MjData(model)
    engine = _timed(lambda: mujoco.mj_step(model, data, nstep=1000), 1000)
    return [
        Contender("engine", "mj_step(nstep=1000), a physics step of 1 ms", "engine", engine),
        Contender("plant", f"closed loop of {RUNS} runs on one thread, a physics step", "engine",
                  _timed(loop, steps * 5 * RUNS), faster=False),
    ]  # fmt: skip
