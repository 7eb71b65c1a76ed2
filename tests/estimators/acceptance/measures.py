"""What is measured of one estimator: the numbers behind `test_everywhere` and `tables`."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from acceptance.axes import AXES, NAMES, SIGMA, Run, scaled, simulate, theta_of
from acceptance.disturbances import Disturbed
from acceptance.units import SI, Units
from flexaxis.estimators.protocol import run_estimator
from flexaxis.estimators.registry import REGISTRY

ONSET = 10.0  # s, of the fault of which the claims are judged
AGES = (20, 50, 100, 200)  # samples after it


@cache
def nominal_torque(axis: str, period: float) -> np.ndarray:
    """Torque (N,) of 20 s without a fault, for the recipe of P(0)."""
    return simulate(AXES[axis], 20.0, period=period, seed=99).u


def make(
    name: str,
    *,
    axis: str = "n1",
    period: float = 0.005,
    start: float = 1.0,
    units: Units = SI,
    identify: tuple[str, ...] = NAMES,
    onsets: tuple[int, ...] = (),
    **options: float,
):
    """A registered estimator for an axis; θ(0) is ``start`` times the truth."""
    if name == "oracle-reset":
        options["onsets"] = onsets
    return REGISTRY[name].factory(
        units.model(scaled(AXES[axis], start, identify)),
        period,
        identify=identify,
        output="speed",
        torque=units.torque(nominal_torque(axis, period)),
        **options,
    )


def stepped(
    axis: str,
    seconds: float,
    *,
    at: float,
    seed: int,
    period: float = 0.005,
    parameter: str = "f_m",
    factor: float = 1.5,
    sigma: float = SIGMA,
) -> Run:
    """A run in which a parameter jumps."""
    after = AXES[axis] | {parameter: factor * AXES[axis][parameter]}
    return simulate(AXES[axis], seconds, period=period, seed=seed, sigma=sigma, faults={at: after})


def unit_error(
    name: str, units: Units, *, axis: str, period: float, seconds: float, seed: int = 0
) -> float:
    """
    How far θ̂ in other units is from θ̂ in SI, relative to θ, at most.

    The start is 20 % off and f_m grows by half after 60 % of the time.
    """
    run = stepped(axis, seconds, at=0.6 * seconds, seed=seed, period=period)
    onsets = (run.samples(0.6 * seconds),)
    found = []
    for given in (SI, units):
        made = make(name, axis=axis, period=period, start=1.2, units=given, onsets=onsets)
        found.append(run_estimator(made, *given.signals(run)) / given.theta())
    apart = np.abs(found[1] - found[0]) / theta_of(AXES[axis])
    return float(apart.max()) if np.isfinite(apart).all() else np.inf


def relative_rms(theta: np.ndarray, run: Run, seconds: float = 5.0) -> float:
    """The largest rms error of a parameter over the last seconds, relative to it."""
    last = slice(-run.samples(seconds), None)
    error = theta[last] / run.theta[last] - 1
    return float(np.sqrt(np.mean(error**2, axis=0)).max())


@dataclass(frozen=True)
class Outcome:
    """What came of a run: finite, final error (5 s, relative), findings in all and in the rest."""

    finite: bool
    error: float
    findings: int
    at_rest: int


def outcome(estimator, given: Disturbed) -> Outcome:
    """Run it and judge what it says."""
    run = given.run
    missing = () if given.valid.all() else (given.valid,)
    theta = run_estimator(estimator, run.u, run.y, *missing)
    found = getattr(estimator, "findings", ())
    finite = bool(np.isfinite(theta).all() and np.isfinite(estimator.covariance).all())
    at_rest = sum(given.rest[0] <= finding.alarm < given.rest[1] for finding in found)
    return Outcome(finite, relative_rms(theta, run), len(found), at_rest)


def undisturbed(axis: str, period: float, seconds: float = 40.0, seed: int = 0) -> Disturbed:
    run = simulate(AXES[axis], seconds, period=period, seed=seed)
    return Disturbed(run, np.ones(len(run.u), bool), (0, 0))


@dataclass(frozen=True)
class Claims:
    """
    NEES over p before a fault of f_m and so many samples after it: mean, and its deviation.

    Attributes
    ----------
    mean, deviation : (1 + len(AGES),) arrays
        1 is a claim that is right. The deviation is that of the mean over runs.
    """

    mean: np.ndarray
    deviation: np.ndarray


def claims(name: str, runs: Mapping[int, Run], identify: tuple[str, ...] = NAMES) -> Claims:
    """NEES of an estimator over runs with a fault at `ONSET`."""
    onset = round(ONSET / 0.005)
    estimator = make(name, identify=identify, onsets=(onset,))
    columns = [NAMES.index(parameter) for parameter in identify]
    ratios = []
    for run in runs.values():
        estimator.reset()
        ratios.append(_ratios(estimator, run, run.theta[:, columns], onset))
    ratios = np.array(ratios)
    return Claims(ratios.mean(axis=0), ratios.std(axis=0) / np.sqrt(len(ratios)))


def _ratios(estimator, run: Run, truth: np.ndarray, onset: int) -> list[float]:
    found, done = [], 0
    before = [onset - 200 * i for i in range(4, -1, -1)]  # a second apart: nearly independent
    for stop in [*before, *(onset + age for age in AGES)]:
        theta = run_estimator(estimator, run.u[done:stop], run.y[done:stop])[-1]
        error, done = theta - truth[stop - 1], stop
        with np.errstate(all="ignore"):
            square = error @ np.linalg.solve(np.asarray(estimator.covariance), error)
        found.append(float(square) / len(error))
    return [float(np.mean(found[: len(before)])), *found[len(before) :]]
