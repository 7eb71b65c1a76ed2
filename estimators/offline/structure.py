"""
What an axis may have beyond its linear model, before any of it is known: start, deviation, box.

Nobody knows the dry friction of an axis, its play or its cogging beforehand, but all of them are of
about the size of what moves: torques of laws are fractions of the rms torque, speeds at which
friction changes are fractions of the rms speed, a gap is one of the rms twist. These sizes are
taken from the torque of a run and the linear model, so that they hold for any axis and any units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.models.axes import PAPER, real_axis
from flexaxis.estimators.models.laws import Law
from flexaxis.estimators.models.meaning import structure
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import Motion, Sizes, measured, moved

Array = NDArray[np.float64]


TRACKED = ("k_T", "1/J_a", "f_m", "f_c")
"""What changes while an axis is in use: the paper's three, and dry friction."""

TOLD = 0.2  # relative deviation of a parameter that a data sheet or an old log tells
DAMPING = 0.3  # of one that damps, which hardly anybody measures
FIRM = 0.1  # of the other parameters of the structure: masses and springs are computed
BOX = (0.1, 10.0)  # times the start, of all these


@dataclass(frozen=True)
class Prior:
    """
    What is thought of parameters θ before the first sample.

    Attributes
    ----------
    names : tuple of str
    start, deviation : (p,) arrays
        θ(0) and its standard deviation.
    lower, upper : (p,) arrays
        The box.
    scale : (p,) array
        By which θ is made relative: θ(0), or the deviation where that is zero or may become it.
    """

    names: tuple[str, ...]
    start: Array
    deviation: Array
    lower: Array
    upper: Array
    scale: Array

    @property
    def P0(self) -> Array:
        """Variances (p,)."""
        return self.deviation**2

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The box, as filters take it."""
        return self.lower, self.upper


def with_laws(
    nominal: Mapping[str, float] | Model,
    *,
    torque: ArrayLike | None = None,
    period: float,
    geared: bool = False,
) -> Model:
    """
    Return the axis with all that a real one has, each parameter that is not told at its start.

    Parameters
    ----------
    nominal : mapping of str to float, or Model
        Nominal values as for `flexaxis.estimators.models.axes.real_axis`, those of laws only where
        they are known; or a model with laws of its own, which is returned.
    torque : (N,) array_like, optional
        Torque of a run [N m], for the sizes; without it those of the nominal axis.
    period : float
        Sampling period [s].
    geared : bool
        Whether its friction grows with the load of the gear, though nobody told.

    Raises
    ------
    EstimatorError
        If there is no torque, and the axis is not the nominal one of the benchmark.
    """
    if isinstance(nominal, Model):
        return nominal
    missing = {"f_c": 0.0, "f_s": 0.0, "v_s": 0.0, "sigma_0": 1.0, "sigma_1": 0.0, "v_0": 0.0}
    missing |= {"kappa": 0.0, "gap": 0.0}
    missing |= {"c_sin": 0.0, "c_cos": 0.0} if "poles" in nominal else {}
    if geared or "mu_m" in nominal:
        missing |= dict.fromkeys(("mu_m", "mu_e", "mu_ms", "mu_es"), 0.0)
        missing |= dict.fromkeys(("v_s", "sharpness", "v_0"), 1.0)
    empty = real_axis(missing | dict(nominal))
    return guessed(empty, told_of(nominal), torque=torque, period=period)


def told_of(nominal: Mapping[str, float] | Model) -> tuple[str, ...]:
    """Return the parameters whose values somebody gave: a model of one's own has all of them."""
    return nominal.parameters if isinstance(nominal, Model) else tuple(nominal)


def guessed(
    model: Model,
    told: Sequence[str],
    *,
    torque: ArrayLike | None = None,
    period: float,
    motion: Motion | None = None,
) -> Model:
    """
    Return a model with each parameter of its laws that is not told at its start.

    Parameters
    ----------
    model : Model
    told : sequence of str
    torque, period
        As for `with_laws`.
    motion : Motion, optional
        How the axis moves, in the place of a torque, where its output drives all laws.
    """
    start = {
        name: _guess(role, law, sizes)[0]
        for law, sizes in _sized(model, torque, period, motion)
        for role, name in law.own.items()
        if name not in told
    }
    return replace(model, nominal=dict(model.nominal) | start)


def structure_names(model: Model, tracked: Sequence[str] = TRACKED) -> tuple[str, ...]:
    """
    Return what there is to learn once about a model: of its linear part, and of its laws.

    Parameters
    ----------
    model : Model
        As from `with_laws`.
    tracked : sequence of str
        What is tracked instead.
    """
    taken = {name.removeprefix("1/") for name in tracked}
    laws = [
        name for law in model.laws for role, name in law.own.items() if not law.roles[role].told
    ]
    # what is zero is not there, and has no size of its own
    linear = [p for p in structure(model) if model.nominal[p]]
    found = dict.fromkeys([*linear, *laws])
    return tuple(name for name in found if name not in taken)


def prior(
    model: Model,
    names: Sequence[str],
    *,
    torque: ArrayLike | None = None,
    period: float,
    told: Sequence[str] = (),
    spread: float = TOLD,
    motion: Motion | None = None,
) -> Prior:
    """
    Return what is thought of parameters before they are seen.

    Parameters
    ----------
    model : Model
        As from `with_laws`.
    names : sequence of str
        Parameters or their inverses; the paper's three have the deviation ``spread``.
    torque, period, motion
        As for `guessed`.
    told : sequence of str
        Parameters of laws that are known; they have the deviation `TOLD` or that of their size,
        whichever is smaller.
    spread : float
        Deviation of the tracked parameters of the linear model, relative to θ(0).
    """
    guesses: dict[str, Array] = {}
    if any(name in model.law_parameters for name in names):
        for law, sizes in _sized(model, torque, period, motion):
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


def _sized(
    model: Model, torque: ArrayLike | None, period: float, motion: Motion | None
) -> list[tuple[Law, Sizes]]:
    return measured(model, torque, period) if motion is None else moved(model, motion)


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
    """Return what is thought of a parameter of a law, in its unit: start, deviation, and box."""
    known = law.roles[role]
    if not known.size:  # a data-sheet value, such as a number of poles
        raise EstimatorError(
            f"nothing is known of the parameter {law.parameters[role]!r} of a law {law.kind!r} "
            "beforehand; it cannot be learnt, so give it as a nominal value"
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
