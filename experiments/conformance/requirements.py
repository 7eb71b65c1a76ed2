"""The rules of `flexaxis check`: what an estimator must hold to for its scores to mean anything.

Each rule looks at fresh estimators on one simulated record, and says whether it holds (True), does
not (False) or does not apply (None), with what was seen.
"""

from __future__ import annotations

import inspect
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.conformance.subject import Subject, step

Array = NDArray[np.float64]


def futures(u: Array, y: Array, cut: int) -> Iterator[tuple[str, Array, Array]]:
    """Yield what was done, and u and y (N,) with all that comes after a sample changed.

    Parameters
    ----------
    u, y : ndarray (N,)
        A record; it is left as it is.
    cut : int
        The last sample that stays.
    """
    random = np.random.default_rng(0)
    past = slice(cut + 1)
    for words, other in _FUTURES.items():
        changed = [np.r_[signal[past], other(signal[cut + 1 :], random)] for signal in (u, y)]
        yield words, changed[0], changed[1]


def _scaled(future: Array, random: np.random.Generator) -> Array:
    """Return another mean, spread and largest size, for statistics of the whole record."""
    return 3 * random.permutation(future) + 2 * future.std()


def _other(future: Array, random: np.random.Generator) -> Array:
    """Return data of another distribution, for statistics that know no scale or no offset."""
    return future.mean() - future.std() + 0.3 * future.std() * random.standard_normal(len(future))


_FUTURES: Mapping[str, Callable[[Array, np.random.Generator], Array]] = {
    "shuffled, scaled and shifted": _scaled,
    "replaced by noise": _other,
}


Seen = tuple[bool | None, str]

GAP = slice(1200, 1300)
CUTS = (700, 1400, 2100)
FAR = 0.25  # share of nominal; who is farther off than most faults, shifted or not, has other ills
MOVES = 1e-9  # share of nominal; an estimator that moves less than this is frozen


@dataclass(frozen=True)
class Rule:
    """One rule: its name, why it matters, what to do about it, and how to look."""

    name: str
    reason: str
    hint: str
    look: Callable[[Subject], Seen]


def _prints_nothing(subject: Subject) -> Seen:
    text = io.StringIO()
    with redirect_stdout(text):
        subject.run()
    lines = text.getvalue().splitlines()
    return not lines, f"{len(lines)} lines in {len(subject.u)} samples" if lines else "nothing"


def _shapes(subject: Subject) -> Seen:
    shape, wanted = subject.theta.shape, (len(subject.u), len(subject.names))
    one = np.shape(subject.make().step(float(subject.u[0]), float(subject.y[0])))
    seen = f"run gives {shape}, step gives {one} for {', '.join(subject.names)}"
    return shape == wanted and one == wanted[1:], seen


def _finite(subject: Subject) -> Seen:
    wrong = np.flatnonzero(~np.isfinite(subject.theta).all(axis=1))
    if wrong.size:
        return False, f"not finite from sample {wrong[0]} on"
    return True, f"all of {len(subject.theta)} samples"


def _deterministic(subject: Subject) -> Seen:
    apart = subject.apart(subject.run(), subject.theta)
    return apart == 0, f"two runs differ by {apart:.2g} of nominal"


def _step_is_run(subject: Subject) -> Seen:
    if not hasattr(subject.make(), "run"):
        return None, "it has no run of its own"
    mixed, half = subject.make(), len(subject.u) // 2
    theta = np.vstack(
        [
            step(mixed, subject.u[:half], subject.y[:half]),
            run_estimator(mixed, subject.u[half:], subject.y[half:]),
        ]
    )
    apart = max(subject.apart(t, subject.theta) for t in (subject.stepped[0], theta))
    return apart < 1e-9, f"step, and step then run, differ from run by {apart:.2g} of nominal"


def _no_look_ahead(subject: Subject) -> Seen:
    for cut in CUTS:
        for words, u, y in futures(subject.u, subject.y, cut):
            changed = subject.run(u, y)[: cut + 1]
            apart = subject.gaps(changed, subject.theta[: cut + 1]).max(axis=1)
            wrong = np.flatnonzero(~(apart < 1e-12))
            if wrong.size:
                return False, (
                    f"samples after {cut} {words} changed the estimate at sample {wrong[0]}, "
                    f"{cut + 1 - wrong[0]} samples before, by {apart[wrong].max():.2g} of nominal"
                )
    return True, f"changing what comes after samples {', '.join(map(str, CUTS))} changes nothing"


def _keeps_nothing(subject: Subject) -> Seen:
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
    return _returns_fresh_arrays(subject)


def _returns_fresh_arrays(subject: Subject) -> Seen:
    estimator = subject.make()
    pairs = zip(subject.u[:500], subject.y[:500], strict=True)
    given = [estimator.step(float(a), float(b)) for a, b in pairs]
    wanted = step(subject.make(), subject.u[:500], subject.y[:500])
    if subject.apart(np.array(given, float), wanted) > 0:
        return False, "an array that step has returned changes at the next step"
    return True, "inputs and outputs are copies"


def _reset(subject: Subject) -> Seen:
    estimator = subject.make()
    reset = getattr(estimator, "reset", None)
    if reset is None:
        return None, "it has no reset"
    run_estimator(estimator, subject.u, subject.y)
    reset()
    apart = subject.apart(run_estimator(estimator, subject.u, subject.y), subject.theta)
    return apart < 1e-9, f"after reset a run differs from the first by {apart:.2g} of nominal"


def _gap(subject: Subject) -> Seen:
    theta = step(subject.make(), subject.u, subject.y, GAP)
    if not np.isfinite(theta).all():
        return False, "estimates are not finite after the gap"
    moved = subject.apart(theta[GAP], np.broadcast_to(theta[GAP.start - 1], theta[GAP].shape))
    if moved > 0.1:
        return False, f"estimates move by {_percent(moved)} of nominal while y is missing"
    estimator = subject.make()
    if not knows_gaps(estimator):
        return True, f"estimates move by {_percent(moved)} of nominal in it"
    valid = np.ones(len(subject.u), bool)
    valid[GAP] = False
    garbage = np.where(valid, subject.y, 1e3)
    apart = subject.apart(run_estimator(estimator, subject.u, garbage, valid), theta)
    return apart < 1e-9, f"run with `valid` differs from step with None by {apart:.2g} of nominal"


def knows_gaps(estimator: Estimator) -> bool:
    """Return whether `run` can be told which y are missing."""
    run = getattr(estimator, "run", None)
    return run is not None and len(inspect.signature(run).parameters) > 2


def _spike(subject: Subject) -> Seen:
    y = subject.y.copy()
    y[GAP.start] += 20 * y.std()
    theta = subject.run(y=y)
    if not np.isfinite(theta).all():
        return False, "estimates are not finite after it"
    return (
        True,
        f"finite; estimates move by {_percent(subject.apart(theta, subject.theta))} of nominal",
    )


def _percent(share: float) -> str:
    """Return a share of nominal in per cent, without an exponent where it is large."""
    return f"{100 * share:.2g} %" if share < 0.1 else f"{100 * share:.0f} %"


def _cost(subject: Subject) -> Seen:
    seconds = subject.stepped[1]
    return seconds < subject.scenario.period, f"{1e6 * seconds:.3g} µs a step"


def _shift_hurts(subject: Subject) -> Seen:
    moves = float((np.ptp(subject.theta, axis=0) / subject.nominal).max())
    if moves < MOVES:
        return None, "it does not move"
    right = subject.error(subject.theta)
    late = subject.error(subject.run(u=np.r_[0.0, subject.u[:-1]]))
    early = subject.error(subject.run(u=np.r_[subject.u[1:], 0.0]))
    seen = f"error {_percent(right)}, {_percent(late)} with u late, {_percent(early)} early"
    if min(right, late, early) > FAR:
        return False, f"{seen}: look at model, units and the order of names first"
    return right < min(late, early) / 1.5, seen


RULES: Sequence[Rule] = (
    Rule(
        "shapes",
        "scores are taken for each name, in the order of `names`",
        "return one number for each of `names` from step, and (N, p) from run",
        _shapes,
    ),
    Rule(
        "finite",
        "a run with an estimate that is not finite is counted as diverged",
        "bound the estimates, and keep P symmetric and positive",
        _finite,
    ),
    Rule(
        "deterministic",
        "a comparison cannot tell an own random number from an effect",
        "seed random numbers in the constructor; keep no state in the class or module",
        _deterministic,
    ),
    Rule(
        "step equals run",
        "the benchmark scores run, a robot uses step",
        "let run begin with the present state and leave it after the last sample",
        _step_is_run,
    ),
    Rule(
        "no look-ahead",
        "θ[k] may use y up to k only; an estimator that sees the future has no lag",
        "no smoothing, centred filter or statistics of the whole record in run",
        _no_look_ahead,
    ),
    Rule(
        "keeps no reference",
        "callers reuse their buffers, and keep what is returned",
        "copy what you keep of the inputs, return copies of θ, write into neither",
        _keeps_nothing,
    ),
    Rule(
        "reset",
        "a run after reset must be a first run",
        "put everything that step changes back to its value in the constructor",
        _reset,
    ),
    Rule(
        "survives a gap",
        "sensors miss samples: y is None, and what is not there must not move the estimates",
        "predict without an update while y is None",
        _gap,
    ),
    Rule(
        "finite after a spike",
        "one wrong sample must not end a run; how far it may move the estimates is not judged",
        "bound the estimates, or clip the residual",
        _spike,
    ),
    Rule(
        "prints nothing",
        "what is printed at every sample hides results, and takes longer than the estimates",
        "print nothing in step and run; keep what you want to see in attributes",
        _prints_nothing,
    ),
    Rule(
        "cost",
        "a step must be done before the next sample comes",
        "take work out of step, or compile it",
        _cost,
    ),
    Rule(
        "a shift of u hurts",
        "u[k] acts after y[k]; one sample late or early ruins the estimates without a message",
        "in step(u, y) use the u of the step before to predict y, then keep this u",
        _shift_hurts,
    ),
)
