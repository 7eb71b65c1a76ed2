"""A run of a scenario as a record with figures: `simulate`, `load`; and the `cache` of records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting import figures
from flexaxis.experiments.reporting.figures import Series
from flexaxis.experiments.reporting.styles import SETTINGS
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.studies.definition import seed_of
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.record import SIGNALS, Record, load_record
from flexaxis.sim.scenario import Scenario, scenario_from
from flexaxis.sim.simulate import simulate as run

if TYPE_CHECKING:
    from flexaxis._results import Results


class Recording(Record):
    """A record with its figure and its tables; whatever takes a `Record` takes it."""

    @classmethod
    def of(cls, record: Record) -> Recording:
        """Return a record as one that can be plotted."""
        return cls(**{field.name: getattr(record, field.name) for field in fields(record)})

    @property
    def definition(self) -> Scenario | None:
        """The scenario; None if the record does not contain it."""
        return scenario_from(self.scenario, source="the record") if self.scenario else None

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of its signals (N,), without time."""
        return tuple(n for n in SIGNALS if n != "time" and getattr(self, n) is not None)

    def plot(self, *signals: str, ax: Any = None) -> Any:
        """Draw signals over time, a panel each.

        Parameters
        ----------
        *signals : str
            Names as in `signals`; by default the torque and what estimators read.
        ax : matplotlib axes, or several, optional
            Where to draw; new ones by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        output = self.scenario.get("output", "")
        usual = ("torque", output if output in self.signals else self.signals[-1])
        curves = {}
        for name in signals or usual:
            if name not in self.signals:
                raise FlexaxisError(unknown("signal", name, self.signals))
            one = Series(role="data", label=str(self), x=self.time, y=getattr(self, name))
            curves[f"{name.replace('_', ' ')} [{SIGNALS[name][0]}]"] = [one]
        return draw(curves, ax, self.definition)

    def to_dataframe(self) -> pd.DataFrame:
        """Return a pandas DataFrame: a line a sample, time [s] as index.

        Columns are the signals, `valid` if samples are missing, and the true parameters as
        ``true_f_m``.
        """
        columns = {name: getattr(self, name) for name in self.signals}
        if self.valid is not None:
            columns["valid"] = self.valid
        if self.true_parameters is not None:
            named = zip(self.parameter_names, self.true_parameters.T, strict=True)
            columns |= {f"true_{name}": values for name, values in named}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))


def panels(axes: Any, count: int) -> list[Any]:
    """Return axes to draw on, one below the other: those of the caller, or new ones."""
    if axes is None:
        from matplotlib import pyplot

        with pyplot.rc_context(SETTINGS):
            size = (8.0, 2.4 + 1.6 * count)
            axes = pyplot.subplots(count, sharex=True, squeeze=False, figsize=size)[1]
    return list(np.ravel(np.asarray(axes, object)))


def draw(curves: Mapping[str, Sequence[Series]], axes: Any, scenario: Scenario | None) -> Any:
    """Draw curves over time, a panel each; on new axes with faults and burn-in of a scenario.

    Axes of the caller have the truth already. One axes is returned as it is, several as an array.
    """
    marks = figures.around(scenario) if scenario and axes is None else {}
    shown = {name: [s for s in each if axes is None or s.role != "truth"]
             for name, each in curves.items()}  # fmt: skip
    result = panels(axes, len(curves))
    figures.curves(shown, x="time [s]", axes=result, **marks)
    return result[0] if len(result) == 1 else np.array(result, object)


def simulate(scenario: str | Path | Scenario, /, *, seed: int = 0, **changes: Any) -> Recording:
    """Return the record of one run of a scenario.

    Parameters
    ----------
    scenario : str, Path or Scenario
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
    return Recording.of(run(changed(scenario, changes), [seed_of(seed)])[0])


def changed(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario with some values replaced."""
    result = scenario if isinstance(scenario, Scenario) else find_scenario(str(scenario))
    return result.override(changes) if changes else result


def load(path: str | Path) -> Recording | Results:
    """Return what a path holds: the record of a file ``.nc``, the results of a folder.

    Parameters
    ----------
    path : str or Path
        A record, as `Recording.save` and ``flexaxis simulate`` write it; or the folder of
        ``flexaxis run`` or ``flexaxis study``, or of `benchmark`.

    Raises
    ------
    FlexaxisError
        If it is neither.
    """
    if Path(path).is_dir():
        from flexaxis._results import Results

        return Results.load(path)
    return Recording.of(load_record(path))


def cache(*, clear: bool = False) -> dict[str, Any]:
    """Return the state of the cache of simulated records, or empty it.

    A record is stored under the hash of its scenario, its seed, the engine and the simulation code,
    so an entry is never out of date. The least recently used records go when the limit is reached.

    Parameters
    ----------
    clear : bool
        Whether to remove all records.

    Returns
    -------
    dict
        ``folder`` (set by the environment variable FLEXAXIS_CACHE), ``records`` (their number),
        ``megabytes``, ``limit`` [MB], and ``removed``.

    Examples
    --------
    >>> import flexaxis as fx
    >>> fx.cache()["removed"]
    0
    """
    store = default_cache()
    removed = store.evict(-1) if clear else 0
    sizes = [path.stat().st_size for path in store.entries()]
    size, limit = (round(bytes_ / 1024**2, 1) for bytes_ in (sum(sizes), store.limit))
    return {"folder": store.folder, "records": len(sizes), "megabytes": size,
            "limit": limit, "removed": removed}  # fmt: skip
