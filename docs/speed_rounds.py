"""What a sample takes, timed in rounds: ratios within a round survive what absolute times do not.

Machines are shared and noisy, so every round measures all contenders one after the other, in the
processor time of this thread, and what is reported is the ratio to another one within the round,
its median and its range.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from speed_steps import registered, restart

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.models.discretisation import extended_system
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

Array = NDArray[np.float64]

Timed = Callable[[], float]  # seconds a sample, measured now
Clock = Callable[[], float]


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
    besides : str, optional
        Name of a second contender; it over this one is given as well.
    facts : dict
        What else its row says.
    """

    name: str
    what: str
    unit: str
    seconds: Timed
    faster: bool = True
    besides: str | None = None
    facts: dict[str, Any] = field(default_factory=dict)


def measure(contenders: Sequence[Contender], rounds: int = 7) -> Iterator[list[dict[str, Any]]]:
    """Yield the table of ratios after each round.

    Parameters
    ----------
    contenders : sequence of Contender
        With those that they are divided by.
    rounds : int
        How often each is measured.

    Yields
    ------
    list of dict
        ``name, what, us_per_sample`` (median), ``unit, faster, ratio, low, high``: median and
        range over the rounds so far; ``besides, times`` of it: the median; and its facts.
    """
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
    row = {
        "name": contender.name,
        "what": contender.what,
        "us_per_sample": 1e6 * float(np.median(own)),
        "unit": contender.unit,
        "faster": contender.faster,
        "ratio": float(np.median(ratios)),
        "low": float(ratios.min()),
        "high": float(ratios.max()),
    }
    if contender.besides is not None:
        other = np.array([round_[contender.besides] for round_ in times])
        row |= {"besides": contender.besides, "times": float(np.median(own / other))}
    return row | contender.facts


def timed(
    work: Callable[[], object], samples: int, clock: Clock = time.thread_time, before: Any = None
) -> Timed:
    """Return what measures some work.

    Parameters
    ----------
    work : callable
        Takes so many samples.
    samples : int
    clock : callable
        Time [s]; that of this thread by default, which a busy machine does not lengthen.
    before : callable, optional
        Called first, untimed.
    """

    def seconds() -> float:
        if before is not None:
            before()
        start = clock()
        work()
        return (clock() - start) / samples

    return seconds


IDENTIFY = ("k_T", "1/J_a", "f_m")
SCENARIO = "fm_step-v1"
BOX = (0.2, 5.0)  # times nominal
P0 = (2.97e-4, 5.19e-5, 4.69e-6)


@dataclass(frozen=True)
class Problem:
    """A record, and what is known of the axis.

    Attributes
    ----------
    scenario : Scenario
    u, y : ndarray (N,)
        Torque [N m] and speed [rad/s].
    quiet : (u, y)
        The same without the fault.
    """

    scenario: Scenario
    u: Array
    y: Array
    quiet: tuple[Array, Array]

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        return self.scenario.period

    @property
    def noise(self) -> float:
        """Standard deviation of y [rad/s]."""
        return float(self.scenario.noise.speed)

    @property
    def model(self) -> Model:
        """The axis, linear."""
        return three_mass(self.scenario.nominal.as_dict())

    @property
    def parametrization(self) -> Parametrization:
        """The model as a function of the three parameters of the paper."""
        return self.model.parametrize(IDENTIFY)

    @property
    def prior(self) -> tuple[Array, Array]:
        """Variance of θ(0), and what it gains in a sample: of the extended Kalman filters."""
        theta = self.parametrization.theta
        return (0.1 * theta) ** 2, (1e-4 * theta) ** 2


@cache
def problem() -> Problem:
    """Return what everything is timed on."""
    scenario = find_scenario(SCENARIO)
    signals = []
    for one in (scenario, scenario.override({"fault": []}, inherit=True)):
        record = simulate(one, [0])[0]
        assert record.speed is not None  # a simulated record has all signals
        signals.append((record.torque, record.speed))
    return Problem(scenario, *signals[0], quiet=signals[1])


EXPM, UNIT = "expm", "rpem-forgetting"
"""What the rivals are times of, and the paper's method, of which the estimators are."""
FEW, REPEATS = 600, 25  # samples of what is slow, runs of what is fast
WORK, SLOW = 100_000, 0.04  # samples of the fastest at once, and s that a slower one may take


def rivals(given: Problem) -> list[Contender]:
    """Return the matrix exponential, what uses it, and what does without."""
    parametrization = given.parametrization
    F, G, _ = extended_system(parametrization, parametrization.theta)
    block = np.zeros((len(F) + 1, len(F) + 1))
    block[:-1, :-1], block[:-1, -1:] = F * given.period, G * given.period
    ours = Rpem(given.model, **_options(given))

    def run() -> None:
        for _ in range(REPEATS):
            ours.run(given.u, given.y)

    return [
        Contender(EXPM, "one scipy.linalg.expm of the 21×21 extended matrix", EXPM,
                  timed(lambda: [expm(block) for _ in range(FEW)], FEW)),
        Contender("rpem-run", "Rpem.run, one run on one thread", EXPM,
                  timed(run, REPEATS * len(given.u))),
    ]  # fmt: skip


def _options(given: Problem) -> dict:
    theta = given.parametrization.theta
    bounds = BOX[0] * theta, BOX[1] * theta
    return {"identify": IDENTIFY, "P0": P0, "bounds": bounds, "period": given.period}


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
