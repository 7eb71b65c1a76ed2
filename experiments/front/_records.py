"""A run of a scenario as a record that shows itself: `simulate`, `load`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexaxis._given import scenarios_of, seed_of
from flexaxis._table import html_table
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.record import SIGNALS, Record, load_record
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
    import pandas

    from flexaxis._results import Results


class Recording(Record):
    """A record with its figure and its tables; whatever takes a `Record` takes it."""

    @classmethod
    def of(cls, record: Record) -> Recording:
        """Return a record as one that shows itself."""
        return cls(**{field.name: getattr(record, field.name) for field in fields(record)})

    @property
    def definition(self) -> Scenario | None:
        """The scenario, None if the record does not say it."""
        return scenario_from(self.scenario, source="the record") if self.scenario else None

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals (N,) that it has, without time."""
        return tuple(n for n in SIGNALS if n != "time" and getattr(self, n) is not None)

    def plot(self, *signals: str, ax: Any = None) -> Any:
        """Draw signals over time, a panel each.

        Parameters
        ----------
        *signals : str
            Names as in `signals`; torque and what estimators read by default.
        ax : matplotlib axes, or several, optional
            Where to draw; new ones by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        from flexaxis._draw import over_time
        from flexaxis.experiments.reporting.figures import Series

        read = self.scenario.get("output", "speed")
        usual = ("torque", read if read in self.signals else self.signals[-1])
        for name in signals:
            if name not in self.signals:
                raise FlexaxisError(unknown("signal", name, self.signals))
        label = repr(self).partition(": ")[0]
        beside = any(each.lines for each in np.ravel(ax if ax is not None else []))
        who = label if beside else "A"  # alone it is unbroken; beside others by its name
        curves = {f"{name.replace('_', ' ')} [{SIGNALS[name][0]}]":
                  [Series(estimator=who, label=label, x=self.time, y=getattr(self, name))]
                  for name in signals or usual}  # fmt: skip
        return over_time(curves, ax, self.definition)

    def to_dataframe(self) -> pandas.DataFrame:
        """Return a pandas DataFrame: a line a sample, time [s] as index.

        Columns are the signals, `valid` where samples are missing, and the true parameters as
        ``true_f_m``.
        """
        columns = {name: getattr(self, name) for name in self.signals}
        if self.valid is not None:
            columns["valid"] = self.valid
        if self.true_parameters is not None:
            named = zip(self.parameter_names, self.true_parameters.T, strict=True)
            columns |= {f"true_{name}": values for name, values in named}
        import pandas as pd

        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))

    def _repr_html_(self) -> str:
        head = f"<b>{self.scenario.get('name', 'record')}</b>"
        rows = [
            [name, SIGNALS[name][0], f"{np.sqrt(np.mean(np.square(getattr(self, name)))):.4g}"]
            for name in self.signals
        ]
        return f"{head} {repr(self).partition(': ')[2]}" + html_table(
            ["signal", "unit", "rms"], rows, len(rows)
        )


def simulate(scenario: str | Scenario, /, *, seed: int = 0, **changes: Any) -> Recording:
    """Return the record of one run of a scenario.

    Parameters
    ----------
    scenario : str or Scenario
        A name of `flexaxis.scenarios()`, a path to a TOML file, or a scenario.
    seed : int
        Number of the run: the same number gives the same run, to the last bit.
    **changes
        Values by dotted key, as in a study: ``**{"fault[0].factor": 2, "duration": 12.0}``.

    Returns
    -------
    Recording
        Torque, angle and speed (N,) as measured, and the true parameters.

    Raises
    ------
    ScenarioError
        If there is no such scenario or key, or a value is not allowed.
    SimulationError
        If the axis becomes unstable.

    Examples
    --------
    >>> import flexaxis as fx
    >>> record = fx.simulate("fm_step-v1", seed=0, **{"duration": 2.0, "fault[0].at": 1.0})
    >>> record.torque.shape, record.period
    ((400,), 0.005)
    """
    from flexaxis.sim.simulate import simulate as run

    return Recording.of(run(changed(scenario, changes), [seed_of(seed)])[0])


def changed(scenario: str | Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario with some values replaced."""
    found = scenarios_of(scenario)
    if len(found) != 1:
        raise FlexaxisError(f"{scenario} is a suite of {len(found)} scenarios: name one of them")
    return found[0].override(changes) if changes else found[0]


def load(path: str | Path) -> Recording | Results:
    """Return what a path holds: the record of a file ``.nc``, the results of a folder.

    Parameters
    ----------
    path : str or Path
        A record, as `Recording.save` and ``flexaxis simulate`` write it; or the folder of
        ``flexaxis run`` or ``flexaxis study``, or of `benchmark`.

    Returns
    -------
    Recording or Results

    Raises
    ------
    FlexaxisError
        If it is neither.
    """
    if not isinstance(path, str | os.PathLike):
        raise FlexaxisError(f"{path!r} is no path: give the file of a record, or a folder")
    if Path(path).is_dir():
        from flexaxis._results import Results

        return Results.load(path)
    return Recording.of(load_record(path))
