"""One estimator on one record: `estimate` and `score`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis._given import spec_of
from flexaxis._records import Recording, changed
from flexaxis._table import Table, html_table, text_table
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.experiments.building.guest import hosted
from flexaxis.experiments.building.specs import Spec, build
from flexaxis.experiments.results.results import needed
from flexaxis.experiments.running.case import case_id, followed, track_of
from flexaxis.experiments.running.estimate import run_on
from flexaxis.experiments.scoring.pooling import scored
from flexaxis.experiments.scoring.theta import known_names, physical, true_theta
from flexaxis.sim.errors import RecordError, unknown
from flexaxis.sim.record import Record, load_record
from flexaxis.sim.scenario import Scenario

if TYPE_CHECKING:
    import pandas
    import xarray

Array = NDArray[np.float64]


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
        What the estimator was told of.
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
    _again: Callable[[], Estimator] | None = field(default=None)

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
        """Claimed covariance (N, p, p) after every sample, None if none is claimed.

        The record is gone through once more for it, sample by sample, when it is first asked for.
        """
        if self._again is None:
            return None
        return run_on(self._again(), self.record)[1]

    @cached_property
    def truth(self) -> Mapping[str, Array]:
        """True values (N,) of the estimated parameters that the record knows."""
        known, columns = self.record.true_parameters, self.record.parameter_names
        if known is None:
            return {}
        names = [name for name in self.names if physical(name)[0] in columns]
        return {name: true_theta([name], known, columns)[:, 0] for name in names}

    def plot(self, *names: str, ax: Any = None, band: bool = True, label: str = "") -> Any:
        """Draw estimates over time, a panel a parameter, the truth dashed black.

        Parameters
        ----------
        *names : str
            Parameters; all by default.
        ax : matplotlib axes, or several, optional
            Where to draw, as what another estimate's `plot` returned; new ones by default.
        band : bool
            Whether to draw ± 2 of the standard deviation that is claimed.
        label : str, optional
            For the legend; the estimator's name by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        from flexaxis import _draw
        from flexaxis.experiments.reporting.figures import colour

        for name in names:
            if name not in self.names:
                raise EstimatorError(unknown("parameter", name, self.names))
        sure = self.covariance if band else None
        curves = {}
        for name in names or self.names:
            i = self.names.index(name)
            deviation = None if sure is None else np.sqrt(sure[:, i, i])
            curves[name] = self.theta[:, i], deviation, self.truth.get(name)
        return _draw.estimates(
            self.time, curves, ax, label=label or self.estimator,
            colour=colour(self.estimator), scenario=self.record.definition,
        )  # fmt: skip

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame: a line a sample, a column a parameter, time [s] as index.

        Raises
        ------
        StudyError
            If pandas is not installed.
        """
        pd = needed("pandas")
        index = pd.Index(self.time, name="time")
        return pd.DataFrame(self.theta, index=index, columns=list(self.names))

    def to_xarray(self) -> xarray.Dataset:
        """Return an xarray Dataset: theta over time and estimate, as `flexaxis estimate` writes it.

        Raises
        ------
        StudyError
            If xarray is not installed.
        """
        names = ("time", "estimate")
        said = {"long_name": "estimates", "units": "SI"}
        along = {"time": ("time", self.time, {"units": "s"}),
                 "estimate": np.array(self.names, object)}  # fmt: skip
        about = {"estimator": self.estimator, "record_hash": self.record.hash}
        return needed("xarray").Dataset({"theta": (names, self.theta, said)}, along, about)

    def _lines(self) -> list[list[str]]:
        found = []
        for name, value in self.last.items():
            true = self.truth[name][-1] if name in self.truth else None
            shown = "" if true is None else f"{true:.6g}"
            error = f"{100 * (value / true - 1):+.2f}" if true else ""  # no share of zero
            found.append([name, f"{value:.6g}", shown, error])
        return found

    def __repr__(self) -> str:
        head = f"Estimate by {self.estimator} on {self.record!r}"
        return head + "\n" + text_table(_HEADS, self._lines(), len(self.names))

    def _repr_html_(self) -> str:
        from html import escape

        said = f"<b>{escape(self.estimator)}</b> on {escape(repr(self.record))}"
        return said + html_table(_HEADS, self._lines(), len(self.names))


_HEADS = ("parameter", "last estimate", "truth", "error [%]")


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

    Raises
    ------
    EstimatorError
        If it cannot be made, or does not go with the record.
    RecordError
        If the record does not say its scenario, and none is given.
    """
    record = load_record(record) if isinstance(record, str | Path) else record
    shown = record if isinstance(record, Recording) else Recording.of(record)
    told = shown.definition if scenario is None else changed(scenario, {})
    if hasattr(estimator, "step") and not isinstance(estimator, type):
        return _of_instance(estimator, shown, told)  # type: ignore[arg-type]
    spec = spec_of(estimator, options)  # type: ignore[arg-type]
    if told is None:
        raise RecordError(
            "the record does not say its scenario, so the nominal values and the parameters to "
            "identify are unknown: name one with scenario=…, or give an estimator that is made"
        )
    built = build(spec, told)
    _check_output(built, shown, spec.text)
    happened = shown.definition or told  # what is claimed is kept before the fault of the record
    theta, claimed, innovations = followed(spec.text, built, happened, shown)
    return Estimate(
        spec.text, tuple(built.names), theta, shown, told, _findings(built), claimed, innovations,
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


def score(
    record: Record | Estimate | str | Path,
    estimator: str | Callable[..., Any] = "rpem-forgetting",
    *,
    options: Mapping[str, Any] | None = None,
) -> Table:
    """Return the scores of an estimate, a line a parameter, as `benchmark` has them.

    Parameters
    ----------
    record : Estimate, Record, str or Path
        An estimate as from `estimate`; or what is to be estimated first.
    estimator, options
        As for `estimate`, where the record is none.

    Raises
    ------
    RecordError
        If the truth is not known: only simulated records can be scored.

    Notes
    -----
    Faults and truth are those of the record, whatever scenario the estimator was told.
    """
    found = record if isinstance(record, Estimate) else estimate(record, estimator, options=options)
    scenario = _scenario_of(found)
    track = track_of(
        scenario, found.record, found.names, found.theta,
        found._claimed, found._innovations, found.findings,
    )  # fmt: skip
    seed = found.record.seed or 0
    identity = {
        "case": case_id(scenario.hash, found.estimator, seed),
        "scenario": scenario.name,
        "estimator": found.estimator,
        "seed": seed,
    }
    case = scored(track, estimator=found.estimator, seed=seed, identity=identity, cost={})
    return Table([_plain(row) for row in case.rows], _SCORES)


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


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key != "cost"}
