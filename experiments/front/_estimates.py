"""What an estimator made of a record: its numbers, figure and tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis._records import Recording
from flexaxis._table import html_table, text_table
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator
from flexaxis.experiments.files import optional_package
from flexaxis.experiments.running.estimate import run_on, true_values, write_estimates
from flexaxis.sim.errors import unknown
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
        estimator, record = self._again(), self.record
        y = getattr(record, estimator.output)
        return run_on(estimator, record.torque, y, record.valid)[1]

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
            Where to draw, as what another estimate's `plot` returned; new ones by default.
        band : bool
            Whether to draw ± 2 of the standard deviation that is claimed.
        label : str, optional
            For the legend; the estimator's name by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        from flexaxis._draw import over_time, unit_of
        from flexaxis.experiments.reporting.figures import Series

        for name in names:
            if name not in self.names:
                raise EstimatorError(unknown("parameter", name, self.names))
        sure = self.covariance if band else None
        curves: dict[str, list[Series]] = {}
        for name in names or self.names:
            i = self.names.index(name)
            own, band_of = self.theta[:, i], {}
            if sure is not None:
                two = 2 * np.sqrt(sure[:, i, i])
                band_of = {"low": own - two, "high": own + two}
            one = Series(estimator=self.estimator, label=label, x=self.time, y=own, **band_of)
            curves[f"{name} [{unit_of(name)}]"] = lines = [one]
            if (true := self.truth.get(name)) is not None:
                lines.insert(0, Series(role="truth", x=self.time, y=true))
        return over_time(curves, ax, self.record.definition)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame: a line a sample, a column a parameter, time [s] as index."""
        import pandas as pd

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
        return optional_package("xarray").Dataset(
            {"theta": (names, self.theta, said)}, along, about
        )

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
