"""A run of a scenario as a record with figures: `simulate`, `load`, `view`, `cache`.

`view` chooses how to draw before MuJoCo is imported, so nothing here imports it when it is loaded.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.record import SIGNALS, Record, load_record
from flexaxis.sim.scenario import Scenario, scenario_from

if TYPE_CHECKING:
    from flexaxis._results import Results
    from flexaxis.experiments.reporting.figures import Series


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
        from flexaxis.experiments.reporting.figures import Series

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
    """Return axes to draw on, one below the other: those of the caller, or new ones.

    Raises
    ------
    FlexaxisError
        If the caller has others than `count`.
    """
    if axes is None:
        from matplotlib import pyplot

        from flexaxis.experiments.reporting.styles import SETTINGS

        with pyplot.rc_context(SETTINGS):
            size = (8.0, max(4.0, 1.0 + 1.6 * count))
            axes = pyplot.subplots(count, sharex=True, squeeze=False, figsize=size)[1]
    found = list(np.ravel(np.asarray(axes, object)))
    if len(found) != count:
        raise FlexaxisError(
            f"{len(found)} axes for {count} panels: give as many (plt.subplots({count})), "
            "name fewer panels, or give none"
        )
    return found


def draw(curves: Mapping[str, Sequence[Series]], axes: Any, scenario: Scenario | None) -> Any:
    """Draw curves over time, a panel each, with faults and burn-in of a scenario.

    Axes that have curves already have the truth and the faults, too. One axes is returned as it
    is, several as an array.
    """
    from flexaxis.experiments.reporting import figures
    from flexaxis.experiments.reporting.inputs import around

    found = panels(axes, len(curves))
    fresh = not any(ax.lines for ax in found)
    shown = {name: [s for s in each if fresh or s.role != "truth"] for name, each in curves.items()}
    marks = around(scenario) if scenario and fresh else {}
    figures.curves(shown, x="time [s]", axes=found, **marks)
    return found[0] if len(found) == 1 else np.array(found, object)


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
    from flexaxis.sim.simulate import simulate as run

    return Recording.of(run(changed(scenario, changes), [seed_of(seed)])[0])


def changed(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario with some values replaced."""
    found = scenario if isinstance(scenario, Scenario) else find_scenario(str(scenario))
    return found.override(changes) if changes else found


def seed_of(seed: Any) -> int:
    """Return the number of a run; refuse what is no whole number from 0 to 2^63 − 1."""
    whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not whole or not 0 <= seed < 2**63:
        raise FlexaxisError(f"seed {seed!s:.40}: give a whole number from 0 to 2^63 - 1")
    return int(seed)


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
        ``megabytes``, ``limit`` [MB] (set by FLEXAXIS_CACHE_LIMIT), and ``removed``.

    Examples
    --------
    >>> import flexaxis as fx
    >>> fx.cache()["removed"]
    0
    """
    from flexaxis.experiments.running.cache import default_cache

    store = default_cache()
    removed = store.clear() if clear else 0
    size, limit = (round(bytes_ / 1024**2, 1) for bytes_ in (store.size(), store.limit))
    return {"folder": store.folder, "records": len(store.entries()), "megabytes": size,
            "limit": limit, "removed": removed}  # fmt: skip


def view(
    run: str | Path | Scenario | Record,
    *,
    seed: int = 0,
    at: float = 0.0,
    exaggerate: float = 100.0,
    picture: str | Path | None = None,
) -> Path | None:
    """Show a run in 3-D: in a window, or as a picture.

    The twist of the joints is about a milliradian. The angles of gear and arm are therefore
    exaggerated; the motor turns as it does.

    Parameters
    ----------
    run : str, Path, Scenario or Record
        A scenario, which is simulated first, or a recording of `simulate` or `load`.
    seed : int
        Seed of the simulation.
    at : float
        Time of the run at which to begin [s].
    exaggerate : float
        Factor of the twist; 1 shows it as it is.
    picture : str or Path, optional
        PNG file to write instead of opening a window. It needs no display.

    Returns
    -------
    Path or None
        The picture.

    Raises
    ------
    FlexaxisError
        If a number or the name of the picture is wrong.
    """
    target = None if picture is None else Path(picture)
    if not (0 <= exaggerate < np.inf and (target is None or target.suffix.lower() == ".png")):
        raise FlexaxisError("give a factor of 0 or more, and a picture that ends in .png")
    from flexaxis.experiments.demo import view as drawing

    if target is not None:
        drawing.draw_offscreen()  # before the engine is imported
    record = run if isinstance(run, Record) else simulate(run, seed=seed)
    if not 0 <= at <= (end := record.time[-1]):
        raise FlexaxisError(f"at={at:g}: give a time of the run, 0 to {end:g} s")
    if target is None:
        drawing.window(record, start=at, exaggerate=exaggerate)
    else:
        drawing.picture(record, target, at=at, exaggerate=exaggerate)
    return target
