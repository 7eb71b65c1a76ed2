"""A case: one estimator on one record, scored."""

from __future__ import annotations

import platform
import time
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.building.crashes import crash
from flexaxis.experiments.building.specs import Spec, build
from flexaxis.experiments.scoring.case import Track
from flexaxis.experiments.scoring.pooling import Case, scored
from flexaxis.experiments.scoring.theta import known_names
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario


def warm(spec: Spec, scenario: Scenario) -> None:
    """Let an estimator compile what it compiles, so that the cost scored is that of running."""
    rest = np.zeros(2)
    _estimates(spec, build(spec, scenario), rest, rest, None, where=f"{scenario.name} (warm-up)")


def case_id(scenario_hash: str, estimator: str, seed: int | None) -> str:
    """Return the identity of a case: 64 bits in hexadecimal."""
    return sha256(f"{scenario_hash} {estimator} {seed}".encode()).hexdigest()[:16]


def run_case(scenario: Scenario, record: Record, spec: Spec, *, whole: bool = False) -> Case:
    """Run an estimator on a record and score it; `whole` keeps all estimates.

    Raises
    ------
    EstimatorError
        If the estimator raises, or returns what it may not.
    """
    assert record.true_parameters is not None  # a simulated record knows the truth
    estimator = build(spec, scenario)
    start = time.perf_counter()
    where = f"{scenario.name}, seed {record.seed}"
    theta, claimed, innovations = _with_claims(spec, estimator, scenario, record, where=where)
    seconds = time.perf_counter() - start
    names = known_names(scenario, estimator.names)
    mine = [list(estimator.names).index(name) for name in names]
    track = Track(
        scenario=scenario,
        names=names,
        theta=theta[:, mine],
        true_parameters=record.true_parameters,
        torque=record.torque,
        claimed=_of(claimed, mine, len(estimator.names)),
        innovations=innovations,
        findings=getattr(estimator, "findings", None),
    )
    identity = {
        "case": case_id(scenario.hash, spec.text, record.seed),
        "hash": scenario.hash,
        "scenario": scenario.name,
        "estimator": spec.text,
        "seed": record.seed,
    }
    cost = {
        "us_per_sample": 1e6 * seconds / len(theta),
        "seconds": seconds,
        "host": platform.node(),
    }
    seed = record.seed or 0
    return scored(track, estimator=spec.text, seed=seed, identity=identity, cost=cost, whole=whole)


def _of(claimed: Any, mine: list[int], p: int) -> Any:
    """Return what is claimed of some of the p parameters; what is no such matrix, as it is."""
    if len(mine) == p or np.shape(claimed) != (p, p):
        return claimed
    return np.asarray(claimed)[np.ix_(mine, mine)]


def _with_claims(
    spec: Spec, estimator: Any, scenario: Scenario, record: Record, *, where: str
) -> tuple[NDArray[np.float64], Any, NDArray[np.float64] | None]:
    """Return the estimates, the covariance claimed at the first fault or the end, innovations."""
    events = scenario.events()
    stop = events[0].index if events and hasattr(estimator, "covariance") else scenario.samples
    y = getattr(record, scenario.output)
    valid = record.valid
    parts, innovations = [], []
    claimed = None
    for part in (slice(0, stop), slice(stop, None)):
        if part.start < scenario.samples:
            gaps = None if valid is None else valid[part]
            u = record.torque[part]
            parts.append(_estimates(spec, estimator, u, y[part], gaps, where=where))
            innovations.append(_innovations(spec, estimator, len(u), where=where))
        if claimed is None:
            claimed = getattr(estimator, "covariance", None)
    known = [each for each in innovations if each is not None]
    whole = np.concatenate(known) if len(known) == len(innovations) else None
    return np.concatenate(parts), claimed, whole


def _innovations(
    spec: Spec, estimator: Any, samples: int, *, where: str
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
            f"{spec.text} has `innovations` of the shape {np.shape(given)} after a run of "
            f"{samples} samples on {where}; {(samples, 2)} is needed, y − ŷ and its variance of "
            "each sample"
        )
    return found


def _estimates(
    spec: Spec, estimator: Any, u: Any, y: Any, valid: Any, *, where: str
) -> NDArray[np.float64]:
    """Run an estimator; what a user's code raises is said with its name and the record's."""
    try:
        theta = run_estimator(estimator, u, y, valid)
    except Exception as error:
        raise crash(spec.text, f"on {where}", error) from error
    if theta.shape != (len(u), len(estimator.names)):
        raise EstimatorError(
            f"{spec.text} returned estimates of the shape {theta.shape} on {where}; "
            f"{(len(u), len(estimator.names))} is needed: one row a sample, one column a name"
        )
    return theta
