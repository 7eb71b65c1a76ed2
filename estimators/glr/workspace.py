"""The records of a filter with a bank, what is done to them between samples, and their start."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.design import Design
from flexaxis.estimators.filters.loop import Record
from flexaxis.estimators.glr.records import NEVER, Jumps, Timing
from flexaxis.estimators.models.compiler import Compiled
from flexaxis.estimators.models.laws import LAWS

Array = NDArray[np.float64]


@dataclass
class Workspace:
    """
    What `flexaxis.estimators.glr.loop.glr_loop` works on.

    Attributes
    ----------
    design : Design
    jumps : Jumps
    timing : Timing
    tuning, states, bank : Record
        As from `flexaxis.estimators.glr.records.glr_records`.
    begin : (2,) Record
        The states before the first sample.
    angle : int
        Which state is the angle of the motor, or would be.
    """

    design: Design
    jumps: Jumps
    timing: Timing
    tuning: Record
    states: Record
    bank: Record
    begin: Record
    angle: int = 0

    @property
    def p(self) -> int:
        """Number of parameters."""
        return len(self.design.scale)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all parameters."""
        return self.design.model.names

    @property
    def now(self) -> int:
        """The last sample that was taken."""
        return int(self.bank["taken"][0]) - 1

    @property
    def busy(self) -> bool:
        """Whether samples are gone through again."""
        return bool(self.bank["busy"][0])

    @property
    def caught_up(self) -> bool:
        """Whether those that are gone through again are."""
        return self.busy and bool(self.bank["at"][0] >= self.bank["end"][0])

    def go_through(self, xi: Array, P: Array, at: int, *, first: bool, follow: bool) -> None:
        """
        Let the second record go through samples again.

        Parameters
        ----------
        xi, P : (m,), (m, w) arrays
            Where it starts.
        at : int
            The first of the samples.
        first : bool
            Whether ``xi`` has been through the measurement of that sample already.
        follow : bool
            Whether it goes on with samples that come meanwhile.
        """
        bank, state, p = self.bank[0], self.states[1], self.p
        self.states[1] = self.states[0].copy()
        state["theta"][:p], state["X"][: len(xi) - p, 0], state["P"] = xi[:p], xi[p:], P
        n = len(xi) - p
        state["X"][:n, 1 : 1 + p + n] = np.eye(n, p + n, p)
        for name in ("J_one", "d_one", "chi2_one", "cost_one"):
            bank[name] = 0.0
        bank["at"], bank["end"], bank["first"] = at, bank["taken"], int(first)
        bank["end_follows"], bank["busy"] = int(follow), 1

    def move(self, direction: Array) -> None:
        """Move ξ of the second record (m,) as it was at the last sample, and what it predicts."""
        state, p = self.states[1], self.p
        lower, upper = self.design.lower, self.design.upper
        state["theta"][:p] = np.clip(state["theta"][:p] + direction[:p], lower, upper)
        state["X"][:, 0] += state["X"][:, 1 : 1 + len(direction)] @ direction

    def adopt(self) -> None:
        """Let the second record take the place of the first, but for what is known of the noise."""
        for name in ("theta", "X", "P", "M"):
            self.states[name][0] = self.states[name][1]
        self.empty()

    def empty(self) -> None:
        """Forget all hypotheses, and what is being gone through again."""
        bank = self.bank[0]
        bank["onset"], bank["weight"], bank["evidence"] = NEVER, 0.0, -np.inf
        bank["none"], bank["busy"], bank["odds"] = 1.0, 0, -np.inf
        bank["end_follows"], bank["end"] = 0, bank["at"]


class Kit(NamedTuple):
    """
    What a filter is made of, and no sample changes.

    Attributes
    ----------
    design : Design
    jumps : Jumps
    timing : Timing
    told : dict of int to float
        Values by parameter, in units of the scale.
    fixable : dict of str to str
    shapes : dict of tuple of int to tuple of int
        Levels of dry friction, and what shapes it.
    records : tuple of Record
        As from `flexaxis.estimators.glr.records.glr_records`.
    loop : Compiled
    angle : int
        Which state is the angle of the motor, or would be.
    """

    design: Design
    jumps: Jumps
    timing: Timing
    told: dict[int, float]
    fixable: dict[str, str]
    shapes: dict[tuple[int, ...], tuple[int, ...]]
    records: tuple[Record, Record, Record]
    loop: Compiled
    angle: int

    def begin(self) -> Workspace:
        """Return a workspace as before the first sample."""
        tuning, states, bank = self.records
        records = tuning, states.copy(), bank.copy(), states
        return Workspace(self.design, self.jumps, self.timing, *records, self.angle)


POLES = list(LAWS["sinusoid"].roles).index("poles")


def take_up(plain: Workspace, rich: Workspace, wave: tuple[int, float, float]) -> None:
    """
    Let a filter with a law of cogging begin where another one is.

    Parameters
    ----------
    plain : Workspace
        After the first seconds.
    rich : Workspace
        As before the first sample. Its parameters are those of the other and, as the last two,
        sine and cosine of cogging, which is its last law; the angle of the motor is one more state.
    wave : (waves, sine, cosine)
    """
    rich.tuning["law_value"][0, -1, POLES] = wave[0]
    share(plain.bank, rich.bank)
    share(plain.states, rich.states)
    was, now, p = plain.states[0], rich.states[0], plain.p
    n, angle = len(was["gain"]) - p, rich.angle
    rows = np.arange(n) + (np.arange(n) >= angle)
    whole = np.r_[np.arange(p), rich.p + rows]
    now["P"][np.ix_(whole, whole)] = was["P"][:, : p + n]
    now["theta"][: rich.p] = np.r_[was["theta"][:p], wave[1:] / rich.design.scale[p:]]
    now["X"][rows, 0], now["X"][-1, 0] = was["X"][:n, 0], was["X"][-1, 0]
    now["X"][angle, 0] = plain.bank["angle"][0]
    rich.bank["mixed"][0] = now["theta"][: rich.p]


def share(source: Record, target: Record) -> None:
    """Copy what two records have in common: fields of the same shape."""
    for name in target.dtype.names or ():
        if name in (source.dtype.names or ()) and source[name].shape == target[name].shape:
            target[name] = source[name]
