"""A model along a record, with derivatives by parameters, initial states, offset and delay."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from flexaxis.estimators.models.discretisation import law_steps
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.simulation import along, simulation
from flexaxis.estimators.offline.coulomb import Sampled, follow, is_dry, sampled

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STEPS = 2  # for each step in which filters solve laws
STEP = 1e-6  # of an unknown, by which derivatives are taken
LEAST = 1e-3  # rad/s or rad, of an initial state for that step


def delayed(u: ArrayLike, samples: float, *, smooth: bool = False) -> Array:
    """
    Return the mean torque (N,) that acts over each sample, when it acts late.

    A held torque u that is late by n + δ samples is u[k−n−1] for the first δ of sample k and
    u[k−n] for the rest: on average (1−δ) u[k−n] + δ u[k−n−1], which gives an inertia exactly the
    same speed at the end of the sample. Where u is a sequence of means of a smooth signal, such
    as a measured current, it is shifted along a cubic spline instead.

    Parameters
    ----------
    u : (N,) array_like
        Torque; before the first sample it is zero if held, and the first value if smooth.
    samples : float
        Delay in samples, any fraction of one; negative for a torque that acts early, of which the
        last value stays.
    smooth : bool
        Whether u comes from a smooth signal.

    Examples
    --------
    >>> delayed([0.0, 4.0, 4.0, 0.0], 0.25)
    array([0., 3., 4., 1.])
    """
    u = np.asarray(u, float)
    times = np.arange(len(u))
    if smooth:
        return CubicSpline(times, u)(np.clip(times - samples, 0, len(u) - 1)) if samples else u
    whole, part = divmod(samples, 1)
    places = times - int(whole)
    now, before = (np.where(k < 0, 0.0, u[np.minimum(k, len(u) - 1)]) for k in (places, places - 1))
    return (1 - part) * now + part * before


@dataclass(frozen=True)
class Trajectory:
    """
    The output of a model for a torque, as a function of everything that a record leaves open.

    The unknowns are z = [θ, gains, states, offset of the torque, delay of the torque]: the states
    at the beginning of each stretch, one after the other.

    Attributes
    ----------
    model : Parametrization
        With or without laws.
    u : (N,) array
        Torque as logged.
    period : float
        Sampling period [s].
    smooth : bool
        Whether the torque goes on changing between samples, see `delayed`.
    begins : tuple of int
        Samples at which stretches begin, each with its own state, since neither the torque in a
        gap nor the state after it is known. The output is 0 up to the first; at another one it
        still belongs to the stretch before.
    beside : (m, N) array
        Torques that act in proportion to a gain each, such as the sine of a measured angle.
    """

    model: Parametrization
    u: Array
    period: float
    smooth: bool = False
    begins: Sequence[int] = (0,)
    beside: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def p(self) -> int:
        """Number of parameters θ."""
        return len(self.model.names)

    @property
    def first(self) -> int:
        """Place in z of the first state, behind parameters and gains."""
        return self.p + len(self.beside)

    @property
    def free(self) -> list[int]:
        """The states that are unknown where a stretch begins; all others are 0."""
        return [i for i in range(self.model.states) if i not in self.model.reset]

    @property
    def q(self) -> int:
        """Number of unknowns."""
        return self.first + len(self.free) * len(self.begins) + 2

    @property
    def states(self) -> list[slice]:
        """Places in z of the state that each stretch begins with."""
        width = len(self.free)
        return [slice(k, k + width) for k in range(self.first, self.q - 2, width)]

    @cached_property
    def in_steps(self) -> bool:
        """Whether there are laws that are solved in steps."""
        return self.model.forces > 0 and not is_dry(self.model, self.period)

    def fastest(self, theta: Array) -> float:
        """Return the greatest |pole| of the linear part, in radians a sample; inf if not finite."""
        A = self.model.blocks(theta)[0][:-1, :-1]
        if not np.isfinite(A).all():
            return np.inf
        return float(np.max(abs(np.linalg.eigvals(A)))) * self.period

    def along(self, z: Array, held: Flags | None = None) -> tuple[Array, Array]:
        """
        Return the output ŷ (N,) and its derivatives (q, N) at z; both 0 up to where it begins.

        Parameters
        ----------
        z : (q,) array
        held : (q,) array of bool, optional
            Unknowns that do not move: their derivatives are 0.
        """
        free = np.ones(self.q, bool) if held is None else ~held
        (y, slopes), size, offset = self._simulated(z), self._steps(z), self.q - 2
        known, width = self.p if self.in_steps else 0, len(self.free)
        moves = [[i] for i in (*range(known, self.first), offset, offset + 1)]
        if not known:  # the states of all stretches move together, as each acts on its own
            moves += [[*range(self.first + i, offset, width)] for i in range(width)]
        for places in moves:
            rows = [i for i in places if free[i]]
            if rows:
                moved = z.copy()
                moved[rows] += size[rows]
                change = self._simulated(moved)[0] - y
                for i in rows:
                    slopes[i] = change / (moved[i] - z[i])
        if free[-1] and z[-1]:  # a held torque has a kink at whole samples
            moved = np.r_[z[:-1], z[-1] - size[-1]]
            slopes[-1] = (slopes[-1] + (y - self._simulated(moved)[0]) / (z[-1] - moved[-1])) / 2
        for place, (begin, end) in zip(self.states, self._ends(), strict=True):
            slopes[place, : begin + 1] = slopes[place, end + 1 :] = 0.0
        slopes[~free] = 0.0
        return y, slopes

    def _steps(self, z: Array) -> Array:
        """Return by how much unknowns (q,) are moved for derivatives."""
        size = np.full(self.q, LEAST)
        size[: self.p] = abs(self.model.theta)
        size[self.p : self.first] = size[-2] = np.std(self.u)
        size = STEP * np.maximum(abs(z), np.where(size > 0, size, LEAST))
        size[-1] = 10 * STEP * self.period
        return size

    @cached_property
    def _late(self) -> Callable[[float], Array]:
        """The torque by its delay in samples; most unknowns move without it."""
        return lru_cache(2)(lambda samples: delayed(self.u, samples, smooth=self.smooth))

    @cached_property
    def _sampled(self) -> Callable[[tuple[float, ...]], Sampled]:
        return lru_cache(2)(lambda theta: sampled(self.model, np.array(theta), self.period))

    def _ends(self) -> list[tuple[int, int]]:
        return list(pairwise([*self.begins, len(self.u) - 1]))

    def _simulated(self, z: Array) -> tuple[Array, Array]:
        """Return ŷ (N,) and, where laws are solved in steps, derivatives (q, N) by θ and states."""
        p, theta, free = self.p, z[: self.p], self.free
        torque = self._late(z[-1] / self.period) + z[-2]
        torque += z[p : self.first] @ self.beside if len(self.beside) else 0.0
        y, slopes = np.zeros(len(torque)), np.zeros((self.q, len(torque)))
        if self.in_steps:
            steps = STEPS * law_steps(replace(self.model, theta=theta), self.period)
        else:
            axis = self._sampled(tuple(theta))
        for place, (begin, end) in zip(self.states, self._ends(), strict=True):
            here = slice(begin + 1, end + 1)
            if self.in_steps:
                run = simulation(self.model, theta, self.period, steps=steps, further=len(free))
                run["X"][free, 0], run["X"][free, 1 + p + np.arange(len(free))] = z[place], 1.0
                rows = along(run, torque[begin:end]).T
                y[here], slopes[:p, here] = rows[0], rows[1 : 1 + p]
                slopes[place, here] = rows[1 + p : 1 + p + len(free)]
            else:
                x = np.zeros(self.model.n + 1)
                x[free] = z[place]
                y[here] = follow(axis, x, torque[begin:end])
        return y, slopes
