"""Simulate scenarios and load records: `simulate`, `load`, `cache` and `make_axis`.

`make_axis` returns an axis that your own code, such as a controller, moves step by step.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.units import write_log
from flexaxis.experiments.reporting.figures import Series, around, curves
from flexaxis.experiments.reporting.styles import SETTINGS
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.studies.definition import seed_of
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.plant.loop import Changes, plant_of
from flexaxis.sim.record import SIGNALS, Record, load_record
from flexaxis.sim.scenario import Scenario, scenario_from
from flexaxis.sim.simulate import simulate as run
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.sensors import reading


class Recording(Record):
    """A `Record` with methods for figures and tables."""

    @property
    def definition(self) -> Scenario | None:
        """The scenario that was simulated; None if the record does not contain a scenario."""
        return scenario_from(self.scenario, source="the record") if self.scenario else None

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals (N,) that the record contains, except time."""
        return tuple(n for n in SIGNALS if n != "time" and getattr(self, n) is not None)

    def plot(self, *signals: str, ax: Any = None) -> Any:
        """Draw signals over time, one panel per signal.

        Parameters
        ----------
        *signals : str
            Names of the signals to draw (default: the torque, and the signal that estimators read).
        ax : matplotlib axes, or several, optional
            Axes to draw on (default: new axes).

        Returns
        -------
        Axes, or ndarray of Axes
            One axes per signal.
        """
        output = self.scenario.get("output", self.signals[-1])
        panels = {}
        for name in signals or ("torque", output):
            if name not in self.signals:
                raise FlexaxisError(unknown("signal", name, self.signals))
            one = Series(role="data", x=self.time, y=getattr(self, name))
            panels[f"{name.replace('_', ' ')} [{SIGNALS[name][0]}]"] = [one]
        return draw(panels, ax, self.definition)

    def save_log(self, path: Path, **style: Any) -> None:
        """Write a CSV log without true values. `style` has the options of `units.write_log`."""
        write_log(path, self, stream(self.hash, self.seed or 0, "log"), **style)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the record as a DataFrame with one row per sample, indexed by time [s].

        The columns are the signals, `valid` (only if samples are missing), and the true parameters,
        such as ``true_f_m``.
        """
        known = {name: getattr(self, name) for name in (*SIGNALS, "valid")}
        frame = pd.DataFrame(known).set_index("time")
        names = [f"true_{name}" for name in self.parameter_names]
        true = pd.DataFrame(self.true_parameters, frame.index, names)
        return frame.join(true).dropna(axis="columns", how="all")


def axes_for(ax: Any, count: int) -> Any:
    """Return `ax` as an array, or make a column of new axes if `ax` is None."""
    if ax is None:
        from matplotlib import pyplot

        with pyplot.rc_context(SETTINGS):
            size = (8.0, 2.4 + 1.6 * count)
            ax = pyplot.subplots(count, sharex=True, squeeze=False, figsize=size)[1]
    return np.ravel(np.asarray(ax, object))


def draw(
    panels: Mapping[str, Any], ax: Any, scenario: Scenario | None = None, *, x: str = "time [s]",
    **options: Any,
) -> Any:  # fmt: skip
    """Draw one panel of curves for each entry of `panels`.

    If `ax` is None, the function makes new axes, and marks the faults and the burn-in of the
    scenario. It returns one axes for one panel, and an array of axes for several panels.
    """
    marks = around(scenario) if scenario and ax is None else {}
    axes = axes_for(ax, len(panels))
    curves(panels, x=x, axes=axes, **marks, **options)
    return axes[0] if len(axes) == 1 else axes


def simulate(scenario: str | Path | Scenario, /, *, seed: int = 0, **changes: Any) -> Recording:
    """Simulate one run of a scenario, and return its record.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A name from `flexaxis.scenarios()`, the path of a TOML file, or a scenario.
    seed : int
        Random seed. Runs with the same seed are identical to the last bit.
    **changes
        New values of scenario keys, written as in a study:
        ``**{"fault[0].factor": 2, "duration": 12.0}``.

    Returns
    -------
    Recording
        Measured torque, angle and speed (N,), and the true parameters.

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
    return Recording(**vars(run(changed(scenario, changes), [seed_of(seed)])[0]))


def changed(scenario: str | Path | Scenario, changes: Mapping[str, Any]) -> Scenario:
    """Return a scenario with the values of some keys replaced."""
    result = scenario if isinstance(scenario, Scenario) else find_scenario(str(scenario))
    return result.override(changes) if changes else result


def load(path: str | Path) -> Any:
    """Return the record in an ``.nc`` file, or the results in a folder.

    Parameters
    ----------
    path : str or Path
        Path of a file from `Recording.save` or ``flexaxis simulate``, or of a folder from
        ``flexaxis run``, ``flexaxis study`` or `benchmark`.

    Returns
    -------
    Recording or Results
        The record in a file, or the results in a folder.

    Raises
    ------
    FlexaxisError
        If the path is neither a record nor a results folder.
    """
    if Path(path).is_dir():
        from flexaxis._results import Results

        return Results.load(path)
    return Recording(**vars(load_record(path)))


def cache(*, clear: bool = False) -> dict[str, Any]:
    """Return the location and size of the cache of simulated records, and optionally clear it.

    The key of a record contains the hashes of its scenario and of the simulation code, the seed and
    the MuJoCo version, so an entry is never out of date. If the cache is larger than its size
    limit, the least recently used records are deleted.

    Parameters
    ----------
    clear : bool
        Whether to delete all records.

    Returns
    -------
    dict
        ``folder``, the path of the cache, and ``megabytes``, the size of the cache [MB]. The
        environment variable FLEXAXIS_CACHE sets the folder. The size limit is 2048 MB.

    Examples
    --------
    >>> import flexaxis as fx
    >>> sorted(fx.cache())
    ['folder', 'megabytes']
    """
    store = default_cache()
    if clear:
        store.evict(-1)
    size = sum(path.stat().st_size for path in store.entries())
    return {"folder": store.folder, "megabytes": size / 1024**2}


class Sample(NamedTuple):
    """The measurements at one sample.

    Attributes
    ----------
    time : float
        Time [s].
    angle, speed, increment : float
        Motor angle [rad], motor speed [rad/s], and change of the angle divided by the period
        [rad/s].
    """

    time: float
    angle: float
    speed: float
    increment: float


class Axis:
    """The axis of a scenario with its faults and sensors, but without its controller.

    Parameters
    ----------
    scenario : Scenario
        Scenario with the plant, faults and sensors.
    seed : int
        Random seed of the onset and of the noise.

    Attributes
    ----------
    scenario : Scenario
        The scenario, with the onset drawn for the seed.
    sample : Sample
        The latest sample. The axis starts at rest.
    """

    def __init__(self, scenario: Scenario, *, seed: int = 0) -> None:
        if scenario.delay.torque_ticks:
            raise FlexaxisError(
                f"{scenario.name} delays the torque, but `make_axis` does not support a delay: "
                "delay the torque in your own code, and remove `delay` from the scenario"
            )
        seed = seed_of(seed)
        self.scenario = scenario = scenario.drawn(seed)

        def white(purpose: str) -> Any:
            return stream(scenario.key, seed, purpose).standard_normal((scenario.samples, 1))

        self._plant, self._changes, self._k = plant_of(scenario), Changes([scenario]), 0
        self._read = {
            name: reading(scenario.sensors.values(), name, white, period=scenario.period)
            for name in ("angle", "speed")
        }
        self._disturbance = scenario.noise.on_torque(white)
        self.sample = self._measure()

    @property
    def done(self) -> bool:
        """Whether the axis has reached the end of the scenario."""
        return self._k >= self.scenario.samples - 1

    def step(self, torque: float) -> Sample:
        """Apply a constant torque [N m] for one period, and return the sample at the period's end.

        Raises
        ------
        FlexaxisError
            If the axis has reached the end of the scenario.
        SimulationError
            If the axis becomes unstable, or the torque is not finite.
        """
        if self.done:
            raise FlexaxisError(
                f"{self.scenario.name} ends after {self.scenario.duration:g} s: make a new axis, "
                "with a longer time in duration=… if necessary"
            )
        more = 0.0 if self._disturbance is None else self._disturbance[self._k, 0]
        self._plant.step(np.array([float(torque) + more]))
        self._k += 1
        self.sample = self._measure()
        return self.sample

    def _measure(self) -> Sample:
        self._changes.make(self._plant, self._k)
        true = {"angle": self._plant.angle_m, "speed": self._plant.speed_m}
        read = {name: self._read[name](v[None, :].copy()).item() for name, v in true.items()}
        period, increment = self.scenario.period, 0.0
        if self._k:
            increment = (read["angle"] - self.sample.angle) / period
        return Sample(self._k * period, **read, increment=increment)


def make_axis(
    scenario: str | Path | Scenario = "fm_step-v1", *, seed: int = 0, **changes: Any
) -> Axis:
    """Return an axis that your code moves step by step: ``sample = axis.step(torque)``.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Scenario with the plant, faults and sensors. Your code replaces the controller of the
        scenario.
    seed : int
        Random seed of the onset and of the noise.
    **changes
        New values of scenario keys, as for `simulate`.

    Returns
    -------
    Axis
        The axis at rest, at its first sample.

    Raises
    ------
    ScenarioError
        If there is no such scenario or key, or a value is not allowed.
    FlexaxisError
        If the scenario delays the torque.

    Examples
    --------
    >>> import flexaxis as fx
    >>> axis = fx.make_axis(duration=2.0, **{"fault[0].at": 1.0})
    >>> while not axis.done:
    ...     sample = axis.step(-0.2 * axis.sample.speed + 0.1)
    >>> round(sample.time, 3)
    1.995
    """
    return Axis(changed(scenario, changes), seed=seed)
