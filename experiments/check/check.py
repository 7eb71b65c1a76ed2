"""Check whether an estimator follows the rules that are necessary for valid scores.

Each rule has a function that runs new instances of the estimator on a simulated record. The
function returns the outcome of the check and an explanation. The outcome is True if the estimator
follows the rule, False if the estimator breaks the rule, and None if the rule does not apply. The
explanation describes how the estimator behaved.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.running.user_code import EstimatorCrash, reported
from flexaxis.experiments.scoring.parameter_names import known_names, theta_over_time
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

ENCODER = "encoder_fm_step-v1"
DURATION = 12.0  # duration of the record [s], 2400 samples; the fault occurs at 10 s
BEFORE_FAULT = slice(1000, 2000)
GAP = slice(1200, 1300)
CUTS = (700, 1400, 2100)
FAR = 0.25  # largest allowed error relative to nominal, which is larger than most faults
MOVES = 1e-9  # an estimator is frozen if its estimates change by less than this relative value
SLACK = 1e-9  # tolerance for asymmetry and negative eigenvalues due to rounding errors


class Subject:
    """An estimator under test, and the record on which the rules are checked."""

    def __init__(self, spec: Spec, scenario: Scenario, record: Record) -> None:
        self.spec, self.scenario, self.u = spec, scenario, record.torque
        self.y: Array = getattr(record, scenario.output)
        self.names = tuple(self.make().names)
        known = known_names(scenario, self.names)
        self.known = [self.names.index(name) for name in known]
        self.truth = theta_over_time(scenario, known)

    def make(self) -> Estimator:
        """Construct a new estimator."""
        return build(self.spec, self.scenario)

    def run(self, u: Array, y: Array) -> Array:
        """Run a new estimator on copies of u and y; return the estimates as an array (N, p)."""
        return run_estimator(self.make(), u.copy(), y.copy())

    @cached_property
    def theta(self) -> Array:
        """Estimates for the unmodified record, as an array (N, p)."""
        return self.run(self.u, self.y)

    @cached_property
    def nominal(self) -> Array:
        """Absolute first estimates (p,), by which all differences are divided."""
        sizes = np.abs(self.theta[0])
        return np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)

    def gaps(self, one: Array, other: Array) -> Array:
        """Return the largest difference between the estimates of two runs at each sample.

        The estimates are arrays (N, p), and the result is an array (N,). The differences are
        divided by `nominal`, the absolute values of the first estimates.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            gap = np.abs(one - other) / self.nominal
        same = np.isclose(one, other, rtol=0, atol=0, equal_nan=True)  # `finite` checks for NaN
        return np.asarray(np.where(same, 0.0, gap).max(axis=1))

    def apart(self, one: Array, other: Array) -> float:
        """Return the largest relative difference between the estimates of two runs."""
        return float(self.gaps(one, other).max(initial=0.0))

    def error(self, theta: Array) -> float:
        """Return the relative rms error of the estimates before the fault.

        The rms error includes only parameters with known true values. The rms error is infinite if
        any estimate is not finite.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            errors = (theta[:, self.known] - self.truth) / self.truth[0]
            error = np.sqrt(np.mean(errors[BEFORE_FAULT] ** 2))
        return float(error) if np.isfinite(error) else np.inf


def step(estimator: Estimator, u: Array, y: Array, gap: slice = slice(0)) -> Array:
    """Call `step` for N samples, with y = None in `gap`; return the estimates (N, p)."""
    values: list[float | None] = y.tolist()
    values[gap] = [None] * len(values[gap])
    pairs = zip(u.tolist(), values, strict=True)
    return np.array([np.array(estimator.step(*pair), float) for pair in pairs])


Seen = tuple[bool | None, str]


def shapes(subject: Subject) -> Seen:
    """Check the shape of the estimates that `run` or `step` returns."""
    shape, expected = subject.theta.shape, (len(subject.u), len(subject.names))
    return shape == expected, (
        f"the estimates have the shape {shape} for {len(subject.u)} samples of the parameters "
        f"{', '.join(subject.names)}"
    )


def finite(subject: Subject) -> Seen:
    """Check that all estimates are finite, even if one sample of y contains a spike."""
    spiked = subject.y.copy()
    spiked[GAP.start] += 20 * spiked.std()
    for y, where in ((subject.y, "on the record"), (spiked, "after a spike in y")):
        if not np.isfinite(subject.run(subject.u, y)).all():
            return False, f"some estimates are not finite {where}"
    return True, "all estimates are finite, even with a spike in y"


def deterministic(subject: Subject) -> Seen:
    """Check that two runs on the same record give the same estimates."""
    apart = subject.apart(subject.run(subject.u, subject.y), subject.theta)
    return apart == 0, f"the relative difference between two identical runs is {apart:.2g}"


def step_equals_run(subject: Subject) -> Seen:
    """Check that the estimates do not depend on whether the caller uses `run`, `step` or both."""
    mixed, half = subject.make(), len(subject.u) // 2
    if not hasattr(mixed, "run"):
        return None, "the estimator has no run method"
    first = step(mixed, subject.u[:half], subject.y[:half])
    theta = np.vstack([first, run_estimator(mixed, subject.u[half:], subject.y[half:])])
    each = step(subject.make(), subject.u, subject.y)
    apart = max(subject.apart(t, subject.theta) for t in (each, theta))
    return apart < 1e-9, f"the relative difference between step and run is {apart:.2g}"


def no_look_ahead(subject: Subject) -> Seen:
    """Check that no estimate depends on future samples."""
    random = np.random.default_rng(0)

    def other(x: Array) -> Array:  # samples with a different mean, spread and distribution
        return x.mean() + x.std() * (2 + 3 * random.standard_t(3, len(x)))

    for cut in CUTS:
        u, y = (np.r_[x[: cut + 1], other(x[cut + 1 :])] for x in (subject.u, subject.y))
        apart = subject.gaps(subject.run(u, y)[: cut + 1], subject.theta[: cut + 1])
        wrong = np.flatnonzero(~(apart < 1e-12))
        if wrong.size:
            return False, (
                f"a change in u and y after sample {cut} changed the estimates by up to "
                f"{apart[wrong].max():.2g} times the nominal values; the first changed estimate is "
                f"at sample {wrong[0]}, {cut + 1 - wrong[0]} samples before the change"
            )
    return True, f"changes after samples {', '.join(map(str, CUTS))} affected no earlier estimates"


def keeps_no_reference(subject: Subject) -> Seen:
    """Check that the estimator stores copies of its inputs, and modifies no inputs or outputs."""
    u, y, half = subject.u.copy(), subject.y.copy(), len(subject.u) // 2
    reused, kept = subject.make(), subject.make()
    run_estimator(reused, u[:half], y[:half])
    intact = np.array_equal((u, y), (subject.u, subject.y))
    run_estimator(kept, subject.u[:half], subject.y[:half])
    u[:half] = y[:half] = 1e6
    rest, expected = (run_estimator(e, subject.u[half:], subject.y[half:]) for e in (reused, kept))
    estimator = subject.make()
    first = estimator.step(subject.u[0], subject.y[0])
    before = np.array(first, float)
    step(estimator, subject.u[1:500], subject.y[1:500])
    faults = {
        "run modifies its input arrays": not intact,
        "overwriting old input arrays changed later estimates": subject.apart(rest, expected) > 0,
        "an array that step returned changed in later calls": not np.array_equal(first, before),
    }
    seen = [text for text, wrong in faults.items() if wrong]
    return not seen, ", ".join(seen) or "the estimator copies its inputs and outputs"


def reset(subject: Subject) -> Seen:
    """Check that a run after `reset` gives the same estimates as the first run."""
    estimator = subject.make()
    if not hasattr(estimator, "reset"):
        return None, "the estimator has no reset method"
    run_estimator(estimator, subject.u, subject.y)
    estimator.reset()
    apart = subject.apart(run_estimator(estimator, subject.u, subject.y), subject.theta)
    return apart < 1e-9, f"the relative difference of runs before and after reset is {apart:.2g}"


def survives_a_gap(subject: Subject) -> Seen:
    """Check that estimates stay finite and nearly constant if y is missing for 100 samples."""
    theta = step(subject.make(), subject.u, subject.y, GAP)
    if not np.isfinite(theta).all():
        return False, "some estimates are not finite if y is missing"
    moved = subject.apart(theta[GAP], theta[GAP.start - 1])
    return moved <= 0.1, f"the estimates change by up to {moved:.1%} while y is missing"


def covariance(subject: Subject) -> Seen:
    """Check that the reported covariance is symmetric and positive semidefinite at all samples."""
    estimator, p = subject.make(), len(subject.names)
    if getattr(estimator, "covariance", None) is None:
        return None, "the estimator reports no covariance"
    for k in range(len(subject.u)):
        step(estimator, subject.u[[k]], subject.y[[k]])
        C = np.asarray(estimator.covariance, float)  # type: ignore[attr-defined, type-var]
        if C.shape == (p, p) and np.isfinite(C).all():
            scale = np.sqrt(np.abs(C.diagonal()) + np.finfo(float).tiny)
            R = C / np.outer(scale, scale)
            if np.abs(R - R.T).max() <= SLACK and np.linalg.eigvalsh(R).min() >= -SLACK:
                continue
        seen = f"the covariance at sample {k} is not a symmetric positive semidefinite matrix: {C}"
        return False, seen
    return True, "the covariance is symmetric and positive semidefinite at every sample"


def cost(subject: Subject) -> Seen:
    """Check that a call to `step` takes less time than one sampling period."""
    estimator = subject.make()
    step(estimator, subject.u[:2], subject.y[:2])  # compiles the estimator if it uses numba
    start = time.perf_counter()
    step(estimator, subject.u, subject.y)
    seconds = (time.perf_counter() - start) / len(subject.u)
    return seconds < subject.scenario.period, f"{1e6 * seconds:.3g} µs per step"


def a_shift_of_u_hurts(subject: Subject) -> Seen:
    """Check that the estimates worsen if the torque u is one sample early or late."""
    if (np.ptp(subject.theta, axis=0) / subject.nominal).max() < MOVES:
        return None, "the estimates are constant"
    shifted = (np.r_[0.0, subject.u[:-1]], np.r_[subject.u[1:], 0.0])
    right = subject.error(subject.theta)
    late, early = (subject.error(subject.run(u, subject.y)) for u in shifted)
    seen = f"the error is {right:.1%}, but {late:.1%} if u is late, and {early:.1%} if u is early"
    return right < min(FAR, late / 1.5, early / 1.5), seen


RULES: dict[Callable[[Subject], Seen], tuple[str, str]] = {
    shapes: (
        "the benchmark computes scores for each parameter, in the order of `names`",
        "return one estimate per parameter from step, and an array (N, p) from run",
    ),
    finite: (
        "a run counts as diverged if any estimate is not finite, and a single wrong sample must "
        "not make a run diverge",
        "limit the estimates, clip the residual, and keep P symmetric and positive definite",
    ),
    deterministic: (
        "if the estimates of a record vary from run to run, a comparison cannot distinguish random "
        "variations from real differences between estimators",
        "seed the random generator in the constructor, and store no state in the class or module",
    ),
    step_equals_run: (
        "the benchmark calls run and a robot controller calls step, so run and step must agree",
        "let `run` start from the current state, and store the state after the last sample",
    ),
    no_look_ahead: (
        "θ[k] must not depend on future samples, because future samples would hide the "
        "estimator's lag",
        "do not use smoothing, centred filters or statistics of the whole record in run",
    ),
    keeps_no_reference: (
        "callers reuse their input buffers and keep the returned arrays, so the estimator must not "
        "share arrays with its caller",
        "copy all inputs that the estimator stores, return a copy of θ, and do not modify the "
        "inputs",
    ),
    reset: (
        "a run after reset must give the same estimates as the first run",
        "in reset, restore the initial value of every attribute that step changes",
    ),
    survives_a_gap: (
        "sensors can lose samples (y is None), and a lost sample must not change the estimates",
        "if y is None, predict the state, but do not update the estimates",
    ),
    covariance: (
        "the NEES and fault detection use the reported covariance, and a negative variance is "
        "meaningless",
        "update P with the Joseph form, or replace P by (P + Pᵀ)/2 after each update",
    ),
    cost: (
        "a call to step must finish before the next sample arrives",
        "move computations from step to the constructor, or compile step",
    ),
    a_shift_of_u_hurts: (
        "u[k] acts after the measurement of y[k], and an estimator that shifts u by one sample "
        "gives wrong estimates",
        "in step(u, y), use u from the previous call to predict y, and then store the new u. If "
        "the error is large for every shift of u, check the model, the units, the order of names "
        "and the attribute `output`",
    ),
}
"""Reason for each rule, and a hint on how to follow it."""


@dataclass(frozen=True)
class RuleResult:
    """The result of checking one rule; `holds` is None if the rule does not apply."""

    rule: str
    holds: bool | None
    seen: str
    reason: str
    hint: str


def check(spec: Spec, *, store: RecordCache | None = None) -> list[RuleResult]:
    """Check whether an estimator follows each rule, and return the results.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If the estimator cannot be constructed.
    """
    subject, results = _subject(spec, store), []
    for look, texts in RULES.items():
        name, holds = look.__name__.replace("_", " "), False
        try:
            with reported(spec.text, "during the check"):
                holds, seen = look(subject)  # type: ignore[assignment]
        except (EstimatorCrash, EstimatorError) as error:
            seen = str(error).removeprefix(f"{spec.text}, during the check, ")
        results.append(RuleResult(name, holds, seen, *texts))
    return results


def _subject(spec: Spec, store: RecordCache | None) -> Subject:
    # the estimator may use the speed, the angle of an encoder, or the increments of this angle
    for name, output in (("fm_step-v1", "speed"), (ENCODER, "angle"), (ENCODER, "increment")):
        changes = {"name": "check", "duration": DURATION, "output": output}
        scenario = find_scenario(name).override(changes)
        with suppress(EstimatorError):
            build(spec, scenario)
            break
    # if `build` failed for all outputs, `Subject` raises the error again
    return Subject(spec, scenario, records(scenario, [0], store)[0])
