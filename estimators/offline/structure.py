"""
Prior distributions of unknown parameters, with initial values, standard deviations and bounds.

The dry friction, the backlash and the cogging of an axis are usually unknown, but the rms torque
and motion indicate their typical magnitudes. The priors express friction and cogging torques as
fractions of the rms motor torque. The priors express the speeds at which friction changes as
fractions of the rms speed, and the backlash of a gear as a fraction of the rms twist. A simulation
with the linear model computes the rms values from a recorded torque, so the priors apply to any
axis and any units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axis_models import N1, PAPER, real_axis, three_mass
from flexaxis.estimators.models.discretisation import discretize
from flexaxis.estimators.models.laws import INPUT, LAWS, Law
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parameter_meaning import is_nominal_axis, structure
from flexaxis.estimators.offline.predictor import as_torque, respond

Array = NDArray[np.float64]

TRACKED = ("k_T", "1/J_a", "f_m", "f_c")
"""Parameters that change while an axis is in use: three of the linear model, and dry friction."""

TOLD = 0.2  # relative standard deviation of a parameter known from a data sheet or an old log
DAMPING = 0.3  # relative standard deviation of a damping parameter, which is rarely measured
FIRM = 0.1  # relative standard deviation of masses and springs, which are computed in the design
INTEGRATES = 1e-9  # largest |pole| of an integrator, relative to that of the fastest mode
BOX = (0.1, 10.0)  # bounds of linear-model parameters, as multiples of their initial values


@dataclass(frozen=True)
class Sizes:
    """
    The rms magnitudes that serve as units for the parameters of a torque law.

    Attributes
    ----------
    drive : float
        Rms value of the law's driving variable, which is a speed, a twist, an angle or a torque.
    force : float
        Law torque that would accelerate the axis as much as the rms motor torque does.
    rate : float
        Rms value of the driving variable's derivative, divided by the rms value of the variable
        itself [1/s]. The attribute ``rate`` is at least the rate of the fastest mode of the model.
    """

    drive: float
    force: float
    rate: float


NOMINAL: Mapping[str, Sizes] = {
    name: Sizes(*kind.nominal) for name, kind in LAWS.items() if kind.nominal
}
"""Rms magnitudes for each kind of torque law on the reference trajectory of the nominal axis."""


NOMINAL_STATES = {
    "twist_gear": 7.5e-4,
    "twist_arm": 2.2e-3,
    "speed_motor": 5.0,
    "speed_gear": 0.09,
    "speed_arm": 0.22,
}
"""Rms value of each state of the nominal axis on its reference trajectory."""


def measured(model: Model, torque: ArrayLike | None, period: float) -> list[tuple[Law, Sizes]]:
    """
    Return each torque law of a model with the rms magnitudes of its variables.

    Parameters
    ----------
    model : Model
    torque : (N,) array_like or None
        Recorded torque of a moving axis [N m], or None to use the stored magnitudes of the nominal
        axis.
    period : float
        Sampling period [s].

    Raises
    ------
    EstimatorError
        If the torque is invalid. The error also occurs if the torque is None and the axis is not
        the nominal axis.
    """
    if torque is None:
        return [(law, _stored(model, law)) for law in model.laws]
    u = as_torque(torque)
    if not np.all(np.isfinite(u)) or not u.any():
        raise EstimatorError("the torque must be finite, and must not be zero throughout")
    A, B, _ = matrices(model)
    x = _driven(model, u, period)
    changes = A @ x + np.outer(B, u)
    fastest = float(max(abs(np.linalg.eigvals(A))))  # 1/s, even if the reference is slow
    result = []
    for law, acts in zip(model.laws, _acts(model).T, strict=True):
        drive = np.array([law.drive.get(state, 0.0) for state in model.states])
        size = float(np.std(drive @ x + law.drive.get(INPUT, 0.0) * u))
        if not size > 0:
            drives = ", ".join(law.drive)
            raise EstimatorError(
                f"the given torque has no effect on {drives}, on which a torque law depends"
            )
        rate = float(np.sqrt(np.mean((drive @ changes) ** 2))) / size
        force = _force(model, acts) * float(np.sqrt(np.mean(u**2)))
        result.append((law, Sizes(size, force, max(rate, fastest))))
    return result


def matrices(model: Model) -> tuple[Array, Array, Array]:
    """Return A (n, n), B (n,) and C (n,) of a model's linear part, with C scaled to Σ|C_i| = 1."""
    linear = replace(model, laws=())
    one = linear.parametrize(linear.parameters[:1])
    A, B, C = one.matrices(one.theta)
    return A, B[:, 0], C[0] / np.abs(C).sum()


def _driven(model: Model, u: Array, period: float) -> Array:
    """Return the states (n, N) of a model's linear part, driven from rest by a torque (N,)."""
    A, B, _ = matrices(model)
    transition, gain = discretize(A, B[:, None], period)
    return respond(transition.copy(), gain[:, 0].copy(), u).T


def state_sizes(model: Model, torque: ArrayLike | None, period: float) -> Array:
    """
    Return the standard deviation (n,) of each state of a model that a given torque drives.

    The standard deviation of an angle is set to zero, because angles are measured relative to the
    initial position. If the torque is None, the function returns the stored values of the nominal
    axis.
    """
    if torque is None:
        return np.array([NOMINAL_STATES.get(state, 0.0) for state in model.states])
    moves = np.any(matrices(model)[0], axis=0)  # no derivative depends on an angle
    return moves * np.std(_driven(model, as_torque(torque), period), axis=1)


def _force(model: Model, acts: Array) -> float:
    """
    Return how large a law's torque must be to have the same effect as a unit input.

    The function compares the effects on a state on which both the law and the input act. If the law
    and the input act on no common state, as for load friction, the function compares the effects on
    the output. The effects on the output are compared at the frequency of the slowest pole, where
    the axis is almost rigid.

    Parameters
    ----------
    model : Model
    acts : (n,) array
        Factors that multiply the law's torque in the state derivatives.
    """
    A, B, C = matrices(model)
    for i in np.flatnonzero(B * acts):
        return float(abs(B[i] / acts[i]))
    rates = abs(np.linalg.eigvals(A))
    slowest = 1j * rates[rates > INTEGRATES * rates.max()].min() * np.eye(len(A))
    by_input, by_law = abs(C @ np.linalg.solve(slowest - A, np.column_stack([B, acts])))
    return float(by_input / by_law) if by_law > 0 and by_input > 0 else 1.0


def _acts(model: Model) -> Array:
    """Return the factors (n, L) that multiply the laws' torques in the state derivatives."""
    one = model.parametrize(model.parameters[:1])
    block, torques = one.blocks(one.theta)[0], slice(one.states, one.n)
    return np.asarray(block[: len(model.states), torques])


def _stored(model: Model, law: Law) -> Sizes:
    """Return stored magnitudes of the nominal axis; raise EstimatorError for any other axis."""
    linear = three_mass(model.nominal) if set(N1) <= set(model.nominal) else None
    if linear is None or tuple(model.states[: len(linear.states)]) != tuple(linear.states):
        known = False
    else:
        known = is_nominal_axis(linear, [p for p in linear.parameters if p != "r"])
    if not known or law.kind not in NOMINAL:
        raise EstimatorError(
            "the expected magnitudes of friction, backlash and cogging are known only for the "
            "nominal axis; for any other axis, give the torque of a motion that lasts tens of "
            "seconds"
        )
    return NOMINAL[law.kind]


@dataclass(frozen=True)
class Prior:
    """
    The prior distribution of the parameters θ before the first sample.

    Attributes
    ----------
    names : tuple of str
        Names of the parameters or inverse parameters.
    start, deviation : (p,) arrays
        Initial values θ(0), and the standard deviations of these values.
    lower, upper : (p,) arrays
        Lower and upper bounds of θ.
    scale : (p,) array
        Scales that make the parameters θ dimensionless. A torque law parameter is scaled by the
        prior standard deviation of an unknown value rather than by θ(0), which can be zero. The
        scale of any other parameter is θ(0).
    """

    names: tuple[str, ...]
    start: Array
    deviation: Array
    lower: Array
    upper: Array
    scale: Array

    @property
    def P0(self) -> Array:
        """Prior variances of the parameters (p,)."""
        return self.deviation**2

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of θ (p,), in the format of the filter option ``bounds``."""
        return self.lower, self.upper


def with_laws(
    nominal: Mapping[str, float] | Model,
    *,
    torque: ArrayLike | None = None,
    period: float,
) -> Model:
    """
    Return a model of a real axis with nonlinear torques and prior values of all unknowns.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Nominal values as in `flexaxis.estimators.models.axis_models.real_axis`, but torque law
        parameters are optional. The key ``gear_friction`` selects the friction law that depends on
        the gear load. If ``nominal`` is a model, the function returns this model unchanged.
    torque : (N,) array_like, optional
        Recorded torque [N m], from which the function computes the magnitudes of friction and
        backlash. By default, the function uses the magnitudes of the nominal axis.
    period : float
        Sampling period [s].

    Raises
    ------
    EstimatorError
        If no torque is given and the axis is not the nominal axis of the benchmark.
    """
    if isinstance(nominal, Model):
        return nominal
    missing = {"f_c": 0.0, "f_s": 0.0, "v_s": 0.0, "sigma_0": 1.0, "sigma_1": 0.0, "v_0": 0.0}
    missing |= {"kappa": 0.0, "gap": 0.0}
    missing |= {"c_sin": 0.0, "c_cos": 0.0} if "poles" in nominal else {}
    if nominal.get("gear_friction") or "mu_m" in nominal:
        missing |= dict.fromkeys(("mu_m", "mu_e", "mu_ms", "mu_es"), 0.0)
        missing |= dict.fromkeys(("v_s", "sharpness", "v_0"), 1.0)
    empty = real_axis(missing | dict(nominal))
    start = {
        name: _guess(role, law, sizes)[0]
        for law, sizes in measured(empty, torque, period)
        for role, name in law.own.items()
        if name not in nominal
    }
    return replace(empty, nominal=dict(empty.nominal) | start)


def told_of(nominal: Mapping[str, float] | Model) -> tuple[str, ...]:
    """Return the names of all parameters whose nominal values are given."""
    return nominal.parameters if isinstance(nominal, Model) else tuple(nominal)


def structure_names(model: Model, tracked: Sequence[str] = TRACKED) -> tuple[str, ...]:
    """
    Return the parameters of a model that an estimator should learn only once.

    Parameters
    ----------
    model : Model
        Model as returned by `with_laws`.
    tracked : sequence of str
        Names of the parameters or inverse parameters that the estimator tracks instead of learning
        them once.
    """
    taken = {name.removeprefix("1/") for name in tracked}
    laws = [
        name for law in model.laws for role, name in law.own.items() if not law.roles[role].told
    ]
    # a linear parameter of zero is absent, and its value provides no scale
    linear = [p for p in structure(model) if model.nominal[p]]
    names = dict.fromkeys([*linear, *laws])
    return tuple(name for name in names if name not in taken)


def prior(
    model: Model,
    names: Sequence[str],
    *,
    torque: ArrayLike | None = None,
    period: float,
    told: Sequence[str] = (),
    spread: float = TOLD,
) -> Prior:
    """
    Return the prior distribution of model parameters.

    Parameters
    ----------
    model : Model
        Model as returned by `with_laws`.
    names : sequence of str
        Names of model parameters or inverse parameters.
    torque, period : array_like, float
        The same options as in `with_laws`.
    told : sequence of str
        Names of torque law parameters with known values. The standard deviation of a known value is
        `TOLD` times the value, but at most the standard deviation of an unknown value.
    spread : float
        Prior standard deviation of the tracked parameters of the linear model, relative to θ(0).
    """
    guesses: dict[str, Array] = {}
    if any(name in model.law_parameters for name in names):
        for law, sizes in measured(model, torque, period):
            for role, name in law.own.items():
                if name in names:
                    guesses[name] = _guess(role, law, sizes)
    rows = []
    for name, start in zip(names, model.parametrize(names).theta, strict=True):
        if name in guesses:
            rows.append(_of_law(guesses[name], start, name in told))
        else:
            deviation = abs(start) * _relative(model, name, spread)
            box = sorted(factor * start for factor in BOX)
            rows.append((start, deviation, *box, start))
    return Prior(tuple(names), *np.array(rows, float).reshape(-1, 5).T)


def _relative(model: Model, name: str, spread: float) -> float:
    physical = name.removeprefix("1/")
    if name in PAPER or name in model.identify or physical in model.nonzero:
        return spread
    return DAMPING if physical in model.nonnegative else FIRM


def _of_law(guess: Array, start: float, told: bool) -> tuple[float, ...]:
    _, deviation, lower, upper = guess.tolist()
    known = min(deviation, TOLD * abs(start)) if told and start else deviation
    return start, known, min(lower, start), max(upper, 10 * start), deviation


def _guess(role: str, law: Law, sizes: Sizes) -> Array:
    """Return the initial value, standard deviation and bounds of a law parameter in SI units."""
    known = law.roles[role]
    if not known.size:  # a data-sheet value, such as a number of poles
        raise EstimatorError(
            f"the parameter {law.parameters[role]!r} of a torque law {law.kind!r} cannot be "
            "estimated, because this parameter has no prior; give its nominal value"
        )
    unit = {
        "1": 1.0,
        "force": sizes.force,
        "drive": sizes.drive,
        "1/drive": 1 / sizes.drive,
        "1/drive^2": 1 / sizes.drive**2,
        "force/drive": sizes.force / sizes.drive,
        "force*rate/drive": sizes.force * sizes.rate / sizes.drive,
    }[known.size]
    return unit * np.array(known.guess)
