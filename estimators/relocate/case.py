"""An alarm of `relocate` that is being looked into: what is known of it, and what to make of it."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.memory import LENGTH
from flexaxis.estimators.relocate.refit import Change

Array = NDArray[np.float64]
State = Any  # record of `flexaxis.estimators.relocate.memory.watched_state_type`

LOOK_BACK = 200  # samples before an alarm in which the change may lie
EXCESS = 1.5  # mean square of the whitened residual, one before the alarm, that is "not explained"
RECENT = 60  # samples by which the residual is judged in the end
MARGIN = 4.5  # nats by which the best single parameter must lead the next …
UNDECIDED = 24  # … unless so many samples after the alarm have not decided between them
DOUBT = 4.0  # by how much more evidence is asked for where all of the residual is coloured
PATIENCE = 60.0  # samples to wait there, as a force that no parameter explains soon turns round


@dataclass(frozen=True)
class Finding:
    """
    A change that was found.

    Attributes
    ----------
    alarm : int
        Sample at which it was found.
    onset : int
        Sample after which the parameters were different.
    parameters : tuple of str
        What changed; empty for an unmodelled change, which no hypothesis explains.
    ratio : tuple of float
        New value over the value before, for each.
    """

    alarm: int
    onset: int
    parameters: tuple[str, ...]
    ratio: tuple[float, ...]


class Comparison(NamedTuple):
    """
    What came of a comparison of the hypotheses.

    Attributes
    ----------
    active : (q,) int array
        Parameters that changed, by the best of them.
    change : Change
        What it says.
    odds : float
        Its evidence less its cost [nats].
    lead : float
        By how much that is more than those of any other single parameter.
    """

    active: NDArray[np.int64]
    change: Change
    odds: float
    lead: float


@dataclass
class Case:
    """An alarm that is being looked into."""

    alarm: int
    onset: int
    sign: int  # last sample without any sign of it
    variance: float  # of the residual, before
    colour: Array  # of the residual, before; as from `history.write_colour`
    repeated: float  # whitened residuals that tell as much as a single one, before
    first: int = 0  # sample from which a change may date
    likelihood: Array = field(default_factory=lambda: np.empty(0))  # of the main filter, from there
    white: Array = field(default_factory=lambda: np.empty(0))  # its residual, of unit variance
    leader: int = -1  # hypothesis with the most evidence
    odds: Array | None = None  # of all hypotheses, at the last look
    active: NDArray[np.int64] | None = None  # accepted hypothesis
    before: Array | None = None  # all parameters, before the change
    explained: dict[int, tuple[int, Array]] = field(default_factory=dict)  # onset and θ by choice

    @property
    def coloured(self) -> float:
        """Share of the residual that could be foretold before the alarm; zero if it was noise."""
        return 1.0 - float(self.colour[-1])

    def borne_out(self, found: Comparison, past_samples: int) -> bool:
        """Whether the residual is back at its level before the alarm, as far as one can tell."""
        samples = max(past_samples - found.change.onset, 1)
        return found.change.unexplained <= EXCESS + 6 * np.sqrt(2 * self.repeated / samples)

    def convinced(self, found: Comparison, age: int, gain: float) -> bool:
        """
        Whether to take up the best hypothesis, ``age`` samples after the alarm.

        Nearly equal hypotheses wait for each other, as a wrong one costs more than a few samples.
        A coloured residual, which the model does not explain to begin with, asks for more.
        """
        if self.active is not None and np.array_equal(self.active, found.active):
            return True
        decided = found.lead > MARGIN * self.repeated
        if self.active is not None:
            return decided
        needed = gain * self.repeated * (1 + DOUBT * self.coloured)
        return (
            (decided or age > UNDECIDED)
            and age >= PATIENCE * self.coloured - 1
            and found.odds - self.likelihood[-1] > needed
        )

    def unsettled(self) -> bool:
        """Whether the residual of the main filter is still larger than before the alarm."""
        recent = self.white[-RECENT:]
        limit = EXCESS + 4 * np.sqrt(2 * self.repeated / len(recent))
        return float(np.mean(recent**2)) > limit


def open_case(state: State) -> Case:
    """Return the case of an alarm that has just gone off, and stop learning what is normal."""
    alarm = int(state["count"]) - 1
    sign = max(int(state["quiet"][np.argmax(state["evidence"])]), alarm - LOOK_BACK, 0)
    j = sign % LENGTH
    state["armed"] = state["learning"] = 0
    state["correlations"] = state["past_correlations"][j]
    state["colour"] = colour = state["past_colour"][j].copy()
    noise, repeated = float(state["past_noise"][j]), float(state["past_repeated"][j])
    return Case(alarm, sign, sign, noise, colour, repeated)
