"""The axis in MuJoCo: a batch of runs, stepped at the sampling rate, parameters settable."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from threading import Lock

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from flexaxis.models_mjcf import DEFAULT, model_files
from flexaxis.sim.errors import ParameterError, SimulationError, unknown
from flexaxis.sim.parameters import AxisParameters, parameter_names, parameter_problem
from flexaxis.sim.plant import passive
from flexaxis.sim.tables.dry_friction import FrictionConfig
from flexaxis.sim.tables.nonlinear import Law, Nonlinearity
from flexaxis.sim.tables.places import CubicSprings, KeptLaw, parameter_places
from flexaxis.sim.tables.smooth_friction import COMPILED_LAWS

Array = NDArray[np.float64]


class Plant:
    """A batch of simulated axes, held torque in, angles and speeds out.

    All runs start at rest at angle zero. Each run gives the same bits whatever the number of
    runs or threads.

    Parameters
    ----------
    parameters : sequence of AxisParameters, or ndarray (R, P)
        Parameters of each run.
    model : str
        Of `flexaxis.models_mjcf.MODEL_NAMES`.
    period : float
        Time between two calls of `step` [s].
    substeps : int
        Steps of the fourth-order Runge-Kutta method in one period.
    threads : int
        Threads that share the runs.
    nonlinear : sequence of Nonlinearity
        What the axis has beyond the linear model; see `flexaxis.sim.tables.nonlinear`.

    Raises
    ------
    ParameterError
        If a parameter is not physical.
    """

    def __init__(
        self,
        parameters: Sequence[AxisParameters] | Array,
        *,
        period: float,
        substeps: int,
        threads: int = 1,
        nonlinear: Sequence[Nonlinearity] = (),
        model: str = DEFAULT,
    ) -> None:
        self._names = parameter_names(model)
        values = self._as_rows(parameters)
        self._called = any(isinstance(each, COMPILED_LAWS) for each in nonlinear)
        if self._called:
            passive.install()
        made = _compile(model, period / substeps, nonlinear)
        self._batch = Batch(made, len(values), threads)
        self._substeps = substeps
        self._places = [*parameter_places(self._batch, self._names)]
        self._springs = CubicSprings(self._batch, made) if made.tendon_stiffnesspoly.any() else None
        laws = [each for each in nonlinear if isinstance(each, Law)]
        self._laws = [KeptLaw(self._batch, made, law.law, law.kept) for law in laws]
        self._values = np.full_like(values, np.nan)
        self._angle: Array = self._batch.bind("qpos")
        self._speed: Array = self._batch.bind("qvel")
        self._torque: Array = self._batch.bind("ctrl")[:, 0]
        self._time: Array = self._batch.bind("time")
        self.set_parameters(values)

    def set_parameters(self, parameters: Sequence[AxisParameters] | Array) -> None:
        """Change the parameters of the runs from now on; angles and speeds stay.

        An inertia that changes keeps its speed, and so not its momentum, as when a load that
        moves along is taken up or let go.

        Parameters
        ----------
        parameters : sequence of AxisParameters, or ndarray (R, P)
            New parameters of each run. Only what differs is touched.

        Raises
        ------
        ParameterError
            If a parameter is not physical; then nothing has changed.
        """
        values = self._as_rows(parameters)
        if values.shape != self._values.shape:
            raise ParameterError(
                f"expected parameters of shape {self._values.shape}, got {values.shape}."
            )
        changed = np.flatnonzero((values != self._values).any(axis=0))
        self._check_columns(values, changed)
        for column in changed:  # transposed, for an inertia has three entries in each run
            self._places[column].T[...] = values[:, column]
        if self._springs:
            self._springs.scale()
        if any(self._names[column][0] in "Jr" for column in changed):
            self._batch.set_const()  # which the engine derives from these
        self._values = values

    def set_law(self, name: str, values: float | Array) -> None:
        """Change a parameter of a law from now on, such as the level f_c of dry friction.

        Parameters
        ----------
        name : str
            Parameter of one of the `Law`s that the plant was made with; of the first that has it.
        values : float or ndarray (R,)
            New value, for all runs or for each.

        Raises
        ------
        ParameterError
            If no law has such a parameter, or a value is negative or not finite.
        """
        if not (np.isfinite(values).all() and np.min(values) >= 0):
            raise ParameterError(f"{name} must be zero or positive, not {values!r}.")
        for law in self._laws:
            if name in law.names:
                law.set(name, values)
                return
        known = [known for law in self._laws for known in law.names]
        raise ParameterError(unknown("parameter", name, known))

    def step(self, torque: Array) -> None:
        """Hold a torque command for one period.

        Parameters
        ----------
        torque : ndarray (R,)
            Command of each run [N m].

        Raises
        ------
        SimulationError
            If the engine warns, or a state is no longer finite.
        """
        if self._called:
            passive.install()  # another may have taken the place of it
        self._torque[:] = torque
        with QUIET:
            self._batch.step(nstep=self._substeps)
        if self._batch.warning.any() or not np.isfinite(self._batch.state).all():
            self._fail()

    def model(self, run: int) -> mujoco.MjModel:
        """Return a copy of the engine's model of one run, to look into."""
        return self._batch.get_model(run)

    @property
    def speed_m(self) -> Array:
        """Motor speed (R,) [rad/s], now; a live view, to be copied if it is to be kept."""
        return self._speed[:, 0]

    @property
    def speeds(self) -> Array:
        """Speed (R, n) of the n masses [rad/s], now; a live view."""
        return self._speed

    @property
    def angles(self) -> Array:
        """Angle (R, n) of the n masses [rad], now; a live view."""
        return self._angle

    @property
    def angle_m(self) -> Array:
        """Motor angle (R,) [rad], now; a live view."""
        return self._angle[:, 0]

    def _as_rows(self, parameters: Sequence[AxisParameters] | Array) -> Array:
        """Return parameters as a new array (R, P)."""
        rows = [p.as_array() if isinstance(p, AxisParameters) else p for p in parameters]
        values, P = np.array(rows, dtype=float), len(self._names)
        if values.ndim != 2 or values.shape[1] != P or not len(values):
            raise ParameterError(
                f"parameters must have shape (runs, {P}) with at least one run, not {values.shape}."
            )
        return values

    def _check_columns(self, values: Array, columns: NDArray[np.int64]) -> None:
        for column in columns:
            name = self._names[column]
            for run, value in enumerate(values[:, column].tolist()):
                if problem := parameter_problem(name, value):
                    raise ParameterError(f"{name} of run {run} {problem}.")

    def _fail(self) -> None:
        """Raise the error of the first run that has gone wrong."""
        counts = self._batch.warning[:, :, 1]
        bad = counts.any(axis=1) | ~np.isfinite(self._batch.state).all(axis=1)
        run = int(np.flatnonzero(bad)[0])
        kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(counts[run])]
        reason = f"MuJoCo warning {', '.join(kinds)}" if kinds else "state is not finite"
        time = float(self._time[run])
        message = f"run {run} failed at t = {time:.3f} s: {reason}."
        raise SimulationError(message, run=run, time=time, reason=reason)


class _Quiet(AbstractContextManager[None]):
    """Keep the engine from printing warnings, and from writing them into the user's folder.

    Its counters still count them, and they become errors. The setting is one for the process:
    where plants step in several threads, the first makes it quiet and the last puts it back.
    """

    def __init__(self) -> None:
        self._lock, self._inside = Lock(), 0

    def __enter__(self) -> None:
        with self._lock:
            if not self._inside:
                self._before, silent = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
                silent.logto_console = silent.logto_file = False
                silent.set()
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside:
                self._before.set()


QUIET = _Quiet()
"""To be entered around many steps: once inside, a step need not set and reset anything."""


def _compile(model: str, timestep: float, nonlinear: Sequence[Nonlinearity]) -> mujoco.MjModel:
    xml, _ = model_files(model)
    spec = mujoco.MjSpec.from_string(xml)
    spec.option.timestep = timestep
    spec.compiler.discardvisual = True  # shapes only cost time here
    for feature in nonlinear:
        feature.build(spec)
    if not any(isinstance(feature, FrictionConfig) for feature in nonlinear):
        # No other feature is a constraint; to look for them takes a twelfth of a step.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return spec.compile()
