"""One estimator on one record: `estimate`, and its scores: `score`."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis._estimates import Estimate
from flexaxis._given import spec_of
from flexaxis._records import Recording, changed
from flexaxis._table import ShownTable
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator, run_estimator
from flexaxis.experiments.catalogue.names import is_scenario
from flexaxis.experiments.running.case import follow, track_of
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.running.user_code import reported
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.score_table import SCORES
from flexaxis.experiments.scoring.summary import columns_of, pool_columns, scored
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record
from flexaxis.sim.scenario import Scenario


def estimate(
    record: Record | str | Path,
    estimator: str | Callable[..., Any] | Estimator = "rpem-forgetting",
    *,
    options: Mapping[str, Any] | None = None,
    scenario: str | Scenario | None = None,
) -> Estimate:
    """Run an estimator on a record.

    Parameters
    ----------
    record : Record, str or Path
        As from `simulate`; or a file ``.nc``.
    estimator : str, class or instance
        A name of `flexaxis.estimators()` or any text as for ``--estimator``; a class of your own,
        which is made for the record; or an object with `step`, which goes on from where it is.
    options : mapping, optional
        Keywords of the estimator: ``{"forgetting": 0.99}``.
    scenario : str or Scenario, optional
        What the estimator is told; the record's own by default.

    Returns
    -------
    Estimate
        With θ (N, p) of every sample.

    Raises
    ------
    EstimatorError
        If it cannot be made, or does not go with the record.
    RecordError
        If the record does not say its scenario, and none is given.

    Examples
    --------
    >>> import flexaxis as fx
    >>> record = fx.simulate("fm_step-v1", seed=0, **{"duration": 2.0, "fault[0].at": 1.0})
    >>> found = fx.estimate(record, "rpem-forgetting", options={"forgetting": 0.99})
    >>> found.names, found.theta.shape
    (('k_T', '1/J_a', 'f_m'), (400, 3))
    """
    record = _loaded(record) if isinstance(record, str | Path) else record
    shown = record if isinstance(record, Recording) else Recording.of(record)
    told = shown.definition if scenario is None else changed(scenario, {})
    if hasattr(estimator, "step") and not isinstance(estimator, type):
        found = _of_instance(estimator, shown, told)  # type: ignore[arg-type]
    else:
        found = _of_spec(spec_of(estimator, options), shown, told)  # type: ignore[arg-type]
    _warn_if_not_finite(found)
    return found


def _loaded(path: str | Path) -> Record:
    """Return the record of a file; for a scenario, say how to make one."""
    if not Path(path).exists() and is_scenario(str(path)):
        raise RecordError(
            f"{path} is a scenario, not a record: make a record of it first, "
            f"fx.estimate(fx.simulate({str(path)!r}), …)"
        )
    return load_record(path)


def _warn_if_not_finite(found: Estimate) -> None:
    finite: NDArray[np.bool_] = np.atleast_1d(np.isfinite(found.theta).all(axis=1))
    if not finite.all():
        k = int(np.argmin(finite))
        warnings.warn(
            f"{found.estimator} returned an estimate that is not finite at "
            f"{int(np.sum(~finite))} of {len(finite)} samples, first at sample {k} "
            f"({found.time[k]:g} s): such a run counts as diverged",
            stacklevel=3,
        )


def _of_spec(spec: Spec, record: Recording, told: Scenario | None) -> Estimate:
    if told is None:
        raise RecordError(
            "the record does not say its scenario, so the nominal values and the parameters to "
            "identify are unknown: name one with scenario=…, or give an estimator that is made"
        )
    built = build(spec, told)
    _check_output(built, record, spec.text)
    happened = record.definition or told  # what is claimed is kept before the fault of the record
    theta, claimed, innovations = follow(spec.text, built, happened, record)
    return Estimate(
        spec.text, tuple(built.names), theta, record, told, _findings(built), claimed, innovations,
        _maker(spec, told) if hasattr(built, "covariance") else None,
    )  # fmt: skip


def _of_instance(estimator: Estimator, record: Recording, scenario: Scenario | None) -> Estimate:
    name = type(estimator).__name__
    _check_output(estimator, record, name)
    y = getattr(record, estimator.output)
    with reported(name, f"on {record!r}", refusing=True):
        theta = run_estimator(estimator, record.torque, y, record.valid)
    return Estimate(name, tuple(estimator.names), theta, record, scenario, _findings(estimator))


def _check_output(estimator: Estimator, record: Record, name: str) -> None:
    if getattr(record, estimator.output, None) is None:
        raise EstimatorError(f"{name} reads {estimator.output!r}, which the record lacks")


def _maker(spec: Spec, scenario: Scenario) -> Callable[[], Estimator]:
    return lambda: build(spec, scenario)


def _findings(estimator: Any) -> tuple[Any, ...] | None:
    found = getattr(estimator, "findings", None)
    return None if found is None else tuple(found)


def score(
    record: Record | Estimate | str | Path,
    estimator: str | Callable[..., Any] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
) -> ShownTable:
    """Return the scores of an estimate, a line a parameter, as `benchmark` has them of one seed.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        An estimate as from `estimate`; or what is to be estimated first.
    estimator, options
        As for `estimate`; needed for what is to be estimated first, and for that alone.

    Returns
    -------
    ShownTable
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
        "scenario": scenario.name,
        "estimator": found.estimator,
        "seed": seed,
    }
    case = scored(track, estimator=found.estimator, identity=identity, cost={})
    return ShownTable([_plain(row) for row in case.rows], _SCORES, _UNITS)


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
    """Return a row as a table shows it: a std about the mean, which in a row is about zero."""
    row = {key: value for key, value in row.items() if key != "cost"}
    about_mean = pool_columns(columns_of([row]), ["std", "std_after"])
    return row | {name: about_mean[name] for name in ("std", "std_after")}
