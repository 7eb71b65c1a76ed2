"""Simulate scenarios and load records with `simulate`, `load`, `cache` and `make_axis`.

`make_axis` returns a simulated axis that your own code, such as a controller, drives step by step.
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
from flexaxis.sim.random_draws import stream
from flexaxis.sim.record import SIGNALS, Record, load_record
from flexaxis.sim.scenario import Scenario, scenario_from
from flexaxis.sim.simulate import simulate as run
from flexaxis.sim.tables.sensors import reading


class Recording(Record):
    """A `Record` with methods for figures and tables."""

    @property
    def definition(self) -> Scenario | None:
        """The simulated scenario, or None if the record contains no scenario."""
        return scenario_from(self.scenario, source="the record") if self.scenario else None

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of all signals in the record except the time."""
        return tuple(n for n in SIGNALS if n != "time" and getattr(self, n) is not None)

    def plot(self, *signals: str, ax: Any = None) -> Any:
        """Draw signals over time, with one panel for each signal.

        Parameters
        ----------
        *signals : str
            Names of the signals to draw (default: the torque and the signal that the estimators
            read).
        ax : matplotlib axes, or several, optional
            Matplotlib axes for the curves (default: new axes).

        Returns
        -------
        axes : Axes or ndarray of Axes
            One Matplotlib axes object for each signal.
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
        """Write a CSV log without true values; `style` contains options of `units.write_log`."""
        write_log(path, self, stream(self.hash, self.seed or 0, "log"), **style)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the record as a DataFrame with one row per sample, indexed by time [s].

        The columns contain the signals and the true parameter values, such as ``true_f_m``. If
        samples are missing, the column ``valid`` marks the valid samples.
        """
        known = {name: getattr(self, name) for name in (*SIGNALS, "valid")}
        frame = pd.DataFrame(known).set_index("time")
        names = [f"true_{name}" for name in self.parameter_names]
        true = pd.DataFrame(self.true_parameters, frame.index, names)
        return frame.join(true).dropna(axis="columns", how="all")


def axes_for(ax: Any, count: int) -> Any:
    """Return `ax` as an array, or create a column of new axes if `ax` is None."""
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

    If `ax` is None, the function creates new axes, and marks the faults and the burn-in phase of
    the scenario. For several panels, the function returns an array of axes.
    """
    marks = around(scenario) if scenario and ax is None else {}
    axes = axes_for(ax, len(panels))
    curves(panels, x=x, axes=axes, **marks, **options)
    return axes[0] if len(axes) == 1 else axes


def simulate(scenario: str | Path | Scenario, /, *, seed: int = 0, **changes: Any) -> Recording:
    """Simulate a scenario, and return the record of the simulation.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A name from `flexaxis.scenarios()`, the path of a TOML file, or a `Scenario` object.
    seed : int
        Random seed. Simulations with the same seed are identical to the last bit.
    **changes
        New values of scenario settings, such as ``duration=12.0`` or
        ``**{"fault[0].factor": 2}``.

    Returns
    -------
    record : Recording
        Record with the measured torque, angle and speed, and the true parameter values, as arrays
        (N,) with one value per sample.

    Raises
    ------
    ScenarioError
        If the scenario or a setting does not exist, or a value is not allowed.
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
    """Return a copy of a scenario in which some settings have new values."""
    result = scenario if isinstance(scenario, Scenario) else find_scenario(str(scenario))
    return result.override(changes) if changes else result


def load(path: str | Path) -> Any:
    """Load a record from an ``.nc`` file, or the results of a run from a folder.

    Parameters
    ----------
    path : str or Path
        Path of a record file from `Recording.save` or ``flexaxis simulate``, or path of a results
        folder from ``flexaxis run``, ``flexaxis study`` or `benchmark`.

    Returns
    -------
    content : Recording or Results
        The record from the file, or the results from the folder.

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
    """Return the path and size of the cache of simulated records, and optionally clear the cache.

    A cached record is never outdated, because its key contains the seed, the MuJoCo version, and
    hashes of the scenario and the simulation code. If the cache exceeds 2048 MB, the least recently
    used records are deleted.

    Parameters
    ----------
    clear : bool
        If true, delete all records in the cache.

    Returns
    -------
    content : dict
        The entry ``folder`` is the path of the cache, and ``megabytes`` is the size of the cache
        [MB]. The environment variable FLEXAXIS_CACHE sets the path of the cache.

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
    """The measurements of the axis at one sampling instant.

    Attributes
    ----------
    time : float
        Time [s].
    angle, speed, increment : float
        Motor angle [rad]; motor speed [rad/s]; and the change in motor angle since the previous
        sample, divided by the sampling period [rad/s].
    """

    time: float
    angle: float
    speed: float
    increment: float


class Axis:
    """The simulated axis of a scenario, with its faults and sensors but not its controller.

    Parameters
    ----------
    scenario : Scenario
        Scenario that defines the plant, the faults and the sensors.
    seed : int
        Random seed of the fault onset and of the noise.

    Attributes
    ----------
    scenario : Scenario
        The scenario with the fault onset that the seed determines.
    sample : Sample
        The measurements at the latest sampling instant. The axis starts at rest.
    """

    def __init__(self, scenario: Scenario, *, seed: int = 0) -> None:
        if scenario.delay.torque_ticks:
            raise FlexaxisError(
                f"scenario {scenario.name} delays the torque, which `make_axis` does not support: "
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
        """True if the simulation has reached the end of the scenario."""
        return self._k >= self.scenario.samples - 1

    def step(self, torque: float) -> Sample:
        """Apply a constant torque [N m] for one sampling period, and return the next sample.

        Raises
        ------
        FlexaxisError
            If the simulation has already reached the end of the scenario.
        SimulationError
            If the axis becomes unstable, or the torque is not finite.
        """
        if self.done:
            raise FlexaxisError(
                f"scenario {self.scenario.name} ends after {self.scenario.duration:g} s: make a "
                "new axis, and set a longer duration with duration=… if necessary"
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
    """Return a simulated axis that your code drives with ``sample = axis.step(torque)``.

    Parameters
    ----------
    scenario : str, Path or Scenario
        Scenario that defines the plant, the faults and the sensors. Your code replaces the
        controller of the scenario.
    seed : int
        Random seed of the fault onset and of the noise.
    **changes
        New values of scenario settings, in the same form as for `simulate`.

    Returns
    -------
    axis : Axis
        The simulated axis, which is at rest at the first sample.

    Raises
    ------
    ScenarioError
        If the scenario or a setting does not exist, or a value is not allowed.
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
