"""A case: one estimator on one record, scored."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.away import Away, there
from flexaxis.experiments.building.estimator_text import Spec
from flexaxis.experiments.building.guest import hosted, is_guest, note
from flexaxis.experiments.building.pipe import PipeEstimator
from flexaxis.experiments.building.ready import ready
from flexaxis.experiments.running.adapted import tracking
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.summary import Case, scored
from flexaxis.experiments.scoring.windows import claimed_at
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.events import first_onset
from flexaxis.sim.timing import sample_index


def warm(spec: Spec, scenario: Scenario) -> None:
    """Let an estimator compile what it compiles, so that the cost scored is that of running."""
    rest = np.zeros(2)
    _estimates(
        spec.text, ready(spec, scenario), rest, rest, None, where=f"{scenario.name} (warm-up)"
    )


def case_id(scenario_hash: str, estimator: str, seed: int | None) -> str:
    """Return the identity of a case: 64 bits in hexadecimal."""
    return sha256(f"{scenario_hash} {estimator} {seed}".encode()).hexdigest()[:16]


def identity_of(scenario: Scenario, estimator: str, seed: int | None) -> dict[str, Any]:
    """Return what tells a case from others, and the onset [s] where that is drawn."""
    found = {
        "case": case_id(scenario.hash, estimator, seed),
        "hash": scenario.hash,
        "scenario": scenario.name,
        "estimator": estimator,
        "seed": seed,
    }
    if scenario.onset_spread is None:
        return found
    return found | {"onset": first_onset(scenario.drawn(seed or 0)) * scenario.period}


def run_case(scenario: Scenario, record: Record, spec: Spec) -> Case:
    """Run an estimator on a record and score it.

    Raises
    ------
    EstimatorError
        If the estimator raises, or returns what it may not.
    """
    mine = scenario.drawn(record.seed or 0)
    estimator = ready(spec, mine)
    clock = clock_of(estimator)
    start = clock()
    theta, claimed, innovations = followed(spec.text, estimator, mine, record)
    seconds = clock() - start
    findings = getattr(estimator, "findings", None)
    track = track_of(mine, record, estimator.names, theta, claimed, innovations, findings)
    if scenario.controller.adapt:
        track = replace(track, tracking=tracking(scenario, record.seed or 0, spec))
    identity = identity_of(scenario, spec.text, record.seed)
    cost = {
        "us_per_sample": 1e6 * seconds / len(theta),
        "seconds": seconds,
        "host": platform.node(),
    }
    return scored(track, estimator=spec.text, written=scenario, identity=identity, cost=cost)


def clock_of(estimator: Any) -> Callable[[], float]:
    """Return what tells how long an estimator takes [s]: the time of its thread alone.

    What else runs on the machine does not count. Of a program it is the clock on the wall.
    """
    if isinstance(estimator, Away):
        return lambda: estimator.spent
    return time.perf_counter if isinstance(estimator, PipeEstimator) else time.thread_time


def track_of(  # noqa: PLR0917
    scenario: Scenario,
    record: Record,
    estimated: Sequence[str],
    theta: NDArray[np.float64],
    claimed: Any,
    innovations: NDArray[np.float64] | None,
    findings: Sequence[Any] | None,
) -> Track:
    """Return what is scored of estimates (N, p): the parameters whose truth has a size.

    Parameters
    ----------
    scenario : Scenario
    record : Record
        A simulated one, which knows the truth.
    estimated : sequence of str
        Names of all p estimates.
    theta, claimed, innovations
        As from `followed`.
    findings : sequence or None
        What the estimator detected.
    """
    assert record.true_parameters is not None
    names = known_names(scenario, estimated)
    mine = [list(estimated).index(name) for name in names]
    return Track(
        scenario=scenario,
        names=names,
        theta=theta[:, mine],
        true_parameters=record.true_parameters,
        torque=record.torque,
        claimed=_of(claimed, mine, len(estimated)),
        innovations=innovations,
        findings=findings,
    )


def _of(claimed: Any, mine: list[int], p: int) -> Any:
    """Return what is claimed of some of the p parameters; what is no such matrix, as it is."""
    if len(mine) == p or np.shape(claimed) != (p, p):
        return claimed
    return np.asarray(claimed)[np.ix_(mine, mine)]


def followed(
    text: str, estimator: Any, scenario: Scenario, record: Record
) -> tuple[NDArray[np.float64], Any, NDArray[np.float64] | None]:
    """Run an estimator on a whole record, and keep what it claims.

    Parameters
    ----------
    text : str
        Its name, for messages.
    estimator : Estimator
    scenario : Scenario
        For the first fault.
    record : Record

    Returns
    -------
    theta : ndarray (N, p)
    claimed : ndarray (p, p) or None
        Covariance that it claims before the first fault, as `claimed_at` has it.
    innovations : ndarray (N, 2) or None

    Raises
    ------
    EstimatorError
        If the estimator raises, or returns what it may not.
    """
    where, samples = f"{scenario.name}, seed {record.seed}", len(record.time)
    y = getattr(record, estimator.output)
    valid = record.valid
    parts, innovations = [], []
    claimed = None
    for part in pieces(scenario, estimator, samples):
        gaps = None if valid is None else valid[part]
        u = record.torque[part]
        at: dict[str, Any] = {"first": part.start, "period": scenario.period}
        parts.append(_estimates(text, estimator, u, y[part], gaps, where=where, **at))
        innovations.append(_innovations(text, estimator, len(u), where=where))
        if part.stop <= claimed_at(scenario) + 1:
            claimed = getattr(estimator, "covariance", None)
    known = [each for each in innovations if each is not None]
    whole = np.concatenate(known) if len(known) == len(innovations) else None
    return np.concatenate(parts), claimed, whole


def pieces(scenario: Scenario, estimator: Any, samples: int) -> list[slice]:
    """Return a record in seconds where an estimator is asked before a fault what it claims.

    Cut at the fault alone, it would be told when that comes.
    """
    second = samples if not hasattr(estimator, "covariance") else sample_index(1.0, scenario.period)
    starts = range(0, samples, second)
    return [slice(start, min(start + second, samples)) for start in starts]


def _innovations(
    text: str, estimator: Any, samples: int, *, where: str
) -> NDArray[np.float64] | None:
    """Return innovation and claimed variance (N, 2) of the last run, None if it shows none."""
    given = getattr(estimator, "innovations", None)
    if given is None:
        return None
    try:
        found = np.array(given, float)  # a copy: the next run may overwrite it
    except (TypeError, ValueError):
        return None  # something else of the user's that has this name
    if found.ndim != 2 or found.shape[1] != 2:
        return None
    if len(found) != samples:
        raise EstimatorError(
            f"{text} has `innovations` of the shape {np.shape(given)} after a run of "
            f"{samples} samples on {where}; {(samples, 2)} is needed, y − ŷ and its variance of "
            "each sample"
        )
    return found


def _estimates(
    text: str,
    estimator: Any,
    u: Any,
    y: Any,
    valid: Any,
    *,
    where: str,
    first: int = 0,
    period: float | None = None,
) -> NDArray[np.float64]:
    """Run an estimator; what a user's code raises is said with its name and the sample."""
    with hosted(text, f"on {where}", first=first, period=period):
        theta = there(run_estimator, estimator, u, y, valid)
    if theta.shape != (len(u), len(estimator.names)):
        raise EstimatorError(
            f"{text} returned estimates of the shape {theta.shape} on {where}; "
            f"{(len(u), len(estimator.names))} is needed: one row a sample, one column a name"
        )
    tell_not_finite(text, theta, where, first=first)
    return theta


def tell_not_finite(text: str, theta: NDArray[np.float64], where: str, *, first: int = 0) -> None:
    """Note where a user's estimator returned what is not finite; scores count it as diverged."""
    finite = np.isfinite(theta).all(axis=1)
    if is_guest(text) and not finite.all():
        note(text, f"on {where}, sample {first + int(np.argmin(finite))}")
