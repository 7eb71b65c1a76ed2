"""The scores of one estimate: `score`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from flexaxis._estimates import Estimate
from flexaxis._running import estimate
from flexaxis._table import Table
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running.case import case_id, track_of
from flexaxis.experiments.scoring.summary import scored
from flexaxis.experiments.scoring.table import SCORES
from flexaxis.experiments.scoring.theta import known_names
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario


def score(
    record: Record | Estimate | str | Path,
    estimator: str | Callable[..., Any] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
) -> Table:
    """Return the scores of an estimate, a line a parameter, as `benchmark` has them.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        An estimate as from `estimate`; or what is to be estimated first.
    estimator, options
        As for `estimate`; needed for what is to be estimated first, and for that alone.

    Returns
    -------
    Table
        Scores of one run by their names, with their units.

    Raises
    ------
    RecordError
        If the truth is not known: only simulated records can be scored.
    EstimatorError
        If it is not clear whose scores are asked for.

    Notes
    -----
    Faults and truth are those of the record, whatever scenario the estimator was told.
    """
    found = _estimated(record, estimator, options)
    scenario = _scenario_of(found)
    track = track_of(
        scenario, found.record, found.names, found.theta,
        found._claimed, found._innovations, found.findings,
    )  # fmt: skip
    seed = found.record.seed or 0
    identity = {
        "case": case_id(found.record.hash or scenario.hash, found.estimator, seed),
        "scenario": scenario.name,
        "estimator": found.estimator,
        "seed": seed,
    }
    case = scored(track, estimator=found.estimator, identity=identity, cost={})
    return Table([_plain(row) for row in case.rows], _SCORES, _UNITS)


def _estimated(record: Any, estimator: Any, options: Mapping[str, Any] | None) -> Estimate:
    """Return what is scored: an estimate that is given, or that of an estimator."""
    if isinstance(record, Estimate):
        if estimator is not None or options:
            raise EstimatorError(
                f"this is an estimate by {record.estimator} already: give no estimator, or a "
                "record in place of it"
            )
        return record
    if estimator is None:
        raise EstimatorError(
            "a record has no scores, an estimator has: give one, as in "
            "fx.score(record, 'glr'), or an estimate, as in fx.score(fx.estimate(record, …))"
        )
    return estimate(record, estimator, options=options)


def _scenario_of(found: Estimate) -> Scenario:
    """Return the scenario of a record's faults; what was told only where the record says none."""
    record, scenario = found.record, found.record.definition or found.scenario
    if record.true_parameters is None or scenario is None:
        raise RecordError("the record does not know the true parameters: there is nothing to score")
    if tuple(record.parameter_names) != tuple(scenario.parameter_names):
        raise RecordError(
            f"the record has the true {', '.join(record.parameter_names)}, but {scenario.name} has "
            f"{', '.join(scenario.parameter_names)}: give the scenario that the record was made of"
        )
    if not known_names(scenario, found.names):
        raise RecordError(
            f"{found.estimator} estimates {', '.join(found.names)}, and the record of "
            f"{scenario.name} knows the truth of none of them: give an estimate of what it has"
        )
    return scenario


_SCORES: Sequence[str] = (
    "estimator", "parameter", "changed", "lag", "t10", "std", "bias", "cross_talk", "diverged",
)  # fmt: skip


_UNITS: Mapping[str, str] = {
    name: f"{name} [{'% of nominal' if unit == '%' else unit}]"
    for name in _SCORES
    if name in SCORES and (unit := SCORES[name].unit)
}
"""How the columns that have a unit are headed."""


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key != "cost"}
