"""The rules that the scores of an estimator rely on, each a function of a subject.

A rule looks at fresh estimators on one simulated record. It returns whether it holds (True), does
not (False) or does not apply (None), and what was seen.
"""

from __future__ import annotations

import inspect
import io
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.scoring.parameter_names import known_names, nominal_theta, theta_over_time
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

DURATION = 12.0  # s, 2400 samples; the fault is at 10 s
BEFORE_FAULT = slice(1000, 2000)
GAP = slice(1200, 1300)
CUTS = (700, 1400, 2100)
FAR = 0.25  # share of nominal; an error beyond it is larger than most faults
MOVES = 1e-9  # share of nominal; an estimator that moves less is frozen
SLACK = 1e-9  # of a correlation: what rounding may make of symmetry and of an eigenvalue of zero


class Subject:
    """An estimator under test, and the record that it is tested on."""

    def __init__(self, spec: Spec, scenario: Scenario, record: Record) -> None:
        self.spec, self.scenario, self.u = spec, scenario, record.torque
        self.y: Array = getattr(record, scenario.output)
        self.names = tuple(self.make().names)
        known = known_names(scenario, self.names)
        self.known = [self.names.index(name) for name in known]
        self.truth = theta_over_time(scenario, known)

    def make(self) -> Estimator:
        """Return a fresh estimator."""
        return build(self.spec, self.scenario)

    def run(self, u: Array | None = None, y: Array | None = None) -> Array:
        """Return the estimates (N, p) of a fresh estimator; its inputs are copies."""
        u, y = (self.u if u is None else u), (self.y if y is None else y)
        return run_estimator(self.make(), u.copy(), y.copy())

    @cached_property
    def theta(self) -> Array:
        """Estimates on the record as it is."""
        return self.run()

    @cached_property
    def nominal(self) -> Array:
        """Sizes (p,) of the parameters; without a truth, that of the largest estimate."""
        sizes = np.abs(self.theta).max(axis=0)
        sizes[~(np.isfinite(sizes) & (sizes > 0))] = 1.0
        names = [self.names[i] for i in self.known]
        sizes[self.known] = np.abs(nominal_theta(self.scenario, names))
        return sizes

    def gaps(self, one: Array, other: Array) -> Array:
        """Return the differences (N, p) of two runs, as shares of nominal."""
        with np.errstate(invalid="ignore", over="ignore"):
            gap = np.abs(one - other) / self.nominal
        same = (one == other) | (np.isnan(one) & np.isnan(other))  # `finite` judges NaN
        return np.where(same, 0.0, gap)

    def apart(self, one: Array, other: Array) -> float:
        """Return the largest difference of two runs, as a share of nominal."""
        return float(np.max(self.gaps(one, other), initial=0.0))

    def error(self, theta: Array) -> float:
        """Return the rms error before the fault as a share of nominal, of all that has a truth."""
        with np.errstate(invalid="ignore", over="ignore"):
            errors = (theta[:, self.known] - self.truth) / self.nominal[self.known]
            error = np.sqrt(np.mean(errors[BEFORE_FAULT] ** 2))
        return float(error) if np.isfinite(error) else np.inf


def steps(estimator: Estimator, u: Array, y: Array, gap: slice = slice(0)) -> Iterator[Array]:
    """Yield the estimates (p,) step by step, without y in the gap."""
    values: list[float | None] = y.tolist()
    values[gap] = [None] * len(values[gap])
    for pair in zip(u.tolist(), values, strict=True):
        yield np.array(estimator.step(*pair), float)


def step(estimator: Estimator, u: Array, y: Array, gap: slice = slice(0)) -> Array:
    """Return the estimates (N, p) step by step, without y in the gap."""
    return np.array(list(steps(estimator, u, y, gap)))


Seen = tuple[bool | None, str]
Look = Callable[[Subject], Seen]


@dataclass(frozen=True)
class Rule:
    """One rule: its name, why it matters, what to do about it, and how to look."""

    name: str
    reason: str
    hint: str
    look: Look


RULES: list[Rule] = []


def rule(reason: str, hint: str) -> Callable[[Look], Look]:
    """Register a function as a rule, under its name."""

    def register(look: Look) -> Look:
        RULES.append(Rule(look.__name__.replace("_", " "), reason, hint, look))
        return look

    return register


@rule(
    "scores are taken for each name, in the order of `names`",
    "return one number for each of `names` from step, and (N, p) from run",
)
def shapes(subject: Subject) -> Seen:
    """Look at the shapes that run and step return."""
    shape, expected = subject.theta.shape, (len(subject.u), len(subject.names))
    one = np.shape(subject.make().step(float(subject.u[0]), float(subject.y[0])))
    seen = f"run gives {shape}, step gives {one} for {', '.join(subject.names)}"
    return shape == expected and one == expected[1:], seen


@rule(
    "a run with an estimate that is not finite counts as diverged",
    "bound the estimates, and keep P symmetric and positive",
)
def finite(subject: Subject) -> Seen:
    """Look for estimates that are not finite."""
    wrong = np.flatnonzero(~np.isfinite(subject.theta).all(axis=1))
    if wrong.size:
        return False, f"not finite from sample {wrong[0]} on"
    return True, f"all of {len(subject.theta)} samples"


@rule(
    "a comparison cannot tell a random number from an effect",
    "seed random numbers in the constructor; keep no state in the class or module",
)
def deterministic(subject: Subject) -> Seen:
    """Run it twice."""
    apart = subject.apart(subject.run(), subject.theta)
    return apart == 0, f"two runs differ by {apart:.2g} of nominal"


@rule(
    "the benchmark scores run, a robot uses step",
    "let run begin with the present state and leave it after the last sample",
)
def step_equals_run(subject: Subject) -> Seen:
    """Compare step, and step then run, with run."""
    if not hasattr(subject.make(), "run"):
        return None, "it has no run of its own"
    mixed, half = subject.make(), len(subject.u) // 2
    first = step(mixed, subject.u[:half], subject.y[:half])
    theta = np.vstack([first, run_estimator(mixed, subject.u[half:], subject.y[half:])])
    each = step(subject.make(), subject.u, subject.y)
    apart = max(subject.apart(t, subject.theta) for t in (each, theta))
    return apart < 1e-9, f"step, and step then run, differ from run by {apart:.2g} of nominal"


@rule(
    "θ[k] may use y up to k only; an estimator that sees the future has no lag",
    "no smoothing, centred filter or statistics of the whole record in run",
)
def no_look_ahead(subject: Subject) -> Seen:
    """Change the future, in two ways, and look for changes in the past."""
    random = np.random.default_rng(0)
    changes: dict[str, Callable[[Array], Array]] = {
        # another mean, spread and largest size, for statistics of the whole record
        "shuffled, scaled and shifted": lambda x: 3 * random.permutation(x) + 2 * x.std(),
        # another distribution, for statistics that know no scale or no offset
        "replaced by noise": lambda x: x.mean() + x.std() * (0.3 * random.normal(size=len(x)) - 1),
    }
    for cut in CUTS:
        for words, other in changes.items():
            u, y = (np.r_[x[: cut + 1], other(x[cut + 1 :])] for x in (subject.u, subject.y))
            past = subject.run(u, y)[: cut + 1]
            apart = subject.gaps(past, subject.theta[: cut + 1]).max(axis=1)
            wrong = np.flatnonzero(~(apart < 1e-12))
            if wrong.size:
                return False, (
                    f"samples after {cut} {words} changed the estimate at sample {wrong[0]}, "
                    f"{cut + 1 - wrong[0]} samples before, by {apart[wrong].max():.2g} of nominal"
                )
    return True, f"changing what comes after samples {', '.join(map(str, CUTS))} changes nothing"


@rule(
    "callers reuse their buffers, and keep what is returned",
    "copy what you keep of the inputs, return copies of θ, write into neither",
)
def keeps_no_reference(subject: Subject) -> Seen:
    """Overwrite inputs, and look whether inputs, or outputs kept, change."""
    u, y, half = subject.u.copy(), subject.y.copy(), len(subject.u) // 2
    estimator = subject.make()
    first = run_estimator(estimator, u[:half], y[:half])
    kept = first.copy()
    if not (np.array_equal(u, subject.u) and np.array_equal(y, subject.y)):
        return False, "run writes into the arrays it is given"
    u[:half] = y[:half] = 1e6
    rest = run_estimator(estimator, u[half:], y[half:])
    whole = subject.make()
    run_estimator(whole, subject.u[:half].copy(), subject.y[:half].copy())
    if subject.apart(rest, run_estimator(whole, subject.u[half:], subject.y[half:])) > 0:
        return False, "overwriting inputs of the past changed later estimates"
    if subject.apart(kept, first) > 0:
        return False, "estimates that run has returned changed later"
    short = subject.u[:500], subject.y[:500]
    estimator = subject.make()
    returned = [estimator.step(*pair) for pair in zip(*map(np.ndarray.tolist, short), strict=True)]
    if subject.apart(np.array(returned, float), step(subject.make(), *short)) > 0:
        return False, "an array that step has returned changes at the next step"
    return True, "inputs and outputs are copies"


@rule(
    "a run after reset must be a first run",
    "put everything that step changes back to its value in the constructor",
)
def reset(subject: Subject) -> Seen:
    """Run it, reset it, and run it again."""
    estimator = subject.make()
    if not hasattr(estimator, "reset"):
        return None, "it has no reset"
    run_estimator(estimator, subject.u, subject.y)
    estimator.reset()
    apart = subject.apart(run_estimator(estimator, subject.u, subject.y), subject.theta)
    return apart < 1e-9, f"after reset a run differs from the first by {apart:.2g} of nominal"


@rule(
    "sensors miss samples: y is None, and a missing sample must not move the estimates",
    "predict without an update while y is None",
)
def survives_a_gap(subject: Subject) -> Seen:
    """Leave out y for 100 samples, by step and by run."""
    theta = step(subject.make(), subject.u, subject.y, GAP)
    if not np.isfinite(theta).all():
        return False, "estimates are not finite after the gap"
    moved = subject.apart(theta[GAP], np.broadcast_to(theta[GAP.start - 1], theta[GAP].shape))
    if moved > 0.1:
        return False, f"estimates move by {_percent(moved)} of nominal while y is missing"
    estimator = subject.make()
    run = getattr(estimator, "run", None)
    if run is None or len(inspect.signature(run).parameters) < 3:  # it takes no `valid`
        return True, f"estimates move by {_percent(moved)} of nominal in it"
    valid = np.ones(len(subject.u), bool)
    valid[GAP] = False
    garbage = np.where(valid, subject.y, 1e3)
    apart = subject.apart(run_estimator(estimator, subject.u, garbage, valid), theta)
    return apart < 1e-9, f"run with `valid` differs from step with None by {apart:.2g} of nominal"


@rule(
    "one wrong sample must not end a run; how far it may move the estimates is not judged",
    "bound the estimates, or clip the residual",
)
def finite_after_a_spike(subject: Subject) -> Seen:
    """Add a spike of 20 standard deviations to one sample of y."""
    y = subject.y.copy()
    y[GAP.start] += 20 * y.std()
    theta = subject.run(y=y)
    if not np.isfinite(theta).all():
        return False, "estimates are not finite after it"
    moved = _percent(subject.apart(theta, subject.theta))
    return True, f"finite; estimates move by {moved} of nominal"


@rule(
    "NEES and fault detection rely on the claimed covariance; a negative variance means nothing",
    "update P in Joseph's form, or symmetrise it as (P + Pᵀ)/2",
)
def covariance(subject: Subject) -> Seen:
    """Look whether the claimed covariance is symmetric and positive semidefinite everywhere."""
    estimator, p = subject.make(), len(subject.names)
    if getattr(estimator, "covariance", None) is None:
        return None, "it claims none"
    for k, _ in enumerate(steps(estimator, subject.u, subject.y)):
        C = np.asarray(estimator.covariance, float)  # type: ignore[attr-defined, type-var]
        if C.shape != (p, p) or not np.isfinite(C).all() or C.diagonal().min() < 0:
            return False, f"sample {k}: no finite matrix ({p}, {p}) of variances above 0: {C}"
        scale = np.sqrt(np.maximum(C.diagonal(), np.finfo(float).tiny))
        R = C / np.outer(scale, scale)
        if np.abs(R - R.T).max() > SLACK:
            return False, f"sample {k}: not symmetric: {C}"
        if np.linalg.eigvalsh(R).min() < -SLACK * p:
            return False, f"sample {k}: a negative eigenvalue: {C}"
    return True, "symmetric and positive semidefinite at every sample"


@rule(
    "printing at every sample hides results, and takes longer than the estimates",
    "print nothing in step and run; keep what you want to see in attributes",
)
def prints_nothing(subject: Subject) -> Seen:
    """Look at what a run prints."""
    text = io.StringIO()
    with redirect_stdout(text):
        subject.run()
    lines = text.getvalue().splitlines()
    return not lines, f"{len(lines)} lines in {len(subject.u)} samples" if lines else "nothing"


@rule("a step must be done before the next sample comes", "take work out of step, or compile it")
def cost(subject: Subject) -> Seen:
    """Take the time of a step."""
    step(subject.make(), subject.u[:2], subject.y[:2])  # so that all is compiled
    estimator, start = subject.make(), time.perf_counter()
    step(estimator, subject.u, subject.y)
    seconds = (time.perf_counter() - start) / len(subject.u)
    return seconds < subject.scenario.period, f"{1e6 * seconds:.3g} µs a step"


@rule(
    "u[k] acts after y[k]; one sample late or early ruins the estimates without a message",
    "in step(u, y) use the u of the step before to predict y, then keep this u",
)
def a_shift_of_u_hurts(subject: Subject) -> Seen:
    """Shift u by a sample either way; the estimates must be best as it is."""
    moves = float((np.ptp(subject.theta, axis=0) / subject.nominal).max())
    if moves < MOVES:
        return None, "it does not move"
    shifted = (np.r_[0.0, subject.u[:-1]], np.r_[subject.u[1:], 0.0])
    right = subject.error(subject.theta)
    late, early = (subject.error(subject.run(u=u)) for u in shifted)
    seen = f"error {_percent(right)}, {_percent(late)} with u late, {_percent(early)} early"
    if min(right, late, early) > FAR:
        return False, f"{seen}: look at model, units and the order of names first"
    return right < min(late, early) / 1.5, seen


def _percent(share: float) -> str:
    """Return a share of nominal in per cent, without an exponent where it is large."""
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"
