"""Run one estimator on one record (`estimate`), and compute its scores (`score`)."""

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
    """The estimates of one estimator on one record.

    Attributes
    ----------
    estimator : str
        Name of the estimator, with its options.
    names : tuple of str
        Names of the estimated parameters.
    theta : ndarray (N, p)
        Estimates in SI units. The row θ[k] is computed from y[0] to y[k].
    record : Recording
        The record that the estimator processed.
    scenario : Scenario
        The scenario that contains the estimator's nominal values.
    findings : sequence or None
        Detected changes, each with attributes `alarm` (sample of the alarm) and `parameters` (names
        of the parameters that changed); None if the estimator has no detector.
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
        """The last estimate of each parameter, keyed by name."""
        return self.to_dataframe().iloc[-1].to_dict()

    @cached_property
    def covariance(self) -> Array | None:
        """Covariance (N, p, p) that the estimator reports after every sample, or None.

        On first access, the estimator runs once more, sample by sample, to collect the covariances.
        """
        estimator, record = build(parse(self.estimator), self.scenario), self.record
        return run_on(estimator, record.torque, getattr(record, estimator.output), record.valid)[1]

    @cached_property
    def truth(self) -> Mapping[str, Array]:
        """True values (N,) of the estimated parameters, keyed by name, if the record has them."""
        return true_values(self.names, self.record, slice(None))

    def plot(self, *names: str, ax: Any = None, band: bool = True) -> Any:
        """Draw the estimates over time, one panel per parameter. True values are dashed.

        Parameters
        ----------
        *names : str
            Parameters to draw (default: all).
        ax : matplotlib axes, or several, optional
            Axes to draw on, such as those returned by the `plot` method of another estimate
            (default: new axes).
        band : bool
            Whether to draw a band of ± 2 reported standard deviations.

        Returns
        -------
        Axes, or ndarray of Axes
            One axes per parameter.
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
        """Return the estimates as a DataFrame: one column per parameter, indexed by time [s]."""
        index = pd.Index(self.record.time, name="time")
        return pd.DataFrame(self.theta, index, self.names)

    @property
    def table(self) -> pd.DataFrame:
        """Last estimate, last true value and error [% of the true value] of each parameter."""
        truth = {name: values[-1] for name, values in self.truth.items()}
        known = {"last": self.last, "truth": truth}
        table = pd.DataFrame(known, self.names, dtype=float)
        error = 100 * (table["last"] / table["truth"] - 1)
        return table.assign(**{"error [%]": error.where(table["truth"] != 0)})

    def save(self, path: str | Path) -> None:
        """Write the estimates and the reported covariance to a NetCDF-4 file.

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
        A record from `simulate` or `load`, or the path of an ``.nc`` file.
    estimator : str or class
        A name from `flexaxis.estimators()`, any text that ``--estimator`` accepts, or a class of
        your own, which is instantiated for the record.
    scenario : str, Path or Scenario, optional
        Scenario that contains the estimator's nominal values (default: the scenario of the record).

    Returns
    -------
    Estimate
        Estimates θ (N, p) after every sample, and further outputs of the estimator.

    Raises
    ------
    EstimatorError
        If the estimator cannot be constructed, or does not fit the record.
    RecordError
        If the record does not contain its scenario and `scenario` is not given.

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
            "the record does not contain its scenario, so the nominal values and the parameters "
            "to identify are unknown: give a scenario with scenario=…"
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
    """Return the scores of one estimate, as `benchmark` computes them for one seed.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        A result of `estimate`, or a record that the estimator processes first.
    estimator : str or class
        The estimator to run, as for `estimate`. If `record` is an `Estimate`, this argument is
        ignored.

    Returns
    -------
    DataFrame
        One row per parameter; lag and t10 in s; std, bias and cross-talk in % of nominal.

    Raises
    ------
    RecordError
        If the record has no true parameters. Only simulated records can be scored.

    Notes
    -----
    The faults and true values always come from the record, even if the estimator used the nominal
    values of another scenario.
    """
    result = record if isinstance(record, Estimate) else estimate(record, estimator)
    known, scenario = result.record, result.record.definition
    if known.true_parameters is None or not (scenario and known_names(scenario, result.names)):
        raise RecordError("the record has no true parameters, so it cannot be scored")
    track = track_of(
        scenario, known, result.names, result.theta, result._claimed, result._innovations,
        result.findings,
    )  # fmt: skip
    # In a single row, std is the rms error. Pooling subtracts the mean error, as for many runs.
    lines = [row | pool_columns(columns_of(pd.json_normalize(row)), ["std"]) for row in rows(track)]
    return pd.DataFrame(lines).assign(estimator=result.estimator)[[*SCORES]]


def check(estimator: EstimatorLike) -> pd.DataFrame:
    """Check that an estimator follows the rules, such as no look-ahead and finite estimates.

    Parameters
    ----------
    estimator : str or class
        Estimator to check, as for `estimate`.

    Returns
    -------
    DataFrame
        One row per rule, with columns ``rule, holds`` (None if the rule does not apply), ``seen,
        reason, hint``.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If the estimator cannot be constructed.
    """
    spec = parse(text_of(estimator))
    return pd.DataFrame(map(asdict, rules.check(spec, store=default_cache())))
