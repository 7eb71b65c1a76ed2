"""The simulated output of a model for a record, with derivatives with respect to all unknowns."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from flexaxis.estimators.models.discretisation import law_steps
from flexaxis.estimators.models.parametrization import Parametrization
from flexaxis.estimators.models.simulation import along, simulation
from flexaxis.estimators.offline.coulomb import follow, is_dry, sampled

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

STEPS = 2  # number of steps per sample to solve laws, relative to the number in a filter
STEP = 1e-6  # relative change of an unknown in numerical derivatives
LEAST = 1e-3  # rad/s or rad, smallest magnitude to which STEP is applied, for initial states


def delayed(u: ArrayLike, samples: float, *, smooth: bool = False) -> Array:
    """
    Return the mean torque that a delayed torque exerts during each sample, as an array (N,).

    If a piecewise constant torque u is delayed by n + δ samples, the delayed torque equals u[k−n−1]
    during the first fraction δ of sample k, and u[k−n] afterwards. The mean torque is the linear
    interpolation (1−δ) u[k−n] + δ u[k−n−1]. At the end of each sample, an inertia has exactly the
    same speed with the mean torque as with the delayed torque. If u is sampled from a smooth
    signal, such as a measured current, the function interpolates u with a cubic spline instead.

    Parameters
    ----------
    u : (N,) array_like
        Motor torque. Before the first sample, a piecewise constant torque is zero, and a smooth
        torque equals its first value.
    samples : float
        Delay in samples, not necessarily an integer. If the delay is negative, the torque acts
        early, and the last torque value is repeated at the end of the record.
    smooth : bool
        Whether u consists of samples of a smooth signal instead of piecewise constant values.

    Examples
    --------
    >>> delayed([0.0, 4.0, 4.0, 0.0], 0.25)
    array([0., 3., 4., 1.])
    """
    u = np.asarray(u, float)
    times = np.arange(len(u))
    if smooth:
        return CubicSpline(times, u)(np.clip(times - samples, 0, len(u) - 1)) if samples else u
    return np.interp(times - samples, np.arange(-1, len(u)), np.r_[0.0, u])


@dataclass(frozen=True)
class Trajectory:
    """
    The simulated output of a model for a torque, as a function of all unknown quantities.

    The vector of unknowns is z = [θ, gains, states, torque offset, torque delay]. The states in z
    are the initial states of all segments of the record, one after the other.

    Attributes
    ----------
    model : Parametrization
        Model with or without nonlinear torques.
    u : (N,) array
        Logged motor torque, without delay correction.
    period : float
        Sampling period [s].
    smooth : bool
        Whether the torque changes smoothly between samples, as defined in `delayed`.
    begins : tuple of int
        Indices of the samples at which the segments of the record begin. Each segment has its own
        initial state, because neither the torque in a gap nor the state after the gap is known. The
        output is 0 up to the start of the first segment. At the first sample of any later segment,
        the output still depends on the states of the previous segment.
    beside : (m, N) array
        Additional torques, such as the sine of a measured angle. Each additional torque is
        multiplied by its own unknown gain.
    """

    model: Parametrization
    u: Array
    period: float
    smooth: bool = False
    begins: Sequence[int] = (0,)
    beside: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def p(self) -> int:
        """Number of model parameters in θ."""
        return len(self.model.names)

    @property
    def first(self) -> int:
        """Index in z of the first initial state, which comes after the parameters and gains."""
        return self.p + len(self.beside)

    @property
    def free(self) -> list[int]:
        """Indices of the states that are unknown at the start of a segment; other states are 0."""
        return [i for i in range(self.model.states) if i not in self.model.reset]

    @property
    def q(self) -> int:
        """Number of unknowns in the vector z."""
        return self.first + len(self.free) * len(self.begins) + 2

    @property
    def states(self) -> list[slice]:
        """Positions in z of the initial states of each segment."""
        width = len(self.free)
        return [slice(k, k + width) for k in range(self.first, self.q - 2, width)]

    @cached_property
    def in_steps(self) -> bool:
        """Whether the model contains nonlinear torques that require step-by-step integration."""
        return self.model.forces > 0 and not is_dry(self.model, self.period)

    def fastest(self, theta: Array) -> float:
        """Return the largest |pole| of the linear part in radians per sample; inf on overflow."""
        A = self.model.matrices(theta)[0]
        return self.period * max(abs(np.linalg.eigvals(A))) if np.isfinite(A).all() else np.inf

    def along(self, z: Array, held: Flags | None = None) -> tuple[Array, Array]:
        """
        Return the output ŷ (N,) and its derivatives (q, N) at z.

        Parameters
        ----------
        z : (q,) array
            Values of the unknowns.
        held : (q,) array of bool, optional
            For each unknown, whether it is held constant, in which case its derivatives are 0. By
            default, no unknown is held constant.
        """
        free = np.ones(self.q, bool) if held is None else ~held
        (y, slopes), size, offset = self._simulated(z), self._steps(z), self.q - 2
        known, width = self.p if self.in_steps else 0, len(self.free)
        moves = [[i] for i in (*range(known, self.first), offset, offset + 1)]
        if not known:  # perturb the states of all stretches together: each affects its own stretch
            moves += [[*range(self.first + i, offset, width)] for i in range(width)]
        for places in moves:
            rows = [i for i in places if free[i]]
            if rows:
                moved = z.copy()
                moved[rows] += size[rows]
                change = self._simulated(moved)[0] - y
                for i in rows:
                    slopes[i] = change / (moved[i] - z[i])
        if free[-1] and z[-1]:  # with a held torque, ŷ has a kink at delays of whole samples
            moved = np.r_[z[:-1], z[-1] - size[-1]]
            slopes[-1] = (slopes[-1] + (y - self._simulated(moved)[0]) / (z[-1] - moved[-1])) / 2
        for place, (begin, end) in zip(self.states, self._ends(), strict=True):
            slopes[place, : begin + 1] = slopes[place, end + 1 :] = 0.0
        slopes[~free] = 0.0
        return y, slopes

    def _steps(self, z: Array) -> Array:
        """Return the step sizes of all unknowns for numerical derivatives, as an array (q,)."""
        size = np.full(self.q, LEAST)
        size[: self.p] = np.where(self.model.theta, abs(self.model.theta), LEAST)
        size[self.p : self.first] = size[-2] = np.std(self.u)
        return np.r_[STEP * np.maximum(abs(z), size)[:-1], 10 * STEP * self.period]

    def _ends(self) -> list[tuple[int, int]]:
        return list(pairwise([*self.begins, len(self.u) - 1]))

    def _simulated(self, z: Array) -> tuple[Array, Array]:
        """Return the output ŷ (N,) and the derivatives (q, N) that the integration provides."""
        p, theta, free = self.p, z[: self.p], self.free
        torque = delayed(self.u, z[-1] / self.period, smooth=self.smooth) + z[-2]
        torque += z[p : self.first] @ self.beside if len(self.beside) else 0.0
        y, slopes = np.zeros(len(torque)), np.zeros((self.q, len(torque)))
        if self.in_steps:
            steps = STEPS * law_steps(replace(self.model, theta=theta), self.period)
        else:
            axis = sampled(self.model, theta, self.period)
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
