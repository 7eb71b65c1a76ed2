"""An alarm that is being looked into: what was known before it, and what has come of it so far."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.relocate.colour import repetition
from flexaxis.estimators.relocate.explain import Ranking
from flexaxis.estimators.relocate.memory import Memory
from flexaxis.estimators.relocate.past import Normal
from flexaxis.estimators.relocate.policy import TAKEN_BACK, dubious
from flexaxis.estimators.relocate.rows import Stretch

LOOK_BACK = 1.0  # s before an alarm in which its first sign may lie
AHEAD = 0.3  # s before the first sign in which the change is looked for


@dataclass(frozen=True)
class Opened:
    """
    An alarm that is being looked into.

    Attributes
    ----------
    alarm : int
        Sample.
    before : Stretch
        What was known at each sample at which the change may have happened; no rewind alters it.
    normal : Normal
        What the residual was like before the first sign.
    repeated, dubious : float
        As of `flexaxis.estimators.relocate.policy.Case`.
    onset : int
        Time of the hypothesis in use; before one is, that of the first sign.
    ranking : Ranking or None
        Of the last look.
    accepted : int or None
        Hypothesis in use; `TAKEN_BACK` after one was.
    again : bool
        Whether the change is looked for after the alarm, as nothing before explains it.
    looked : int
        Samples after the alarm of the last look; −1 before the first.
    """

    alarm: int
    before: Stretch
    normal: Normal
    repeated: float
    dubious: float
    onset: int
    ranking: Ranking | None = None
    accepted: int | None = None
    again: bool = False
    looked: int = -1

    @property
    def active(self) -> NDArray[np.int64]:
        """Parameters that changed, by the hypothesis in use."""
        if self.ranking is None or self.accepted in {None, TAKEN_BACK}:
            return np.arange(0)
        return self.ranking.explanations[self.accepted].active  # type: ignore[index]


def opened(memory: Memory, period: float) -> Opened:
    """Return the case of an alarm at the last sample; what is normal is no more learnt."""
    alarm = memory.count - 1
    silent = int(memory.state["silent"][np.argmax(memory.state["evidence"])])
    sign = min(max(silent, alarm - round(LOOK_BACK / period), memory.first), alarm)
    before = memory.stretch(max(sign - round(AHEAD / period), 0))
    row = before.at(sign)
    memory.unlearn(row)
    return Opened(
        alarm,
        Stretch(before.first, before.rows[:-1]),
        Normal(float(row["noise"]), row["colour"].copy()),
        repetition.function(float(row["correlation"])),
        dubious(row["colour"], float(row["correlations"][1])),
        onset=sign,
    )


def reopened(case: Opened, memory: Memory) -> Opened:
    """Return a case that nothing explained, with the change between its alarm and now."""
    since = memory.stretch(case.alarm)
    return Opened(
        memory.count - 1,
        Stretch(since.first, since.rows[:-1]),
        case.normal,
        case.repeated,
        case.dubious,
        onset=case.alarm,
        again=True,
    )
