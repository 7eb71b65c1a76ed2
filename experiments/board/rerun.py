"""Cases run in the cage and scored outside: the code never meets the truth that judges it."""

from __future__ import annotations

import json
import math
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.board.cage import Cage, Remote
from flexaxis.experiments.running.case import case_id, track_of
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.scoring.pooling import scored
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Row = dict[str, Any]
How = Literal["run", "step"]
PIECE = 200
"""Samples that are sent at once: a divisor of every onset of the suite, and of all others alike."""


def rerun(cage: Cage, text: str, scenario: Scenario, record: Record, how: How) -> list[Row]:
    """Return the rows of a case, one a parameter, as JSON has them.

    Parameters
    ----------
    cage : Cage
    text : str
        As for `--estimator`.
    scenario : Scenario
    record : Record
    how : {"run", "step"}
        By what an estimator has for many samples, in pieces of a second; or sample by sample, of
        which each is sent when the estimate before it is back: nothing can be known of what comes.

    Raises
    ------
    EstimatorError, EntryError
        If there are no such estimates.
    """
    with cage.case(text, scenario) as estimator:
        if estimator.output != scenario.output:
            raise EstimatorError(f"{text} reads {estimator.output!r}, not {scenario.output!r}")
        claimed: Any = None
        innovations: Array | None = None
        if how == "step":
            theta = _stepped(estimator, record, scenario)
        else:
            theta, claimed, innovations = _followed(estimator, record, scenario)
        found = estimator.told().findings
        names = estimator.names
    track = track_of(scenario, record, names, theta, claimed, innovations, found)
    seed = record.seed or 0
    identity = {
        "case": case_id(scenario.hash, text, record.seed),
        "hash": scenario.hash,
        "scenario": scenario.name,
        "estimator": text,
        "seed": record.seed,
    }
    case = scored(track, estimator=text, seed=seed, identity=identity, cost={})
    return [json.loads(dumps(row)) for row in case.rows]


def _stepped(estimator: Remote, record: Record, scenario: Scenario) -> Array:
    u, y = record.torque.tolist(), getattr(record, scenario.output).tolist()
    there = [True] * len(u) if record.valid is None else record.valid.tolist()
    return np.array(
        [estimator.step(a, b if ok else None) for a, b, ok in zip(u, y, there, strict=True)]
    )


def _followed(
    estimator: Remote, record: Record, scenario: Scenario
) -> tuple[Array, Any, Array | None]:
    """Return estimates and claims, in pieces that are the same whenever the first fault comes.

    What is claimed is that of the last sample before it, as `running.case.followed` has it.
    """
    events, samples = scenario.events(), len(record.time)
    before = events[0].index if events else samples
    piece = math.gcd(PIECE, before) if before < samples else PIECE
    y = getattr(record, scenario.output)
    theta, innovations, claimed = [], [], None
    for start in range(0, samples, piece):
        part = slice(start, min(start + piece, samples))
        valid = None if record.valid is None else record.valid[part]
        theta.append(run_estimator(estimator, record.torque[part], y[part], valid))
        told = estimator.told()
        innovations.append(told.innovations)
        claimed = told.covariance if part.stop <= before else claimed
    known = [each for each in innovations if each is not None and each.ndim == 2]
    whole = np.concatenate(known) if len(known) == len(innovations) else None
    return np.concatenate(theta), claimed, whole
