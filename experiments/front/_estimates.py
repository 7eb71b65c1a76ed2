"""Run an estimator on a record with `estimate`, and compute the scores with `score`."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis._records import Recording, changed, draw, load
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.check import check as rules
from flexaxis.experiments.reporting.figures import Series
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.running.case import follow, track_of
from flexaxis.experiments.running.estimate import run_on, true_values, write_estimates
from flexaxis.experiments.running.estimators import build, parse, text_of
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.score_table import rows
from flexaxis.experiments.scoring.summary import columns_of, pool_columns
from flexaxis.sim.errors import RecordError, unknown
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
EstimatorLike = str | type
SCORES = (
    "estimator", "parameter", "changed", "lag", "t10", "std", "bias", "cross_talk", "diverged",
)  # fmt: skip
"""Columns of the table that `score` returns."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """The parameter estimates that one estimator computes from one record.

    Attributes
    ----------
    estimator : str
        Name of the estimator, with its options.
    names : tuple of str
        Names of the estimated parameters.
    theta : ndarray (N, p)
        Estimates in SI units. The estimate θ[k] uses the measurements up to sample k.
    record : Recording
        The record that the estimator processed.
    scenario : Scenario
        The scenario that defines the nominal parameter values for the estimator.
    findings : sequence or None
        Parameter changes that the estimator detected, or None for an estimator without change
        detection. Each change has the attributes `alarm` (sample index of the alarm) and
        `parameters` (names of the changed parameters).
    """

    estimator: str
    names: tuple[str, ...]
    theta: Array
    record: Recording
    scenario: Scenario
    findings: Any
    _claimed: Any
    _innovations: Array | None

    @property
    def last(self) -> dict[str, float]:
        """The final estimate of each parameter, keyed by parameter name."""
        return self.to_dataframe().iloc[-1].to_dict()

    @cached_property
    def covariance(self) -> Array | None:
        """Covariance matrices of the estimates (N, p, p), or None if the estimator has none.

        The first access runs the estimator again to collect one covariance matrix per sample.
        """
        estimator, record = build(parse(self.estimator), self.scenario), self.record
        return run_on(estimator, record.torque, getattr(record, estimator.output), record.valid)[1]

    @cached_property
    def truth(self) -> Mapping[str, Array]:
        """True parameter values as arrays (N,), keyed by name; an empty dict if none are known."""
        return true_values(self.names, self.record, slice(None))

    def plot(self, *names: str, ax: Any = None, band: bool = True) -> Any:
        """Draw the estimates over time, one panel per parameter; dashed lines show true values.

        Parameters
        ----------
        *names : str
            Names of the parameters to draw (default: all parameters).
        ax : matplotlib axes, or several, optional
            Matplotlib axes for the curves, for example the axes that the `plot` method of another
            estimate returned (default: new axes).
        band : bool
            If true, draw a band of ±2 standard deviations, as reported by the estimator, around
            each curve.

        Returns
        -------
        axes : Axes or ndarray of Axes
            One Matplotlib axes object for each parameter.
        """
        panels = {}
        for name in names or self.names:
            if name not in self.names:
                raise EstimatorError(unknown("parameter", name, self.names))
            i = self.names.index(name)
            y, two = self.theta[:, i], 0.0
            if band and self.covariance is not None:
                two = 2 * np.sqrt(self.covariance[:, i, i])  # type: ignore[assignment]
            low, high = y - two, y + two
            curves = [Series(estimator=self.estimator, x=self.record.time, y=y, low=low, high=high)]
            if ax is None and name in self.truth:  # the caller's axes already show the truth
                curves.insert(0, Series(role="truth", x=self.record.time, y=self.truth[name]))
            panels[f"{name} [{_unit(name)}]"] = curves
        return draw(panels, ax, self.record.definition)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the estimates as a DataFrame with one column per parameter and a time index."""
        index = pd.Index(self.record.time, name="time")
        return pd.DataFrame(self.theta, index, self.names)

    @property
    def table(self) -> pd.DataFrame:
        """Final estimate, final true value and relative error [%] of each parameter."""
        truth = {name: values[-1] for name, values in self.truth.items()}
        known = {"last": self.last, "truth": truth}
        table = pd.DataFrame(known, self.names, dtype=float)
        error = 100 * (table["last"] / table["truth"] - 1)
        return table.assign(**{"error [%]": error.where(table["truth"] != 0)})

    def save(self, path: str | Path) -> None:
        """Write the estimates and their covariance matrices to a NetCDF-4 file.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        about = {"estimator": self.estimator, "record_hash": self.record.hash}
        write_estimates(
            Path(path), self.record.time, self.theta, self.names, about, covariance=self.covariance
        )

    def __repr__(self) -> str:
        return f"Estimate by {self.estimator} on {self.record!r}\n{self.table}"


def _unit(name: str) -> str:
    units = {**LAW_UNITS, **PARAMETER_UNITS}
    unit = units.get(name.removeprefix("1/"), "1")
    return f"1/({unit})" if "/" in name else unit


def estimate(
    record: Record | str | Path,
    estimator: EstimatorLike = "rpem-forgetting",
    *,
    scenario: str | Path | Scenario | None = None,
) -> Estimate:
    """Run an estimator on a record.

    Parameters
    ----------
    record : Record, str or Path
        Record from `simulate` or `load`, or path of a record file (``.nc``).
    estimator : str or class
        Estimator name from `flexaxis.estimators()`, any text that the option ``--estimator``
        accepts, or your own estimator class. If you pass a class, the function creates an instance
        of this class.
    scenario : str, Path or Scenario, optional
        Scenario that defines the nominal parameter values for the estimator (default: the scenario
        that the record contains).

    Returns
    -------
    result : Estimate
        Object that contains the parameter estimates in the array ``theta`` (N, p), and other
        estimator outputs.

    Raises
    ------
    EstimatorError
        If the estimator cannot be created, or cannot process the record.
    RecordError
        If the record contains no scenario, and you pass no scenario.

    Examples
    --------
    >>> import flexaxis as fx
    >>> record = fx.simulate("fm_step-v1", seed=0, **{"duration": 2.0, "fault[0].at": 1.0})
    >>> result = fx.estimate(record, "rpem-forgetting[forgetting=0.99]")
    >>> result.names, result.theta.shape
    (('k_T', '1/J_a', 'f_m'), (400, 3))
    """
    shown = Recording(**vars(load(record) if isinstance(record, str | Path) else record))
    known = shown.definition if scenario is None else changed(scenario, {})
    if known is None:
        raise RecordError(
            "the record contains no scenario, so the nominal parameter values and the parameters "
            "to identify are unknown: pass a scenario with scenario=…"
        )
    spec = parse(text_of(estimator))
    made = build(spec, known)
    # `follow` returns the covariance that the estimator reports before the fault of the record.
    theta, claimed, innovations = follow(spec.text, made, shown.definition or known, shown)
    findings = getattr(made, "findings", None)
    return Estimate(
        spec.text, tuple(made.names), theta, shown, known, findings, claimed, innovations
    )


def score(
    record: Record | Estimate | str | Path, estimator: EstimatorLike = "rpem-forgetting"
) -> pd.DataFrame:
    """Score the estimates from one record, with the same score definitions as `benchmark`.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        Result of `estimate`, or a record. If you pass a record, the function first runs the
        estimator on this record.
    estimator : str or class
        Estimator to run, in any form that the function `estimate` accepts. If `record` is an
        `Estimate`, the function ignores the argument `estimator`.

    Returns
    -------
    table : DataFrame
        Table with one row per parameter. The columns `lag` and `t10` are in seconds. The columns
        `std`, `bias` and `cross_talk` are in % of the nominal parameter value.

    Raises
    ------
    RecordError
        If the record contains no true parameter values. Only simulated records contain
        true values.

    Notes
    -----
    The scores use the faults and true values in the record, even if the estimator used the nominal
    values of another scenario.
    """
    result = record if isinstance(record, Estimate) else estimate(record, estimator)
    known, scenario = result.record, result.record.definition
    if known.true_parameters is None or not (scenario and known_names(scenario, result.names)):
        raise RecordError(
            "the record contains no true parameter values, so the scores cannot be computed: use a "
            "simulated record"
        )
    track = track_of(
        scenario, known, result.names, result.theta, result._claimed, result._innovations,
        result.findings,
    )  # fmt: skip
    # In a single row, std is the rms error. Pooling subtracts the mean error, as for many runs.
    lines = [row | pool_columns(columns_of(pd.json_normalize(row)), ["std"]) for row in rows(track)]
    return pd.DataFrame(lines).assign(estimator=result.estimator)[[*SCORES]]


def check(estimator: EstimatorLike) -> pd.DataFrame:
    """Check an estimator against the benchmark rules, such as causality and finite estimates.

    Parameters
    ----------
    estimator : str or class
        Estimator to check, in any form that the function `estimate` accepts.

    Returns
    -------
    table : DataFrame
        Table with one row per rule, and with the columns ``rule, holds, seen, reason, hint``. The
        column ``holds`` contains None if a rule does not apply to the estimator.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If the estimator cannot be created.
    """
    spec = parse(text_of(estimator))
    return pd.DataFrame(map(asdict, rules.check(spec, store=default_cache())))
