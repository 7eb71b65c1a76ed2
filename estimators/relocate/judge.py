"""
What a filter does besides filtering: alarms looked into, findings, and the past given anew.

All of it is work that says before each of its pieces what that takes, so that it can be spread.
"""

from copy import copy, deepcopy
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.relocate.finding import LOST, OVERTAKEN, UNEXPLAINED, Finding
from flexaxis.estimators.relocate.fit import Past
from flexaxis.estimators.relocate.lost import Found
from flexaxis.estimators.relocate.naming import named
from flexaxis.estimators.relocate.opened import Opened, opened, reopened
from flexaxis.estimators.relocate.parts import Parts
from flexaxis.estimators.relocate.past import past_of, residual
from flexaxis.estimators.relocate.policy import (
    TAKEN_BACK,
    Accept,
    Case,
    Decision,
    GiveUp,
    Retract,
)
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.relocate.work import PAST, Work

Array = NDArray[np.float64]

SETTLED = 2.0  # s after which a change of an unidentified parameter is taken as known


class Judge:
    """
    A filter with a memory, and all that is made of it.

    Parameters
    ----------
    parts : Parts
    design : Design
        With all parameters.
    roles : Roles
    grain : float
        Operations of a piece of the work.

    Attributes
    ----------
    memory, hypotheses, rewind, commission, lookout, policy
        The parts.
    case : Opened or None
        The alarm that is being looked into.
    found : list of Finding
    tracked : int
        Parameters that are estimated all the time.
    free : dict of int to int
        Unidentified parameters that are estimated, and the count at which to freeze each.
    """

    _shared = "hypotheses", "rewind", "policy", "_design", "_roles"

    def __init__(self, parts: Parts, design: Design, roles: Roles, *, grain: float) -> None:
        self.memory, self.hypotheses, self.rewind = parts[:3]
        self.commission, self.lookout, self.policy = parts[3:6]
        self._design, self._roles, self._grain = design, roles, grain
        self.tracked = roles.tracked
        self.reset()

    def reset(self) -> None:
        """Return to the start."""
        self.memory.reset()
        self.lookout.reset()
        self.commission.reset()
        self.case: Opened | None = None
        self.found: list[Finding] = []
        self.free: dict[int, int] = {}
        self.memory.state["stop"] = self._next_stop(present=True)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        other = copy(self)
        for name, value in vars(self).items():
            if name not in self._shared:
                setattr(other, name, deepcopy(value, memo))
        return other

    def warm_up(self) -> Work[None]:
        """Let everything compile that is needed at an alarm: take up what is nothing."""
        memory = self.memory
        case = opened(memory, self._design.period)
        past = past_of(case.before, memory, case.normal)
        variance, grain = case.normal.variance, self._grain
        ranking = yield from self.hypotheses.ranking(past, variance, None, grain=grain)
        yield from self._apply(replace(case, ranking=ranking), past, Accept())
        if grain < np.inf:
            yield from self.lookout.warm_up(memory)
            yield from self.commission.warm_up(memory)

    def attend(self, *, present: bool, behind: bool = False) -> Work[None]:
        """
        Do what is due after a sample.

        Parameters
        ----------
        present : bool
            Whether that is the last sample that there is; looks into an alarm wait for it, but for
            the last, which is taken when its time comes.
        behind : bool
            Whether there are so many more that this is left out too.
        """
        memory = self.memory
        lost = yield from self.commission.recover(memory)
        begun = yield from self.commission.attend(memory)
        if lost:
            self._find(memory.first, LOST)
        if lost or begun:
            self.case = None
            memory.arm()
        if self.commission.goes_on(memory.count):  # what is new then is what is being learnt
            memory.state["armed"] = 0
        if memory.state["armed"] and memory.ringing:
            yield PAST
            self.case = opened(memory, self._design.period)
        if self.case is not None and self._due(self.case, present=present):
            yield from self._close(self.case, looked=False) if behind else self._look(self.case)
        expected = self.commission.expected(len(self._design.scale))
        found = None
        if present or not self.lookout.searching:
            found = yield from self.lookout.look(memory, expected)
        if found is not None:
            yield from self._settle(found, expected)
        self._freeze()
        memory.state["stop"] = self._next_stop(present=present)

    def _due(self, case: Opened, *, present: bool) -> bool:
        age = self.memory.count - 1 - case.alarm
        return self.policy.due(case.looked, age) and (present or age >= self.policy.ages[-1])

    def _next_stop(self, *, present: bool) -> int:
        """Return the count at which something is due next."""
        count = self.memory.count
        due = [*self.free.values(), *self.commission.due(count)]
        if present or not self.lookout.searching:
            due.append(self.lookout.due(count))
        if self.case is not None:
            ages = self.policy.ages if present else self.policy.ages[-1:]
            due += [self.case.alarm + 1 + age for age in ages]
        return min((when for when in due if when > count), default=-1)

    def _look(self, case: Opened) -> Work[None]:
        """Rank the hypotheses on the data so far, and do what the policy decides."""
        memory = self.memory
        yield PAST
        age = memory.count - 1 - case.alarm
        past = past_of(case.before, memory, case.normal)
        variance, grain = case.normal.variance, self._grain
        ranking = yield from self.hypotheses.ranking(past, variance, case.ranking, grain=grain)
        yield PAST
        odds = residual(memory, case.before.first, case.normal)[1]
        view = Case(age, len(past.u), odds, case.repeated, case.dubious, case.accepted)
        decision = self.policy.decide(ranking, view)
        case = replace(case, ranking=ranking, looked=age)
        self.case = case = yield from self._apply(case, past, decision)
        if self.policy.ends(age, case.accepted):
            yield from self._close(case)

    def _apply(self, case: Opened, past: Past, decision: Decision) -> Work[Opened]:
        """Do what was decided on a look."""
        ranking, before = case.ranking, case.before
        assert ranking is not None  # there was a look
        if isinstance(decision, Accept):
            if case.accepted is None:
                self._find(case.onset, "")
            onset = before.first + ranking.change.onset
            case, theta = replace(case, accepted=ranking.best, onset=onset), ranking.change.theta
        elif isinstance(decision, Retract):
            case, theta = replace(case, accepted=TAKEN_BACK), before.at(case.onset)["theta"]
        else:
            return case
        yield from self.rewind.to_change(self.memory, case, past, theta, self.free)
        self._name(case)
        return case

    def _find(self, onset: int, reason: str) -> None:
        self.found.append(Finding(self.memory.count - 1, onset, (), (), reason))

    def _name(self, case: Opened) -> None:
        """Write down what changed, as it is seen now."""
        names = self._design.model.names
        self.found[-1] = named(self.found[-1], case, self.memory.state, names)

    def _close(self, case: Opened, *, looked: bool = True) -> Work[None]:
        """
        End a case; where the residual stays large, say so and take it as the new noise.

        Parameters
        ----------
        case : Opened
        looked : bool
            Whether there was time for its last look.
        """
        yield PAST
        white, _ = residual(self.memory, case.before.first, case.normal)
        if isinstance(self.policy.conclude(white, case.repeated), GiveUp):
            once = looked and not case.again
            if self.policy.adapting and case.accepted is None and once:
                self.case = reopened(case, self.memory)
                yield from self._look(self.case)
                return
            self.memory.accept(self.policy.recent, noise=not self._design.noise)
            if case.accepted is None:
                self._find(case.onset, UNEXPLAINED if looked else OVERTAKEN)
        if case.accepted is not None:
            self._name(case)
            settled = self.memory.count + round(SETTLED / self._design.period)
            self.free |= {int(i): settled for i in case.active if i >= self._roles.known}
        self.case = None
        self.memory.arm()

    def _settle(self, found: Found, expected: Array) -> Work[None]:
        """Take up what a search has found, or say that there is nothing to be found."""
        if found.better is None:
            self._find(found.first, LOST)
            return
        yield from self.rewind.to_start(self.memory, found.first, found.better, expected)
        self.case = None
        self.memory.arm()

    def _freeze(self) -> None:
        """Fix unidentified parameters at what they have been found to be."""
        count = self.memory.count
        for i in [i for i, when in self.free.items() if when <= count]:
            del self.free[i]
            self.memory.freeze(i)
