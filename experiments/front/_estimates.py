"""One estimator on one record: `estimate`, and its scores: `score`."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis._records import Recording, changed, draw, load
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.experiments.reporting.figures import Series
from flexaxis.experiments.running.case import follow, track_of
from flexaxis.experiments.running.estimate import run_on, true_values, write_estimates
from flexaxis.experiments.running.estimators import build, parse, text_of, with_options
from flexaxis.experiments.scoring.parameter_names import known_names
from flexaxis.experiments.scoring.score_table import rows
from flexaxis.experiments.scoring.summary import columns_of, pool_columns
from flexaxis.sim.errors import RecordError, unknown
from flexaxis.sim.parameters import LAW_UNITS, PARAMETER_UNITS
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
EstimatorLike = str | Callable[..., Any]
SCORES = (
    "estimator", "parameter", "changed", "lag", "t10", "std", "bias", "cross_talk", "diverged",
)  # fmt: skip
"""The columns of a table of scores."""


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """What an estimator made of a record.

    Attributes
    ----------
    estimator : str
        Name, with options.
    names : tuple of str
        Estimated parameters.
    theta : ndarray (N, p)
        θ[k], made from y[0..k]; SI units.
    record : Recording
    scenario : Scenario or None
        What the estimator knew of the axis.
    findings : tuple or None
        What it detected, each with `alarm` (sample) and `parameters`; None if it detects nothing.
    """

    estimator: str
    names: tuple[str, ...]
    theta: Array
    record: Recording
    scenario: Scenario | None
    findings: tuple[Any, ...] | None = None
    _claimed: Any = None
    _innovations: Array | None = None
    _make: Callable[[], Estimator] | None = None

    @property
    def time(self) -> Array:
        """Sample times (N,) [s]."""
        return self.record.time

    @property
    def last(self) -> dict[str, float]:
        """Last estimate by name."""
        return dict(zip(self.names, self.theta[-1].tolist(), strict=True))

    @cached_property
    def covariance(self) -> Array | None:
        """Claimed covariance (N, p, p) after every sample; None if none is claimed.

        The estimator runs once more for it, sample by sample, when it is first asked for.
        """
        if self._make is None:
            return None
        estimator, record = self._make(), self.record
        return run_on(estimator, record.torque, getattr(record, estimator.output), record.valid)[1]

    @cached_property
    def truth(self) -> Mapping[str, Array]:
        """True values (N,) of the estimated parameters that the record knows."""
        return true_values(self.names, self.record, slice(None))

    def plot(self, *names: str, ax: Any = None, band: bool = True, label: str = "") -> Any:
        """Draw estimates over time, a panel a parameter, the truth dashed black.

        Parameters
        ----------
        *names : str
            Parameters; all by default.
        ax : matplotlib axes, or several, optional
            Where to draw, such as what another estimate's `plot` returned; new ones by default.
        band : bool
            Whether to draw ± 2 claimed standard deviations.
        label : str, optional
            For the legend; the estimator's name by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        if wrong := {*names} - {*self.names}:
            raise EstimatorError(unknown("parameter", min(wrong), self.names))
        covariance, curves = self.covariance if band else None, {}
        for name in names or self.names:
            i = self.names.index(name)
            y, two = self.theta[:, i], 0.0
            if covariance is not None:
                two = 2 * np.sqrt(covariance[:, i, i])
            one = Series(estimator=self.estimator, label=label, x=self.time, y=y,
                         low=y - two, high=y + two)  # fmt: skip
            truth = (
                [Series(role="truth", x=self.time, y=self.truth[name])]
                if name in self.truth
                else []
            )
            curves[f"{name} [{_unit(name)}]"] = [*truth, one]
        return draw(curves, ax, self.record.definition)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a pandas DataFrame: a line a sample, a column a parameter, time [s] as index."""
        index = pd.Index(self.time, name="time")
        return pd.DataFrame(self.theta, index=index, columns=list(self.names))

    @property
    def table(self) -> pd.DataFrame:
        """Last estimate, truth and error [% of the truth] of each parameter."""
        table = pd.DataFrame({"last estimate": self.theta[-1]}, list(self.names))
        table["truth"] = pd.Series(
            {name: true[-1] for name, true in self.truth.items()}, dtype=float
        )
        error = 100 * (table["last estimate"] / table["truth"] - 1)
        return table.assign(**{"error [%]": error.where(table["truth"] != 0)})

    def save(self, path: str | Path, *, covariance: bool = True) -> None:
        """Write the estimates to a NetCDF-4 file, with the covariance that is claimed.

        Raises
        ------
        OutputError
            If it cannot be written.
        """
        about = {"estimator": self.estimator, "record_hash": self.record.hash}
        known = self.covariance if covariance else None
        write_estimates(Path(path), self.time, self.theta, self.names, about, covariance=known)

    def __repr__(self) -> str:
        return f"Estimate by {self.estimator} on {self.record!r}\n{self.table}"

    def _repr_html_(self) -> str:
        return f"<b>{self.estimator}</b> on {self.record!r}{self.table.to_html()}"


def _unit(name: str) -> str:
    units = {**LAW_UNITS, **PARAMETER_UNITS}
    return f"1/({units.get(name[2:], '1')})" if name[:2] == "1/" else units.get(name, "1")


def estimate(
    record: Record | str | Path,
    estimator: EstimatorLike | Estimator = "rpem-forgetting",
    *,
    options: Mapping[str, Any] | None = None,
    scenario: str | Path | Scenario | None = None,
) -> Estimate:
    """Run an estimator on a record.

    Parameters
    ----------
    record : Record, str or Path
        As from `simulate`; or a file ``.nc``.
    estimator : str, class or instance
        A name of `flexaxis.estimators()` or any text as for ``--estimator``; a class of your own,
        which is made for the record; or an object with `step`, which continues from its state.
    options : mapping, optional
        Keywords of the estimator: ``{"forgetting": 0.99}``.
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
    >>> result = fx.estimate(record, "rpem-forgetting", options={"forgetting": 0.99})
    >>> result.names, result.theta.shape
    (('k_T', '1/J_a', 'f_m'), (400, 3))
    """
    loaded = load(record) if isinstance(record, str | Path) else record
    shown = loaded if isinstance(loaded, Recording) else Recording.of(loaded)  # type: ignore[arg-type]
    known = shown.definition if scenario is None else changed(scenario, {})
    if known is None:
        raise RecordError(
            "the record does not contain its scenario, so the nominal values and the parameters "
            "to identify are unknown: name one with scenario=…"
        )
    if hasattr(estimator, "step") and not isinstance(estimator, type):
        text, made, make = type(estimator).__name__, estimator, None
    else:
        spec = parse(with_options(text_of(estimator), options or {}))
        text, made, make = spec.text, build(spec, known), lambda: build(spec, known)
    if getattr(shown, made.output, None) is None:
        raise EstimatorError(f"{text} reads {made.output!r}, which the record lacks")
    happened = shown.definition or known  # the covariance is kept before the record's fault
    theta, claimed, innovations = follow(text, made, happened, shown)
    findings = getattr(made, "findings", None)
    finite = np.isfinite(theta).all(axis=1)
    if not finite.all():
        k = int(np.argmin(finite))
        warnings.warn(
            f"{text} returned an estimate that is not finite at {np.sum(~finite)} of {len(finite)} "
            f"samples, first at sample {k} ({shown.time[k]:g} s): such a run counts as diverged",
            stacklevel=2,
        )
    return Estimate(
        text, tuple(made.names), theta, shown, known,
        None if findings is None else tuple(findings), claimed, innovations, make,
    )  # fmt: skip


def score(
    record: Record | Estimate | str | Path,
    estimator: EstimatorLike | None = None,
    *,
    options: Mapping[str, Any] | None = None,
) -> pd.DataFrame:
    """Return the scores of an estimate, a line a parameter, as `benchmark` has them of one seed.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        An estimate as from `estimate`; or a record, which is estimated first.
    estimator, options
        As for `estimate`; with a record only.

    Returns
    -------
    DataFrame
        Lag and t10 in s; std, bias and cross-talk in % of nominal.

    Raises
    ------
    RecordError
        If the truth is not known: only simulated records can be scored.
    EstimatorError
        If it is not clear whose scores are asked for.

    Notes
    -----
    Faults and truth are those of the record, whatever scenario the estimator knew.
    """
    if isinstance(record, Estimate) == (estimator is not None):
        raise EstimatorError(
            "give a record and an estimator, as in fx.score(record, 'glr'), or an estimate alone, "
            "as in fx.score(fx.estimate(record, …))"
        )
    result = record if isinstance(record, Estimate) else estimate(
        record, estimator, options=options  # type: ignore[arg-type]
    )  # fmt: skip
    known, scenario = result.record, result.record.definition or result.scenario
    if known.true_parameters is None or scenario is None:
        raise RecordError("the record does not know the true parameters, so it has no scores")
    if known.parameter_names != scenario.parameter_names or not known_names(scenario, result.names):
        raise RecordError(
            f"{scenario.name} has the truth of {', '.join(scenario.parameter_names)}: give the "
            f"scenario of the record, and an estimate of what it has, not {', '.join(result.names)}"
        )
    track = track_of(
        scenario, known, result.names, result.theta, result._claimed, result._innovations,
        result.findings,
    )  # fmt: skip
    # In a row a std is about zero; it is shown about the mean, as of many runs.
    lines = [row | pool_columns(columns_of([row]), ["std"]) for row in rows(track)]
    return pd.DataFrame(lines).assign(estimator=result.estimator)[[*SCORES]]
