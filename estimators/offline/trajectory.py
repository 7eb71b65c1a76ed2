"""A model along a record, with derivatives by parameters, initial state, offset and delay."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import compiled
from flexaxis.estimators.models.discretisation import LAW_STEPS, law_steps
from flexaxis.estimators.models.law_torques import BRISTLE, STATIC
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.sampled import copy, prepare, travel
from flexaxis.estimators.offline.delay import delay_slope, delayed
from flexaxis.estimators.offline.dry import dry, is_dry
from flexaxis.estimators.offline.reversals import follow
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

OFFSET = "torque_offset"
COARSE, FINE = 8, 16  # steps of a sample in which friction reverses: of a search, and of its end
RESTS = 1e-3  # of the greatest speed, below which friction sticks


def _with_offset(model: Model) -> Model:
    """
    Return a model with a torque that never changes as one more state, beside the given torque.

    Its value is then an initial state, and derivatives by it are those by that state.

    Examples
    --------
    >>> from flexaxis.estimators.models.axes import one_mass
    >>> _with_offset(one_mass({"k_T": 1.0, "J_m": 1e-3, "f_m": 0.01})).A
    (('-f_m/J_m', 'k_T/J_m'), ('0', '0'))
    """
    return replace(
        model,
        states=(*model.states, OFFSET),
        A=(
            *((*row, b) for row, b in zip(model.A, model.B, strict=True)),
            ("0",) * (len(model.states) + 1),
        ),
        B=(*model.B, "0"),
        C=(*model.C, "0"),
    )


@dataclass(frozen=True)
class Course:
    """
    What a model makes of a torque, as a function of everything that a record leaves open.

    The unknowns are z = [θ, gains, initial states, offset of the torque, delay of the torque].

    Attributes
    ----------
    model : Parametrization
        Of a model `_with_offset`.
    free : tuple of int
        Which states are unknown where a stretch begins; all others but the offset are zero.
    offset : int
        Place of the offset of the torque among the states.
    u : (N,) array
        Torque as logged.
    period : float
        Sampling period [s].
    smooth : bool
        Whether the torque goes on changing between samples, see `delayed`.
    begins : tuple of int
        Samples at which stretches begin, each with a state of its own, for what acts in a gap is
        not known, nor the state that it leads to. The output is zero up to the first; at another
        it is still of the stretch before.
    resting : bool
        Whether the first of them begins at rest.
    dry : bool
        Whether the law is Coulomb friction, of which reversals are met exactly.
    beside : (m, N) array
        What acts beside the torque in proportion to a gain each, such as the sine of a measured
        angle.
    """

    model: Parametrization
    free: tuple[int, ...]
    offset: int
    u: Array
    period: float
    smooth: bool
    begins: tuple[int, ...] = (0,)
    resting: bool = False
    dry: bool = False
    beside: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def p(self) -> int:
        """Number of parameters θ."""
        return len(self.model.names)

    @property
    def m(self) -> int:
        """Number of gains."""
        return len(self.beside)

    @property
    def q(self) -> int:
        """Number of unknowns."""
        return self.p + self.m + len(self.free) * (len(self.begins) - self.resting) + 2

    @property
    def states(self) -> list[slice]:
        """Places in z of the state that each stretch begins with; none of rest."""
        first, width = self.p + self.m, len(self.free)
        own = [slice(first, first)] if self.resting else []
        return own + [slice(k, k + width) for k in range(first, self.q - 2, width or 1)]

    @property
    def coarsens(self) -> bool:
        """Whether there are laws that are solved in steps."""
        return self.model.laws is not None and not self.dry

    def fastest(self, theta: Array) -> float:
        """Return the greatest |pole| of the linear part, in radians a sample; inf if it is none."""
        A = self.model.blocks(theta)[0][:-1, :-1]
        if not np.isfinite(A).all():
            return np.inf
        return float(np.max(abs(np.linalg.eigvals(A)))) * self.period

    def along(self, z: Array, *, coarse: bool = False) -> tuple[Array, Array]:
        """
        Return the output ŷ (N,) and its derivatives (q, N) at z; both 0 up to where it begins.

        Parameters
        ----------
        z : (q,) array
        coarse : bool
            Whether laws may be solved at less places of a sample, in a search that goes on;
            Coulomb friction alone is solved exactly in any case.
        """
        p, m = self.p, self.m
        samples = z[-1] / self.period
        torque = delayed(self.u, samples, smooth=self.smooth)
        slopes = np.zeros((m + 1, len(torque)))
        slopes[-1] = delay_slope(self.u, samples, smooth=self.smooth) / self.period
        if m:
            slopes[:m] = self.beside
            torque = torque + z[p : p + m] @ self.beside
        width = max(place.stop - place.start for place in self.states)
        further, offset = m + width + 2, self.offset
        step = self._stepper(z[:p], further, coarse=coarse)
        found = np.zeros((1 + self.q, len(torque)))
        ends = [*self.begins[1:], len(torque) - 1]
        for begin, end, place in zip(self.begins, ends, self.states, strict=True):
            X, own = np.zeros((1 + p + further, self.model.n + 1)), place.stop - place.start
            X[0, list(self.free)[:own]], X[0, offset] = z[place], z[-2]
            X[1 + p + m + np.arange(own), list(self.free)[:own]] = 1.0
            X[-2, offset] = 1.0
            here = slice(begin, end + 1)
            on = step(X, torque[here], np.ascontiguousarray(slopes[:, here]))[:, 1:]
            lanes = [*range(1 + p + m + own), len(X) - 2, len(X) - 1]
            rows = [*range(1 + p + m), *range(1 + place.start, 1 + place.stop), self.q - 1, self.q]
            found[rows, begin + 1 : end + 1] = on[lanes]
        return found[0], found[1:]

    def _stepper(
        self, theta: Array, further: int, *, coarse: bool
    ) -> Callable[[Array, Array, Array], Array]:
        """Return what takes a state and derivatives along a torque, and returns what is put out."""
        places = self.offset, 0, 1 + self.p
        if self.dry:
            rubbed = dry(self.model, theta, self.period)
            return lambda X, torque, slopes: follow(rubbed, X, torque, slopes, *places)
        here = replace(self.model, theta=theta)
        least = -(-law_steps(here, self.period) // LAW_STEPS)  # more than one if the axis is fast
        ready = reversing = prepare(here, theta, self.period, steps=least, further=further)
        if here.laws is not None:
            often = max(COARSE if coarse else FINE, least)
            reversing = prepare(here, theta, self.period, steps=often, further=further)
        return lambda X, torque, slopes: _along(ready, reversing, X, torque, slopes, *places)


def course(
    model: Model,
    names: Sequence[str],
    u: Array,
    *,
    period: float,
    output: str = "speed",
    smooth: bool = False,
    resting: bool = True,
    begins: Sequence[int] = (0,),
    beside: Array | None = None,
) -> Course:
    """
    Return the course of a model along a torque.

    Parameters
    ----------
    model : Model
        With or without laws.
    names : sequence of str
        Parameters θ.
    u : (N,) array
        Torque.
    period : float
        Sampling period [s].
    output : {"speed", "increment"}
    smooth : bool
        As for `delayed`.
    resting : bool
        Whether the axis is known to be at rest at the first sample.
    begins : sequence of int
        Samples at which stretches begin, see `Course`.
    beside : (m, N) array, optional
        What acts beside the torque, see `Course`.
    """
    chosen = find_signal(output).predicted(_with_offset(model), period).parametrize(names)
    moving = not resting or len(begins) > 1
    free = (*range(len(model.states)), *_own(chosen)) if moving else ()
    torque, alone = np.ascontiguousarray(u, float), is_dry(chosen, period)
    more = np.zeros((0, len(torque))) if beside is None else beside
    offset = len(model.states)
    return Course(chosen, free, offset, torque, period, smooth, tuple(begins), resting, alone, more)


def _own(model: Parametrization) -> list[int]:
    """Return the places of the states that laws have of their own."""
    return [] if model.laws is None else [int(i) for i in model.laws.memory if i >= 0]


@compiled
def _along(ready, reversing, X, u, slopes, offset, begin, first):  # noqa: PLR0917
    """
    Return output and derivatives (rows, N); X is lost.

    Rows from ``first`` on are by what acts beside the torque, the last one by the delay.

    Away from its reversals friction is smooth, and a step of a sample is enough; where it reverses
    the error is what friction does in a step, so that these are many.
    """
    moved, rows = np.zeros_like(X), np.zeros((len(X), len(u)))
    laws = len(ready.response)
    peak, last = np.zeros(laws), np.zeros(laws)
    for k in range(begin, len(u) - 1):
        for j in range(len(slopes) - 1):
            X[first + j, offset] = slopes[j, k]
        X[-1, offset] = slopes[-1, k]
        travel(ready, X, moved, u[k])
        if _turns(ready.laws, ready.drive, X, moved, peak, last):
            travel(reversing, X, moved, u[k])
        copy(moved, X)
        for a in range(len(X)):
            rows[a, k + 1] = X[a, -1]
    return rows


@compiled
def _turns(laws, drive, X, moved, peak, last):  # noqa: PLR0917
    """
    Return whether some friction reverses in a sample, or sticks.

    peak (L,) is the greatest speed, last (L,) that of the sample before. What a step of a sample
    says where it reverses need not be near the truth, so the last change is looked at as well.
    Stiff bristles that stick swing faster than a sample: their derivatives grow where it is one
    step.
    """
    found = False
    for i in range(len(laws)):
        if laws[i]["kind"] != BRISTLE and laws[i]["kind"] != STATIC:
            continue
        before, after = 0.0, 0.0
        for m in range(X.shape[1] - 1):
            before += drive[i, m] * X[0, m]
            after += drive[i, m] * moved[0, m]
        change = max(abs(after - before), 2.0 * abs(before - last[i]))
        peak[i], last[i] = max(peak[i], abs(before)), before
        near = before * after <= 0.0 or min(abs(before), abs(after)) < 0.5 * change
        rests = max(abs(before), abs(after)) < RESTS * peak[i]
        found |= near or rests
    return found
