"""Base classes of all recursive estimators, with the methods step, run, reset and copy."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import deepcopy
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.fault_monitor import begin_anew
from flexaxis.estimators.models.memory import Memory
from flexaxis.estimators.models.series import LAWS
from flexaxis.estimators.signals import check_sample, check_signals, increments

Array = NDArray[np.float64]


class RecursiveEstimator(ABC):
    """
    Base class of all recursive estimators; subclasses process the checked samples in `_take`.

    Parameters
    ----------
    names : tuple of str
        Names of the p identified parameters.
    output : {"speed", "increment", "angle"}
        Name of the signal y.

    Attributes
    ----------
    names, output : tuple of str, str
        Parameter names and output signal, as passed to the constructor.
    theta : (p,) array
        Current parameter estimate θ[k].
    covariance : (p, p) array
        Covariance that the estimator claims for its parameter estimate.
    prediction : float
        Prediction ŷ[k] of the latest output y[k] from all earlier samples.
    innovation : float
        Innovation y[k] − ŷ[k], or NaN if y[k] is missing or no sample has been processed yet.
    innovation_variance : float
        Innovation variance claimed by the estimator, or NaN if the estimator claims no variance.
    innovations : (N, 2) array
        Innovation and its claimed variance for each sample that the last call of ``step`` or
        ``run`` processed.

    Notes
    -----
    The estimate θ[k] uses y[0..k] and u[0..k−1]. The torque u[k] is constant between t_k and
    t_{k+1}, so it first acts on y[k+1].
    """

    def __init__(self, names: tuple[str, ...], output: str) -> None:
        self.names, self.output = names, output
        self._one = np.empty(1), np.empty(1), np.empty(1, bool), np.empty((1, len(names)))
        self._trace = np.full((1, 3), np.nan)

    @property
    @abstractmethod
    def theta(self) -> Array: ...  # noqa: D102

    @property
    @abstractmethod
    def covariance(self) -> Array: ...  # noqa: D102

    @abstractmethod
    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        """
        Process N samples, and write the parameter estimates θ to ``estimates`` (N, p).

        The prediction ŷ, the innovation and its variance are written to ``trace`` (N, 3).
        """

    @abstractmethod
    def _start(self) -> None:
        """Reset the filter to its state before the first sample."""

    @property
    def prediction(self) -> float:  # noqa: D102
        return float(self._trace[-1, 0])

    @property
    def innovation(self) -> float:  # noqa: D102
        return float(self._trace[-1, 1])

    @property
    def innovation_variance(self) -> float:  # noqa: D102
        return float(self._trace[-1, 2])

    @property
    def innovations(self) -> Array:  # noqa: D102
        return self._trace[:, 1:].copy()

    def reset(self) -> None:
        """Reset the estimator to its initial state."""
        self._trace, self._reading = np.full((1, 3), np.nan), np.nan
        self._start()

    def copy(self) -> Self:
        """Return an independent copy of the estimator with the same state."""
        return deepcopy(self)

    def step(self, u: float, y: float | None) -> Array:
        """
        Process one sample and return the parameter estimate θ[k] (p,).

        Parameters
        ----------
        u : float
            Motor torque, which is constant from t_k until the next sample.
        y : float or None
            Output measured at time t_k, or None if this measurement is missing.
        """
        check_sample(u, y)
        one = self._one
        one[0][0], one[1][0], one[2][0] = u, 0.0 if y is None else y, y is not None
        if len(self._trace) != 1:
            self._trace = np.empty((1, 3))
        self._take(*one, self._trace)
        return one[3][0].copy()

    def run(self, u: ArrayLike, y: ArrayLike, valid: ArrayLike | None = None) -> Array:
        """
        Process N samples, starting from the current state, and return the estimates θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
            Motor torque and measured output.
        valid : (N,) array_like of bool, optional
            Mask that is False where y is missing; by default, y is valid in all samples.
        """
        u, y, present = check_signals(u, y, valid)
        estimates = np.empty((len(u), len(self.names)))
        trace = np.empty((len(u), 3))
        self._take(u, y, present, estimates, trace)
        if len(u):
            self._trace = trace
        return estimates


class CompiledFilter(RecursiveEstimator):
    """
    An estimator implemented as a compiled loop that works on one block of memory.

    Parameters
    ----------
    loop : callable
        Function ``loop(block, at, u, y, valid, estimates, trace, laws)`` that processes samples.
        After each sample, the function ``loop`` writes the relative parameters η to ``estimates``
        (N, p). The columns of ``trace`` (N, 3) receive ŷ, the innovation and the innovation
        variance. The argument ``laws`` is None for a linear model. The function ``loop`` returns
        the number of processed samples. If the function ``loop`` returns a negative number, the
        filter is reset (`flexaxis.estimators.filters.fault_monitor`).
    start : Memory
        State of the filter before the first sample.
    design : Design
        Filter options, including parameter names, output signal, scale and bounds.
    read : callable
        Function ``read(state)`` that returns the relative parameters η and their claimed
        covariance.

    Attributes
    ----------
    state : Memory
        Current state of the filter.
    """

    def __init__(
        self,
        loop: Callable[..., int],
        start: Memory,
        design: Design,
        read: Callable[[Memory], tuple[Array, Array]],
    ) -> None:
        super().__init__(design.model.names, design.output)
        self._loop = loop
        self._laws = LAWS if design.model.forces else None
        self._design, self._begin, self._read = design, start, read
        self.reset()
        self.run([], [])  # compiles the loop now instead of in the first step

    def _start(self) -> None:
        self.state = self._begin.copy()

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._all()[0]

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._all()[1]

    def _all(self) -> tuple[Array, Array]:
        eta, covariance = self._read(self.state)
        scale = self._design.scale
        return eta * scale, covariance * np.outer(scale, scale)

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        state, done, running = self.state, 0, True
        if self._design.differences:
            y, valid, self._reading = increments(y, valid, self._reading, self._design.period)
        while running:
            rest = slice(done, None)
            given = u[rest], y[rest], valid[rest], estimates[rest], trace[rest]
            taken = self._loop(state.block, state.at, *given, self._laws)
            done += abs(taken)
            if taken < 0:
                begin_anew(state, self._begin)
            running = done < len(u)
        estimates *= self._design.scale
