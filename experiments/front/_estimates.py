"""One estimator on one record: `estimate`, and its scores: `score`."""

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
"""The columns of a table of scores."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """The estimates of one estimator on one record.

    Attributes
    ----------
    estimator : str
        Name, with options.
    names : tuple of str
        Estimated parameters.
    theta : ndarray (N, p)
        θ[k], made from y[0..k]; SI units.
    record : Recording
    scenario : Scenario
        What the estimator knew of the axis.
    findings : sequence or None
        What it detected, each with `alarm` (sample) and `parameters`; None if it detects nothing.
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
        """Last estimate by name."""
        return self.to_dataframe().iloc[-1].to_dict()

    @cached_property
    def covariance(self) -> Array | None:
        """Claimed covariance (N, p, p) after every sample; None if none is claimed.

        The estimator runs once more for it, sample by sample, when it is first asked for.
        """
        estimator, record = build(parse(self.estimator), self.scenario), self.record
        return run_on(estimator, record.torque, getattr(record, estimator.output), record.valid)[1]

    @cached_property
    def truth(self) -> Mapping[str, Array]:
        """True values (N,) of the estimated parameters that the record knows."""
        return true_values(self.names, self.record, slice(None))

    def plot(self, *names: str, ax: Any = None, band: bool = True) -> Any:
        """Draw estimates over time, a panel a parameter, the truth dashed black.

        Parameters
        ----------
        *names : str
            Parameters; all by default.
        ax : matplotlib axes, or several, optional
            Where to draw, such as what another estimate's `plot` returned; new ones by default.
        band : bool
            Whether to draw ± 2 claimed standard deviations.

        Returns
        -------
        Axes, or ndarray of Axes
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
            if ax is None and name in self.truth:  # axes of the caller have it already
                curves.insert(0, Series(role="truth", x=self.record.time, y=self.truth[name]))
            panels[f"{name} [{_unit(name)}]"] = curves
        return draw(panels, ax, self.record.definition)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a pandas DataFrame: a line a sample, a column a parameter, time [s] as index."""
        index = pd.Index(self.record.time, name="time")
        return pd.DataFrame(self.theta, index, self.names)

    @property
    def table(self) -> pd.DataFrame:
        """Last estimate, truth and error [% of the truth] of each parameter."""
        truth = {name: values[-1] for name, values in self.truth.items()}
        known = {"last": self.last, "truth": truth}
        table = pd.DataFrame(known, self.names, dtype=float)
        error = 100 * (table["last"] / table["truth"] - 1)
        return table.assign(**{"error [%]": error.where(table["truth"] != 0)})

    def save(self, path: str | Path) -> None:
        """Write the estimates to a NetCDF-4 file, with the covariance that is claimed.

        Raises
        ------
        OutputError
            If it cannot be written.
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
        As from `simulate`; or a file ``.nc``.
    estimator : str or class
        A name of `flexaxis.estimators()` or any text as for ``--estimator``; or a class of your
        own, which is made for the record.
    scenario : str, Path or Scenario, optional
        What the estimator knows of the axis; the record's own scenario by default.

    Returns
    -------
    Estimate
        With θ (N, p) of every sample.

    Raises
    ------
    EstimatorError
        If it cannot be made, or does not fit the record.
    RecordError
        If the record does not contain its scenario, and none is given.

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
            "to identify are unknown: name one with scenario=…"
        )
    spec = parse(text_of(estimator))
    made = build(spec, known)
    # The covariance is kept before the record's fault.
    theta, claimed, innovations = follow(spec.text, made, shown.definition or known, shown)
    findings = getattr(made, "findings", None)
    return Estimate(
        spec.text, tuple(made.names), theta, shown, known, findings, claimed, innovations
    )


def score(
    record: Record | Estimate | str | Path, estimator: EstimatorLike = "rpem-forgetting"
) -> pd.DataFrame:
    """Return the scores of an estimate, a line a parameter, as `benchmark` has them of one seed.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        An estimate as from `estimate`; or a record, which is estimated first.
    estimator : str or class
        As for `estimate`; for a record only.

    Returns
    -------
    DataFrame
        Lag and t10 in s; std, bias and cross-talk in % of nominal.

    Raises
    ------
    RecordError
        If the truth is not known: only simulated records can be scored.

    Notes
    -----
    Faults and truth are those of the record, whatever scenario the estimator knew.
    """
    result = record if isinstance(record, Estimate) else estimate(record, estimator)
    known, scenario = result.record, result.record.definition
    if known.true_parameters is None or not (scenario and known_names(scenario, result.names)):
        raise RecordError("the record does not know the true parameters, so there are no scores")
    track = track_of(
        scenario, known, result.names, result.theta, result._claimed, result._innovations,
        result.findings,
    )  # fmt: skip
    # In a row a std is about zero; it is shown about the mean, as of many runs.
    lines = [row | pool_columns(columns_of([row]), ["std"]) for row in rows(track)]
    return pd.DataFrame(lines).assign(estimator=result.estimator)[[*SCORES]]


def check(estimator: EstimatorLike) -> pd.DataFrame:
    """Check whether an estimator keeps the rules: no look-ahead, `step` equals `run`, and so on.

    Parameters
    ----------
    estimator : str or class
        As for `benchmark`.

    Returns
    -------
    DataFrame
        A line a rule: ``rule, holds`` (None if it does not apply), ``seen, reason, hint``.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If it cannot be made at all.
    """
    spec = parse(text_of(estimator))
    return pd.DataFrame(map(asdict, rules.check(spec, store=default_cache())))
