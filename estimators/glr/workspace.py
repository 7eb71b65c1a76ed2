"""The memory of a filter with a hypothesis bank, and operations on this memory between samples."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.glr.bank import NEVER
from flexaxis.estimators.glr.bank_arrays import Timing
from flexaxis.estimators.models.memory import Memory

Array = NDArray[np.float64]


@dataclass
class Workspace:
    """
    Memory and settings of the loop `flexaxis.estimators.glr.loop.glr`.

    Attributes
    ----------
    design : Design
        Design of the filter, in which the tracked parameters precede the parameters that are learnt
        only once.
    timing : Timing
        Durations in samples.
    tracked : int
        Number of tracked parameters, whose estimates are the output of the estimator.
    told : dict of int to float
        Nominal values towards which the estimates are shrunk
        (`flexaxis.estimators.filters.constrained`), in units of the parameter scale.
    fixable : dict of int to str
        Texts that give the reason for fixing a parameter if the data do not excite it, keyed by the
        index of the parameter in θ.
    shapes : sequence of (indices, indices)
        Indices in θ of dry friction torques, and of the parameters that have no effect without
        these torques.
    angle : int
        Index of the motor angle in the state vector, for a model whose state contains the motor
        angle.
    states : Memory
        Memory of the main filter, and of a second filter that processes old samples again.
    bank : Memory
        Memory of the hypothesis bank.
    begin : Memory
        Initial value of ``states`` before the first sample.
    """

    design: Design
    timing: Timing
    tracked: int
    told: Mapping[int, float]
    fixable: Mapping[int, str]
    shapes: Sequence[tuple[list[int], list[int]]]
    angle: int
    states: Memory
    bank: Memory
    begin: Memory

    def copy(self) -> "Workspace":
        """Return a copy of the workspace that shares no memory with the original."""
        memory = {name: getattr(self, name).copy() for name in ("states", "bank", "begin")}
        return replace(self, **memory)

    def __deepcopy__(self, memo: object) -> "Workspace":
        return self.copy()

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.design.scale)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all parameters."""
        return self.design.model.names

    @property
    def now(self) -> int:
        """Index of the last processed sample."""
        return int(self.bank["taken"]) - 1

    @property
    def busy(self) -> bool:
        """Whether the second filter is processing old samples."""
        return bool(self.bank["busy"])

    @property
    def caught_up(self) -> bool:
        """Whether the second filter has reached the end of its pass."""
        return self.busy and bool(self.bank["at"] >= self.bank["end"])

    def mean(self) -> tuple[Array, Array]:
        """Return the mean (p,) and covariance (p, p) of all parameters over all hypotheses."""
        bank, scale, p = self.bank, self.design.scale, self.p
        theta, P = self.states["theta"][0].copy(), self.states["P"][0, :p, :p].copy()
        if bank["taken"]:
            theta[:] = bank["mixed"]
            union = bank["union"]
            theta[union] = bank["drawn"]
            P[np.ix_(union, union)] = bank["drawn_P"] + bank["drawn_between"]
            P += self._between()
        return theta * scale, P * np.outer(scale, scale)

    def _between(self) -> Array:
        """Return the part of θ's covariance that is due to uncertain jumps and jump sizes."""
        bank = self.bank
        likely = np.flatnonzero(bank["weight"] > 1e-9)
        D, fields = bank["D"][: self.p, likely], ("weight", "size", "J", "precision")
        weight, size, J, precision = (bank[name][likely] for name in fields)
        spread = 1.0 / (J / bank["kappa"] + precision)
        moved = D @ (weight * size)
        return (D * (weight * (size**2 + spread))) @ D.T - np.outer(moved, moved)

    def go_through(self, xi: Array, P: Array, at: int, *, first: bool, end: int | None) -> None:
        """
        Start a pass in which the second filter processes old samples again.

        Parameters
        ----------
        xi, P : (m,), (m, w) arrays
            Initial estimate ξ of the pass, and the covariance of ξ.
        at : int
            Index of the first sample of the pass.
        first : bool
            Whether the estimate ``xi`` already includes the measurement of the first sample.
        end : int or None
            Index of the first sample after the pass, or None to include all samples that arrive
            during the pass.
        """
        bank, states, p = self.bank, self.states, self.p
        states.block[1] = states.block[0]
        n = len(xi) - p
        states["theta"][1], states["P"][1] = xi[:p], P
        states["X"][1, :n, 0], states["X"][1, :n, 1 : 1 + p + n] = xi[p:], np.eye(n, p + n, p)
        bank["one_J"] = bank["one_d"] = bank["chi2_one"] = bank["cost_one"] = 0.0
        bank["at"], bank["measured"], bank["busy"] = at, int(first), 1
        bank["end"] = bank["taken"] if end is None else end
        bank["end_follows"] = int(end is None)

    def move(self, direction: Array) -> None:
        """Add ``direction`` (m,) to the estimate ξ of the second filter, and update its output."""
        theta, X, p = self.states["theta"][1], self.states["X"][1], self.p
        theta[:] = np.clip(theta + direction[:p], self.design.lower, self.design.upper)
        X[:, 0] += X[:, 1 : 1 + len(direction)] @ direction

    def adopt(self) -> None:
        """Copy all estimates except the noise level from the second filter to the main filter."""
        for name in ("theta", "X", "P"):
            self.states[name][0] = self.states[name][1]
        self.empty()

    def empty(self) -> None:
        """Remove all hypotheses from the hypothesis bank, and stop the second filter."""
        bank = self.bank
        bank["onset"], bank["weight"], bank["busy"] = NEVER, 0.0, 0
        bank["end_follows"], bank["end"] = 0, bank["at"]


def take_up(plain: Workspace, rich: Workspace, wave: tuple[int, float, float]) -> None:
    """
    Initialise a filter with cogging from the current state of a filter without cogging.

    Parameters
    ----------
    plain : Workspace
        Memory of the filter without cogging, after the first pass over the initialisation data.
    rich : Workspace
        Memory of the filter with cogging before its first sample; the function overwrites this
        memory. The last three parameters of the filter with cogging are the sine coefficient, the
        cosine coefficient and the number of cogging waves. The state of the filter with cogging
        contains the motor angle. All other parameters and states are those of the filter without
        cogging.
    wave : (waves, sine, cosine)
        Cogging wave returned by `flexaxis.estimators.glr.cogging.strongest_wave`.
    """
    rich.bank["history"], rich.bank["now"] = plain.bank["history"], plain.bank["now"]
    rich.states["now"] = plain.states["now"]
    was, now, p = plain.states, rich.states, plain.p
    n, angle = was["gain"].shape[1] - p, plain.angle
    rows = np.arange(n) + (np.arange(n) >= angle)
    whole = np.r_[np.arange(p), rich.p + rows]
    now["P"][0][np.ix_(whole, whole)] = was["P"][0, :, : p + n]
    cogging = np.array([*wave[1:], wave[0]]) / rich.design.scale[p:]
    now["theta"][0] = np.r_[was["theta"][0], cogging]
    now["theta"][1, -1] = rich.begin["theta"][:, -1] = cogging[-1]
    now["X"][0, rows, 0], now["X"][0, -1, 0] = was["X"][0, :n, 0], was["X"][0, -1, 0]
    now["X"][0, angle, 0] = plain.bank["angle"]
    rich.bank["mixed"] = now["theta"][0]
