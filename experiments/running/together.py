"""The runs of a unit that fit side by side: done at once, before they are scored one by one."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.side_by_side import run_together, worth_together
from flexaxis.experiments.building.guest import is_guest
from flexaxis.experiments.building.ready import ready
from flexaxis.experiments.building.specs import Spec, parse
from flexaxis.experiments.running.case import MAKING, Ran, account, pieces
from flexaxis.experiments.running.compiling import COMPILING
from flexaxis.experiments.scoring.spending import shared, spent
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Together = Mapping[tuple[str, int], Ran]


class Run(NamedTuple):
    """An estimator, in its own state, and the record that it gets."""

    spec: Spec
    place: int
    estimator: Any
    record: Record


def ran_together(scenario: Scenario, texts: Sequence[str], records: Sequence[Record]) -> Together:
    """
    Run those estimators on all records that are faster side by side; the others are left out.

    They give what they give alone, to the last bit. What cannot be made, or fails, is left out as
    well, to be run alone and to say what is wrong with it.

    Parameters
    ----------
    scenario : Scenario
    texts : sequence of str
        Estimators, as for `--estimator`; code of users is left alone.
    records : sequence of Record
        Of the scenario.

    Returns
    -------
    mapping of (text, place in records) to Ran
        The time of each is that of its estimator by itself: who ran beside it is no cost of it.
    """
    specs = [made for text in texts if (made := _made(text, scenario)) is not None]
    if not (specs and records):
        return {}
    with spent(COMPILING):
        each, samples = [estimator for _, estimator in specs], len(records[0].time)
        worth = worth_together(each, samples, runs=len(records))
    with spent(MAKING):
        runs = [
            Run(spec, place, estimator.copy(), record)
            for (spec, estimator), good in zip(specs, worth, strict=True)
            for place, record in enumerate(records)
            if good
        ]
    try:
        return _run(scenario, runs) if runs else {}
    except EstimatorError:  # each alone says what is wrong with it
        return {}


def _made(text: str, scenario: Scenario) -> tuple[Spec, Any] | None:
    """Return an estimator of ours at its start, and what it is made of."""
    if is_guest(text):
        return None
    try:
        spec = parse(text)
        with spent(MAKING):
            return spec, ready(spec, scenario)
    except EstimatorError:
        return None


def _run(scenario: Scenario, runs: Sequence[Run]) -> Together:
    names = [account(run.spec) for run in runs]
    found: list[list[Array]] = [[] for _ in runs]
    innovations: list[list[Array]] = [[] for _ in runs]
    claimed: list[Array] = []
    alone = {run.spec.text: _alone(run) for run in runs if run.place == 0}
    with shared(names):
        for part in pieces(scenario, runs[0].estimator, len(runs[0].record.time)):
            given = zip(*(_signals(run, part) for run in runs), strict=True)
            for i, theta in enumerate(run_together([run.estimator for run in runs], *given)):
                found[i].append(theta)
                innovations[i].append(runs[i].estimator.innovations)
            claimed = claimed or [run.estimator.covariance for run in runs]
    return {
        (run.spec.text, run.place): Ran(
            np.concatenate(found[i]),
            alone[run.spec.text],
            run.estimator.names,
            claimed[i],
            np.concatenate(innovations[i]),
        )
        for i, run in enumerate(runs)
    }


def _alone(run: Run) -> float:
    """Return how long a run takes by itself [s]; once for all records, which are as long."""
    estimator, given = run.estimator.copy(), _signals(run, slice(None))
    start = time.perf_counter()
    with spent(account(run.spec)):
        estimator.run(*given)
    return time.perf_counter() - start


def _signals(run: Run, part: slice) -> tuple[Array, Array, NDArray[np.bool_] | None]:
    record = run.record
    y = getattr(record, run.estimator.output)
    return record.torque[part], y[part], None if record.valid is None else record.valid[part]
