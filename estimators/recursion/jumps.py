"""Telling of jumps: an alarm once a change is significant, named again a second later."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.finding import UNEXPLAINED, Finding
from flexaxis.estimators.recursion.changes import Z95, single_change
from flexaxis.estimators.recursion.modal import NEVER
from flexaxis.estimators.recursion.records import Record

Array = NDArray[np.float64]

LATER = 1.0  # s after an alarm, when what changed is named again: what reference and axis remember
BEFORE = 0.05  # s before an onset, as of when θ is as it was: ten samples of 5 ms
BEGUN = 0.05  # probability of a jump from which on it may have begun, a tenth of that of an alarm
SIGNIFICANT = (
    9.0  # χ² of one degree of freedom, 3 deviations, below which nothing explains an alarm
)
CERTAIN = 12.0  # χ² that an alarm needs: 3.5 deviations, one in two thousand
STORM = 60.0  # s, within which every alarm doubles what the next one needs
AGES = (
    0.01,
    0.02,
    0.02,
    0.05,
    0.1,
    0.1,
    0.2,
    0.2,
    0.3,
)  # s between looks at what may become significant


class Jumps:
    """
    What has been found, from a filter with the fields of `flexaxis.estimators.recursion.modal`.

    Parameters
    ----------
    names : sequence of str
        Of the parameters that jump.
    period : float
        Sampling period [s].

    Attributes
    ----------
    findings : list of Finding
    alarm : bool
        Whether something was found in the last look.
    """

    def __init__(self, names: Sequence[str], period: float) -> None:
        self._names, self._period = tuple(names), period
        self.findings: list[Finding] = []
        self.alarm = False
        self._onset: int | None = None  # of a jump that is not significant yet
        self._ages: list[float] = []

    def attend(self, state: Record) -> None:
        """
        Do what is due after a sample in which the filter asked for a look.

        Parameters
        ----------
        state : (1,) record
            ``due``, ``armed`` and ``calm`` are written.
        """
        now = int(state["samples_taken"][0]) - 1
        due = now == state["due"][0]
        if due:
            state["due"] = NEVER
        if due and self._onset is not None:
            self._look(state, now)
        elif due:
            self.findings[-1] = self._named(self.findings[-1], state, now)
        else:  # also after calm, while what came before has not become significant
            state["armed"], state["calm"] = 0, 0
            self._onset, self._ages = self._begun(state, now), list(AGES)
            self._look(state, now)

    def _look(self, state: Record, now: int) -> None:
        """Tell of a jump as soon as the change is significant."""
        assert self._onset is not None
        seen = self._named(Finding(now, self._onset, (), ()), state, now)
        if seen.parameters:
            self.alarm = True
            self.findings.append(seen)
            self._onset, later = None, LATER
        elif self._ages:
            later = self._ages.pop(0)
        else:
            self._onset, state["due"] = None, NEVER
            return
        state["due"] = now + max(1, round(later / self._period))

    def _begun(self, state: Record, now: int) -> int:
        """Return the last sample at which a jump was not likely."""
        likely = state["ring"][0, :, -1]
        first = now
        while now - first < min(len(likely), now) - 1 and likely[(first - 1) % len(likely)] > BEGUN:
            first -= 1
        return max(first - 1, 0)

    def _named(self, finding: Finding, state: Record, now: int) -> Finding:
        """Return a finding with what changed, as it is seen now."""
        ring, q = state["ring"][0], len(self._names)
        past = max(finding.onset - round(BEFORE / self._period), now - len(ring) + 1, 0)
        before, after = ring[past % len(ring)], ring[now % len(ring)]
        covariance = (before + after)[q : q + q * q].reshape(q, q)
        change = single_change(after[:q] - before[:q], covariance)
        was = before[change.index]
        if not change.gain >= self._needed(finding, now) or was == 0.0:
            return replace(finding, parameters=(), ratio=(), interval=(), reason=UNEXPLAINED)
        ratio, half = 1 + change.size / was, Z95 * change.deviation / abs(was)
        return replace(
            finding,
            parameters=(self._names[change.index],),
            ratio=(float(ratio),),
            interval=((float(ratio - half), float(ratio + half)),),
            reason="",
        )

    def _needed(self, finding: Finding, now: int) -> float:
        """Return the significance that a name needs; of an alarm more, after others more still."""
        if finding.parameters:
            return SIGNIFICANT
        recent = sum(now - f.alarm < STORM / self._period for f in self.findings)
        return CERTAIN * 2.0**recent
