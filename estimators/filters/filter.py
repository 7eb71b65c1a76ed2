"""The base classes of all recursive estimators, with step, run, reset, copy and innovations."""

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
    Base class of the estimators; subclasses process checked samples in `_take`.

    Parameters
    ----------
    names : tuple of str
        Names of the p identified parameters.
    output : {"speed", "increment", "angle"}
        Name of the signal y.

    Attributes
    ----------
    names, output
        The constructor's parameters.
    theta : (p,) array
        Current estimate.
    covariance : (p, p) array
        Claimed covariance of the estimate.
    prediction : float
        Prediction ŷ[k] of the latest output from all earlier samples.
    innovation : float
        Innovation y[k] − ŷ[k]; NaN in a gap and before the first sample.
    innovation_variance : float
        Claimed variance of the innovation; NaN if the estimator claims none.
    innovations : (N, 2) array
        Innovation and claimed variance for each sample of the last ``step`` or ``run``.

    Notes
    -----
    θ[k] uses y[0..k] and u[0..k−1]; u[k] is held on [t_k, t_{k+1}) and first acts on y[k+1].
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
        """Process N samples; write θ (N, p) and a trace (N, 3): ŷ, the innovation, its variance."""

    @abstractmethod
    def _start(self) -> None:
        """Return to the state before the first sample."""

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
        """Return an independent estimator in the same state."""
        return deepcopy(self)

    def step(self, u: float, y: float | None) -> Array:
        """
        Process one sample and return θ[k] (p,).

        Parameters
        ----------
        u : float
            Torque that is held constant from t_k on.
        y : float or None
            Output measured at t_k; None if the output is missing.
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
        Process N samples, starting from the current state, and return θ (N, p).

        Parameters
        ----------
        u, y : (N,) array_like
            Torque and measured output.
        valid : (N,) array_like of bool, optional
            False where y is missing; True everywhere by default.
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
    An estimator that consists of a compiled loop and a block of memory.

    Parameters
    ----------
    loop : callable
        Function ``loop(block, at, u, y, valid, estimates, trace, laws)`` that processes samples. It
        writes η to ``estimates`` (N, p), and ŷ, the innovation and its variance to ``trace``
        (N, 3). ``laws`` is None for a linear model. The function returns the number of processed
        samples; a negative number means that the filter has to be reset, see
        `flexaxis.estimators.filters.fault_monitor`.
    start : Memory
        State of the filter before the first sample.
    design : Design
        Options of the filter, including names, output, scale and box.
    read : callable
        Function ``read(state)`` that returns η and the claimed covariance of η.

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
