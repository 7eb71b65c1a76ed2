"""One estimator on one record: `estimate`."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis._estimates import Estimate
from flexaxis._given import spec_of
from flexaxis._records import Recording, changed
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.experiments.building.guest import hosted, limited
from flexaxis.experiments.building.specs import Spec, build
from flexaxis.experiments.catalogue.names import scenario_names
from flexaxis.experiments.running.case import followed
from flexaxis.experiments.running.estimate import run_on
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, load_record
from flexaxis.sim.scenario import Scenario


def estimate(
    record: Record | str | Path,
    estimator: str | Callable[..., Any] | Estimator = "rpem-forgetting",
    *,
    options: Mapping[str, Any] | None = None,
    scenario: str | Scenario | None = None,
    time_limit: float | None = None,
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
    time_limit : float, optional
        How long code of your own may take [s]; 600 by default.

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
    with limited(time_limit):
        if hasattr(estimator, "step") and not isinstance(estimator, type):
            found = _of_instance(estimator, shown, told)  # type: ignore[arg-type]
        else:
            found = _of_spec(spec_of(estimator, options), shown, told)  # type: ignore[arg-type]
    _warn_if_not_finite(found)
    return found


def _loaded(path: str | Path) -> Record:
    """Return the record of a file; for a scenario, say how to make one."""
    if not Path(path).exists() and str(path) in scenario_names():
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
    theta, claimed, innovations = followed(spec.text, built, happened, record)
    return Estimate(
        spec.text, tuple(built.names), theta, record, told, _findings(built), claimed, innovations,
        _maker(spec, told) if hasattr(built, "covariance") else None,
    )  # fmt: skip


def _of_instance(estimator: Estimator, record: Recording, scenario: Scenario | None) -> Estimate:
    name = type(estimator).__name__
    _check_output(estimator, record, name)
    own = type(estimator).__module__.startswith("flexaxis.estimators.")
    with hosted(name, f"on {record!r}", refusing=True, guest=not own):
        theta, _, _ = run_on(estimator, record, claims=False)
    return Estimate(name, tuple(estimator.names), theta, record, scenario, _findings(estimator))


def _check_output(estimator: Estimator, record: Record, name: str) -> None:
    if getattr(record, estimator.output, None) is None:
        raise EstimatorError(f"{name} reads {estimator.output!r}, which the record lacks")


def _maker(spec: Spec, scenario: Scenario) -> Callable[[], Estimator]:
    return lambda: build(spec, scenario)


def _findings(estimator: Any) -> tuple[Any, ...] | None:
    found = getattr(estimator, "findings", None)
    return None if found is None else tuple(found)
