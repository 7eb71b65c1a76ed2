"""A model along a record, with derivatives by parameters, initial state, offset and delay."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.compiler import inlined, loop
from flexaxis.estimators.models.discretisation import LAW_STEPS, law_steps
from flexaxis.estimators.models.law_torques import BRISTLE, STATIC
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.rows import copy
from flexaxis.estimators.models.simulation import any_sample, simulation, simulation_in
from flexaxis.estimators.offline.coulomb import dry, follow, is_dry
from flexaxis.estimators.offline.delay import delay_slope, delayed
from flexaxis.estimators.signals import find_signal

Array = NDArray[np.float64]

OFFSET = "torque_offset"
COARSE, FINE = 8, 32  # steps of a sample in which friction reverses: of a search, and of its end
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
    beside : (m, N) array
        What acts beside the torque in proportion to a gain each, such as the sine of a measured
        angle.
    dry : bool
        Whether the law is Coulomb friction, of which reversals are met exactly.
    """

    model: Parametrization
    free: tuple[int, ...]
    offset: int
    u: Array
    period: float
    smooth: bool
    begins: tuple[int, ...] = (0,)
    resting: bool = False
    beside: Array = field(default_factory=lambda: np.zeros((0, 0)))
    dry: bool = False

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
        return self.model.forces > 0 and not self.dry

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
            Whether laws may be solved at less places of a sample, in a search that goes on.
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
        further = m + width + 2
        found = np.zeros((1 + self.q, len(torque)))
        ends = [*self.begins[1:], len(torque) - 1]
        for begin, end, place in zip(self.begins, ends, self.states, strict=True):
            here = slice(begin, end)
            steps = self._exact if self.dry else self._stepped
            rows = steps(z, place, torque[here], slopes[:, here], further, coarse=coarse)
            own, last = place.stop - place.start, p + further
            lanes = [*range(1 + p + m + own), last - 1, last]
            to = [*range(1 + p + m), *range(1 + place.start, 1 + place.stop), self.q - 1, self.q]
            found[to, begin + 1 : end + 1] = rows[lanes]
        return found[0], found[1:]

    def _exact(
        self, z: Array, place: slice, u: Array, slopes: Array, further: int, *, coarse: bool
    ) -> Array:  # fmt: skip
        """Return output and derivatives (lanes, N) of a stretch under Coulomb friction."""
        p, own, last = self.p, place.stop - place.start, self.p + further
        X = np.zeros((1 + last, self.model.n + 1))
        X[0, list(self.free)[:own]], X[0, self.offset] = z[place], z[-2]
        X[1 + p + self.m + np.arange(own), list(self.free)[:own]] = 1.0
        X[last - 1, self.offset] = 1.0
        u, slopes = np.append(u, 0.0), np.hstack([slopes, np.zeros((len(slopes), 1))])
        rubbed = dry(self.model, z[:p], self.period)
        return follow(rubbed, X, u, slopes, self.offset, 0, 1 + p)[:, 1:]

    def _stepped(
        self, z: Array, place: slice, u: Array, slopes: Array, further: int, *, coarse: bool
    ) -> Array:  # fmt: skip
        """Return output and derivatives (lanes, N) of a stretch, laws solved in steps."""
        p, m, offset = self.p, self.m, self.offset
        usual, fine = self._simulations(z[:p], further, coarse=coarse)
        X, own, last = usual["X"], place.stop - place.start, p + further
        X[list(self.free)[:own], 0], X[offset, 0] = z[place], z[-2]
        X[list(self.free)[:own], 1 + p + m + np.arange(own)] = 1.0
        X[offset, last - 1] = 1.0
        rows = np.zeros((len(u), X.shape[1]))
        _along(
            usual.block, usual.at, fine.block, fine.at, np.zeros_like(X),
            np.zeros((2, self.model.forces)), u,
            np.ascontiguousarray(slopes),
            np.array([offset, 1 + p, last]), rows,
        )  # fmt: skip
        return rows.T

    def _simulations(self, theta: Array, further: int, *, coarse: bool) -> tuple[Memory, Memory]:
        """Return the model for samples in which friction is smooth, and for those in which not."""
        here = replace(self.model, theta=theta)
        least = -(-law_steps(here, self.period) // LAW_STEPS)  # more than 1 of a fast axis
        often = max(COARSE if coarse else FINE, least)
        usual, fine = (
            simulation(here, theta, self.period, steps=steps, further=further)
            for steps in (least, often)
        )
        return usual, fine


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
    torque = np.ascontiguousarray(u, float)
    more = np.zeros((0, len(torque))) if beside is None else beside
    offset = len(model.states)
    alone = is_dry(chosen, period)
    return Course(chosen, free, offset, torque, period, smooth, tuple(begins), resting, more, alone)


def _own(model: Parametrization) -> list[int]:
    """Return the places of the states that laws have of their own."""
    return [int(i) for i in model.laws.records["memory"] if i >= 0]


@loop
def _along(block, at, fine_block, fine_at, before, speeds, u, slopes, places, rows):  # noqa: PLR0917
    """
    Write output and derivatives (N, lanes).

    ``places`` are that of the offset of the torque among the states, of the derivatives by what
    acts beside the torque, and of that by its delay.

    Away from its reversals friction is smooth, and a step of a sample is enough; where it reverses
    the error is what friction does in a step, so that these are many.
    """
    axis, theta, X = simulation_in(block, at)
    fine, _, Y = simulation_in(fine_block, fine_at)
    offset, first, last = places[0], places[1], places[2]
    for k in range(len(u)):
        for j in range(len(slopes) - 1):
            X[offset, first + j] = slopes[j, k]
        X[offset, last] = slopes[len(slopes) - 1, k]
        for i in range(len(X)):
            copy(before, i, X, i)
        any_sample(axis, theta, X, u[k])
        if _turns(axis.laws, axis.drive, before, X, speeds):
            for i in range(len(X)):
                copy(Y, i, before, i)
            any_sample(fine, theta, Y, u[k])
            for i in range(len(X)):
                copy(X, i, Y, i)
        copy(rows, k, X, len(X) - 1)


@inlined
def _turns(laws, drive, before, after, speeds):
    """
    Return whether some friction reverses in a sample, or sticks.

    ``speeds`` (2, L) are the greatest speed, and that of the sample before. What a step of a sample
    says where it reverses need not be near the truth, so the last change is looked at as well.
    Stiff bristles that stick swing faster than a sample: their derivatives grow where it is one
    step.
    """
    found = False
    for i in range(len(laws)):
        if laws[i]["kind"] != BRISTLE and laws[i]["kind"] != STATIC:
            continue
        v, w = 0.0, 0.0
        for m in range(drive.shape[1] - 1):
            v += drive[i, m] * before[m, 0]
            w += drive[i, m] * after[m, 0]
        change = max(abs(w - v), 2.0 * abs(v - speeds[1, i]))
        speeds[0, i], speeds[1, i] = max(speeds[0, i], abs(v)), v
        near = v * w <= 0.0 or min(abs(v), abs(w)) < 0.5 * change
        rests = max(abs(v), abs(w)) < RESTS * speeds[0, i]
        found |= near or rests
    return found
