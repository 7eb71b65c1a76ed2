"""When a change is believed, taken back, or given up: thresholds in nats and seconds. Pure."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.explain import Ranking

Array = NDArray[np.float64]


class Wait(NamedTuple):
    """Look again later."""


class Retract(NamedTuple):
    """Take back what was accepted: later data do not bear it out."""


class Accept(NamedTuple):
    """Take up the best hypothesis."""


class GiveUp(NamedTuple):
    """No hypothesis explains the residual: take it for the noise of today, and say so."""


TAKEN_BACK = -1

LOOKS = (
    0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.16, 0.2, 0.25, 0.32,
    0.4, 0.5,
)  # fmt: skip
LATER = 0.7, 1.0  # s, at which f_m and f_c can be told apart

Decision = Wait | Retract | Accept | GiveUp


@dataclass(frozen=True)
class Case:
    """
    What is known of an alarm when it is looked into.

    Attributes
    ----------
    age : int
        Samples since the alarm.
    samples : int
        That the hypotheses had to explain.
    likelihood : float
        Logarithm of the likelihood of the filter as it is [nats].
    repeated : float
        How many of its whitened residuals told as much as a single one, before the alarm.
    dubious : float
        Share of the residual before the alarm that the model left for good.
    accepted : int or None
        Hypothesis that is in use; `TAKEN_BACK` after one was.
    """

    age: int
    samples: int
    likelihood: float
    repeated: float
    dubious: float
    accepted: int | None = None


@dataclass(frozen=True)
class Policy:
    """
    The thresholds.

    Attributes
    ----------
    period : float
        Sampling period [s].
    gain : float
        Evidence that a change needs [nats].
    margin : float
        By how much the best single parameter must lead the next [nats] …
    undecided : float
        … unless so long after the alarm has not decided between them [s].
    doubt : float
        By how much more evidence is asked for where all of the residual is dubious.
    patience : float
        How long to wait there [s], as a force that no parameter explains soon turns round.
    excess : float
        Mean square of the whitened residual, one before the alarm, that is "not explained".
    recent : float
        Time over which the residual is judged in the end [s].
    settled : float
        How long after an alarm what was accepted may still be taken back [s].
    adapting : bool
        Whether the filter goes on to learn more than what is tracked. Then what it leaves of the
        residual after a change speaks for that as well: a fit of the change alone knows less.
    looks : tuple of float
        Times after an alarm at which it is looked into [s].
    """

    period: float
    gain: float = 14.0
    margin: float = 4.5
    undecided: float = 0.12
    doubt: float = 4.0
    patience: float = 0.3
    excess: float = 1.5
    recent: float = 0.3
    settled: float = 0.5
    adapting: bool = False
    looks: tuple[float, ...] = LOOKS

    @property
    def ages(self) -> list[int]:
        """Samples after an alarm at which it is looked into."""
        return sorted({round(after / self.period) for after in self.looks})

    def due(self, looked: int, age: int) -> bool:
        """Return whether it is time for a look, so many samples after the alarm and the last."""
        return any(looked < due <= age for due in self.ages)

    def ends(self, age: int, accepted: int | None) -> bool:
        """Return whether this look is the last; later ones only tell apart what was accepted."""
        late = self.adapting and age >= round(self.settled / self.period) and accepted is None
        return late or age >= self.ages[-1]

    def decide(self, ranking: Ranking, case: Case) -> Decision:
        """
        Decide what to make of the hypotheses.

        Nearly equal hypotheses wait for each other, as a wrong one costs more than a few samples.
        A dubious residual, which the model does not explain to begin with, asks for more.
        """
        if not self._borne_out(ranking, case):
            late = case.age * self.period > self.settled
            return Wait() if late or case.accepted in {None, TAKEN_BACK} else Retract()
        if case.accepted == ranking.best:
            return Accept()
        decided = ranking.lead > self.margin * case.repeated
        if case.accepted is not None:
            return Accept() if decided else Wait()
        needed = self.gain * case.repeated * (1 + self.doubt * case.dubious)
        age = case.age * self.period
        convinced = (
            (decided or age > self.undecided)
            and age >= self.patience * case.dubious - self.period
            and ranking.odds - case.likelihood > needed
        )
        return Accept() if convinced else Wait()

    def conclude(self, white: Array, repeated: float) -> Wait | GiveUp:
        """
        Decide, in the end, whether the residual is back at its level before the alarm.

        Parameters
        ----------
        white : (N,) array
            Whitened residual of the filter, of variance one before the alarm.
        repeated : float
            As of a `Case`.
        """
        recent = white[-round(self.recent / self.period) :]
        limit = self.excess + 4 * np.sqrt(2 * repeated / len(recent))
        return GiveUp() if float(np.mean(recent**2)) > limit else Wait()

    def _borne_out(self, ranking: Ranking, case: Case) -> bool:
        """Whether the residual is back at its level before the alarm, as far as one can tell."""
        samples = max(case.samples - ranking.change.onset, 1)
        limit = self.excess + 6 * np.sqrt(2 * case.repeated / samples)
        unexplained = ranking.change.unexplained
        if self.adapting and case.accepted not in {None, TAKEN_BACK}:
            unexplained = min(unexplained, -2 * case.likelihood / case.samples)
        return bool(unexplained <= limit)


def dubious(colour: Array, correlation: float) -> float:
    """
    Return the share of the residual that the model leaves for good, from its colour.

    What could be foretold of it is no noise, unless neighbours differ in sign: the differences
    that the rounding of an encoder leaves can be foretold too, and no force makes them.

    Parameters
    ----------
    colour : (ORDER+1,) array
        As from `flexaxis.estimators.relocate.colour.write_colour`.
    correlation : float
        Of the residual with the next.
    """
    return 1.0 - float(colour[-1]) if correlation > 0 else 0.0
