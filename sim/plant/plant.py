"""Simulate several axes in MuJoCo in parallel; their parameters can change at each sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

from flexaxis.models_mjcf import DEFAULT, model_files
from flexaxis.sim.errors import ParameterError, SimulationError
from flexaxis.sim.parameters import AxisParameters, parameter_names, parameter_problem
from flexaxis.sim.plant import callback
from flexaxis.sim.tables.friction import COMPILED_LAWS, FrictionConfig
from flexaxis.sim.tables.nonlinear import Nonlinearity, Place

Array = NDArray[np.float64]

# Only the first of an actuator's six transmission ratios acts on a hinge. The three principal
# inertias of a body are kept equal, so that they are physically possible.
_FIELDS = {
    "J": "body_inertia", "k": "tendon_stiffness", "d": "tendon_damping", "f": "dof_damping",
}  # fmt: skip
_KINDS = {"dof": "joint", "actuator": "actuator"}


@contextmanager
def quiet() -> Iterator[None]:
    """Prevent MuJoCo from printing warnings and from writing them to a file in the user's folder.

    MuJoCo still counts its warnings, and `Plant.step` raises an error if there is a warning. The
    context manager affects all MuJoCo simulations of the process.
    """
    before, silent = mujoco.MjLogConfig.get(), mujoco.MjLogConfig.get()
    silent.logto_console = silent.logto_file = False
    silent.set()
    try:
        yield
    finally:
        before.set()


class Plant:
    """Several axes that are simulated in parallel, with a constant torque during each sample.

    All axes start at rest at angle zero. The simulated signals of an axis are bitwise identical,
    however many axes are simulated in parallel.

    Parameters
    ----------
    parameters : sequence of AxisParameters, or ndarray (R, P)
        Parameters of each run.
    model : str
        Name of the model, one of `flexaxis.models_mjcf.MODEL_NAMES`.
    period : float
        Simulated time per call of `step` [s].
    substeps : int
        Number of fourth-order Runge-Kutta steps per call of `step`.
    nonlinear : sequence of Nonlinearity
        Nonlinear effects of the axis, as defined in `flexaxis.sim.tables.nonlinear`.

    Attributes
    ----------
    angles, speeds : ndarray (R, n)
        Current angles and speeds of the n masses [rad, rad/s]. Both arrays are views of the
        simulated state in MuJoCo, so each call of `step` changes their values.
    angle_m, speed_m : ndarray (R,)
        Current angle and speed of the motor [rad, rad/s]. The arrays are views of the motor's
        columns in `angles` and `speeds`.

    Raises
    ------
    ParameterError
        If a parameter value of an axis is physically impossible.
    """

    def __init__(
        self,
        parameters: Sequence[AxisParameters] | Array,
        *,
        period: float,
        substeps: int,
        nonlinear: Sequence[Nonlinearity] = (),
        model: str = DEFAULT,
    ) -> None:
        self._names = parameter_names(model)
        self._called = any(isinstance(each, COMPILED_LAWS) for each in nonlinear)
        if self._called:
            callback.install()
        made = _compile(model, period / substeps, nonlinear)
        self._batch = Batch(made, len(parameters), 1)
        self._substeps = substeps
        self._places = [*_parameter_places(self._batch, self._names)]
        self._cubic = made.tendon_stiffnesspoly / made.tendon_stiffness[:, None]
        laws = [each for each in nonlinear if each.kept(each.law)]
        self._laws = [_LawInEngine(self._batch, made, law) for law in laws]
        self._values = np.full((len(parameters), len(self._names)), np.nan)
        self.angles: Array = self._batch.bind("qpos")
        self.speeds: Array = self._batch.bind("qvel")
        self.angle_m, self.speed_m = self.angles[:, 0], self.speeds[:, 0]
        self._torque: Array = self._batch.bind("ctrl")[:, 0]
        self._time: Array = self._batch.bind("time")
        self.set_parameters(parameters)

    def set_parameters(self, parameters: Sequence[AxisParameters] | Array) -> None:
        """Change the axis parameters without changing the current angles and speeds.

        If the inertia of a body changes, the body keeps its speed, so its momentum changes. This
        change corresponds to an axis that picks up or drops a load moving at the same speed.

        Parameters
        ----------
        parameters : sequence of AxisParameters, or ndarray (R, P)
            New parameter values of each run. Only changed parameter values are written to the
            physics engine.

        Raises
        ------
        ParameterError
            If a parameter value is physically impossible. After an error, all parameters keep their
            old values.
        """
        rows = [[*p.values()] if isinstance(p, AxisParameters) else p for p in parameters]
        values = np.array(rows, dtype=float)
        new = values != self._values
        for run, column in np.argwhere(new):
            if problem := parameter_problem(self._names[column], float(values[run, column])):
                raise ParameterError(f"{self._names[column]} of run {run}: {problem}.")
        changed = np.flatnonzero(new.any(axis=0))
        for column in changed:  # transposed, because an inertia has three entries per run
            self._places[column].T[...] = values[:, column]
        if self._cubic.any():  # the cubic coefficient is proportional to the stiffness
            linear = self._batch.expand("tendon_stiffness")
            self._batch.expand("tendon_stiffnesspoly")[...] = linear[..., None] * self._cubic
        if any(self._names[column][0] in "Jr" for column in changed):
            self._batch.set_const()  # recompute the constants that the engine derives
        self._values = values

    def set_law(self, name: str, values: float | Array) -> None:
        """Change a parameter of a nonlinear effect, such as the Coulomb friction f_c.

        Parameters
        ----------
        name : str
            Name of a parameter of a nonlinear effect. If several nonlinear effects have a parameter
            of the same name, only the parameter of the first effect changes.
        values : float or ndarray (R,)
            New parameter value for all runs, or one new value per run.
        """
        next(law for law in self._laws if name in law.values).set(name, values)

    def step(self, torque: Array) -> None:
        """Simulate one sampling period with a constant torque command.

        Parameters
        ----------
        torque : ndarray (R,)
            Torque command of each run [N m].

        Raises
        ------
        SimulationError
            If the physics engine issues a warning, or if an angle or speed is not finite.
        """
        if self._called:
            callback.install()  # the user may have replaced the callback
        self._torque[:] = torque
        with quiet():
            self._batch.step(nstep=self._substeps)
        if self._batch.warning.any() or not np.isfinite(self._batch.state).all():
            self._fail()

    def _fail(self) -> None:
        """Raise a SimulationError with the cause and time of the first failed run in the batch."""
        counts = self._batch.warning[:, :, 1]
        bad = counts.any(axis=1) | ~np.isfinite(self._batch.state).all(axis=1)
        run = int(np.flatnonzero(bad)[0])
        kinds = [mujoco.mjtWarning(kind).name for kind in np.flatnonzero(counts[run])]
        reason = f"MuJoCo warning {', '.join(kinds)}" if kinds else "state is not finite"
        time = float(self._time[run])
        message = f"run {run} failed at t = {time:.3f} s: {reason}."
        raise SimulationError(message, run=run, time=time, reason=reason)


def _compile(model: str, timestep: float, nonlinear: Sequence[Nonlinearity]) -> mujoco.MjModel:
    xml, _ = model_files(model)
    spec = mujoco.MjSpec.from_string(xml)
    spec.option.timestep = timestep
    spec.compiler.discardvisual = True  # shapes are not needed and cost time
    for feature in nonlinear:
        feature.build(spec)
    if not any(isinstance(feature, FrictionConfig) for feature in nonlinear):
        # Only Coulomb friction is a constraint. Without Coulomb friction, skip the search for
        # constraints, which takes 1/12 of the computing time of a step.
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return spec.compile()


def _parameter_places(batch: Any, names: Sequence[str]) -> Iterator[Array]:
    """For each parameter in `names`, yield the MuJoCo array of its values, with one row per run.

    The inertias must be in the order of the bodies, and the stiffnesses in the order of the
    tendons.
    """
    seen = Counter({"J": 1})  # the first body is the world
    for name in names:
        if name == "k_T":
            yield batch.expand("actuator_gear")[:, 0, 0]
        elif name == "r":  # the coefficient of the motor in the first tendon
            yield batch.expand("wrap_prm")[:, 0]
        else:
            yield batch.expand(_FIELDS[name[0]])[:, seen[name[0]]]
            seen[name[0]] += 1


def _place(batch: Any, model: Any, place: Place) -> Array:
    """Return the MuJoCo array of the values at `place` in the model, with one row per run."""
    values: Array = batch.expand(place.field)
    match place.field:
        case "numeric_data":  # this field contains all custom numbers, concatenated
            return values[:, model.numeric_adr[model.numeric(place.owner).id] + place.column]
    kind = _KINDS[place.field.split("_", maxsplit=1)[0]]
    rows = values[:, getattr(model, kind)(place.owner).id]
    return rows if place.column is None else rows[:, place.column]


class _LawInEngine:
    """Parameter values of a nonlinear effect, and the fields of MuJoCo that store them."""

    def __init__(self, batch: Any, model: Any, law: Nonlinearity) -> None:
        self.values: dict[str, float | Array] = dict(law.law)
        self._kept = law.kept
        self._places = {at: _place(batch, model, at) for at in law.kept(self.values)}

    def set(self, name: str, values: float | Array) -> None:
        """Set a parameter to one value for all runs, or to a separate value for each run."""
        self.values[name] = values
        for place, value in self._kept(self.values).items():
            self._places[place][...] = value
