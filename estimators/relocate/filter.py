"""
Detect, rewind, refit: a recursive filter that finds out what has changed, and when.

The main filter is the prediction-error method with forgetting, its state corrected. A CUSUM on
its whitened residual raises an alarm. Then hypotheses, "parameter i changed at sample k₀", with i
any physical parameter of the model, identified or not, are judged to first order, and the likely
ones fitted to the data since. The one with the most evidence wins, if it explains enough and leads
clearly. The filter goes back to k₀, takes the fitted value, and runs through the data again.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import above_zero, make_design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.relocate.explain import past_of, residual
from flexaxis.estimators.relocate.finding import LOST, UNEXPLAINED, Finding
from flexaxis.estimators.relocate.fit import Past
from flexaxis.estimators.relocate.lost import Found
from flexaxis.estimators.relocate.naming import named
from flexaxis.estimators.relocate.opened import Opened, opened, reopened
from flexaxis.estimators.relocate.parts import parts_of
from flexaxis.estimators.relocate.policy import (
    TAKEN_BACK,
    Accept,
    Case,
    Decision,
    GiveUp,
    Retract,
)
from flexaxis.estimators.relocate.suspects import widened

Array = NDArray[np.float64]

SETTLED = 2.0  # s after which a change of an unidentified parameter is taken as known


class Relocate(RecursiveEstimator):
    """
    Prediction-error method that rewinds and refits after an abrupt change.

    Parameters
    ----------
    model : Model
        Grey-box model, such as ``three_mass(nominal)``, with nonlinear laws or without.
    identify : sequence of str, optional
        Parameters to estimate, or their inverses; the model's own choice by default.
    suspects : sequence of str
        Parameters that are not estimated but may change; a change of one is found, named and
        put into the model.
    track, learn : sequence of str
        Parameters that are tracked besides, and that are learnt once and never forgotten, from a
        prior of `flexaxis.estimators.offline.structure`.
    told : sequence of str
        Parameters whose values were given; those of laws that were not get theirs from how the
        axis moves.
    theta0 : (p,) array_like, optional
        θ(0); the model's nominal values by default.
    P0 : (p,) or (p, p) array_like
        P(0), for a noise variance of one.
    period : float
        Sampling period T [s].
    noise : float, optional
        Standard deviation of y, in its unit; estimated from the residual by default.
    forgetting : float, optional
        λ of the main filter, for a sample; that of a time constant of 1 s by default.
    walk : float, optional
        Standard deviation by which a tracked parameter may have changed after a second, relative to
        θ(0), in the place of forgetting.
    alarm : float
        Evidence at which the residual is looked into [nats].
    gain : float
        Evidence that a change needs to be accepted [nats].
    bounds : (lower, upper), optional
        Box of θ; 0.1 to 10 times θ(0) by default.
    output : {"speed", "increment"}
        What y is.
    x0 : (n,) array_like, optional
        State at the first sample; at rest, zero, by default.

    Attributes
    ----------
    names, output, bounds
        As given.
    theta : (p,) array
        The estimate.
    covariance : (p, p) array
        Its claimed covariance R̂ Σ; of what has just changed, from that of the change.
    alarm : bool
        Whether something was found in the last sample.
    findings : tuple of Finding
        All that was found, the latest with its present value.
    fixed_because : dict of str to str
        What is as it was told, or taken as absent, and why.
    prediction, innovation, innovation_variance, innovations
        As of every `flexaxis.estimators.recursion.filter.RecursiveEstimator`.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    _shared = (
        *RecursiveEstimator._shared, "_design", "_roles", "_hypotheses", "_rewind", "_policy",
    )  # fmt: skip

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        suspects: Sequence[str] = (),
        track: Sequence[str] = (),
        learn: Sequence[str] = (),
        told: Sequence[str] = (),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float,
        noise: float | None = None,
        forgetting: float | None = None,
        walk: float | None = None,
        alarm: float = 10.0,
        gain: float = 14.0,
        bounds: tuple[ArrayLike, ArrayLike] | None = None,
        output: str = "speed",
        x0: ArrayLike | None = None,
    ) -> None:
        narrow = make_design(
            model,
            identify=identify,
            theta0=theta0,
            P0=P0,
            period=period,
            forgetting=forgetting if walk is None else 1.0,
            bounds=bounds,
            output=output,
            noise=noise,
            x0=x0,
        )
        above_zero("alarm", alarm, "evidence in nats, such as 10")
        above_zero("gain", gain, "evidence in nats, such as 14")
        self._design, self._roles = widened(
            narrow, model, track=track, learn=learn, told=told, suspects=suspects
        )
        self._p = p = self._roles.tracked
        lower, upper = self._design.bounds
        super().__init__(self._design.model.names[:p], output, (lower[:p], upper[:p]))
        (
            self._memory,
            self._hypotheses,
            self._rewind,
            self._commission,
            self._lookout,
            self._policy,
        ) = parts_of(
            self._design,
            self._roles,
            model=model,
            told=told,
            walk=0.0 if walk is None else above_zero("walk", walk, "a relative deviation in 1 s"),
            alarm=alarm,
            gain=gain,
        )
        self.reset()
        self._warm_up()

    def _warm_up(self) -> None:
        """Let everything compile now rather than at the first alarm: take up what is nothing."""
        self.run(np.zeros(3), np.zeros(3))
        case = opened(self._memory, self._design.period)
        past = past_of(case.before, self._memory, case.normal)
        ranking = self._hypotheses.rank(past, case.normal.variance, None)
        self._apply(replace(case, ranking=ranking), past, Accept())
        self.reset()

    def _start(self) -> None:
        self._memory.reset()
        self._lookout.reset()
        self._commission.reset()
        self._case: Opened | None = None
        self._found: list[Finding] = []
        self._free: dict[int, int] = {}  # unidentified parameter: count at which to freeze it
        self.alarm = False
        self._memory.state["stop"] = self._next_stop()

    @property
    def theta(self) -> Array:  # noqa: D102
        return (self._memory.state["theta"] * self._design.scale)[: self._p]

    @property
    def covariance(self) -> Array:  # noqa: D102
        state, scale = self._memory.state, self._design.scale[: self._p]
        return state["noise"] * state["claim"][: self._p, : self._p] * np.outer(scale, scale)

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return tuple(self._found)

    @property
    def fixed_because(self) -> dict[str, str]:
        """What is not learnt once as it might be, and why."""
        return dict(self._commission.fixed_because)

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done = 0
        while done < len(u):
            self.alarm = False
            rest = slice(done, None)
            done += self._memory.run(u[rest], y[rest], valid[rest], estimates[rest], trace[rest])
            self._attend()
            estimates[done - 1] = self._memory.state["theta"][: self._p]
        estimates *= self._design.scale[: self._p]

    def _attend(self) -> None:
        """Do what is due after a sample."""
        memory = self._memory
        with np.errstate(all="ignore"):  # a filter that diverges is a result
            lost, begun = self._commission.recover(memory), self._commission.attend(memory)
        if lost:
            self._find(memory.first, LOST)
        if lost or begun:
            self._case = None
            memory.arm()
        if self._commission.goes_on(memory.count):  # what is new then is what is being learnt
            memory.state["armed"] = 0
        if memory.state["armed"] and memory.ringing:
            self._case = opened(memory, self._design.period)
        if self._case is not None and memory.count - 1 - self._case.alarm in self._policy.ages:
            with np.errstate(all="ignore"):  # a filter that diverges is a result
                self._look(self._case)
        expected = self._commission.expected(len(self._design.scale))
        found = self._lookout.look(memory, expected)
        if found is not None:
            self._settle(found, expected)
        self._freeze()
        memory.state["stop"] = self._next_stop()

    def _next_stop(self) -> int:
        """Return the count at which something is due next."""
        count = self._memory.count
        due = [self._lookout.due(count), *self._free.values(), *self._commission.due(count)]
        if self._case is not None:
            due += [self._case.alarm + 1 + age for age in self._policy.ages]
        return min(when for when in due if when > count)

    def _look(self, case: Opened) -> None:
        """Rank the hypotheses on the data so far, and do what the policy decides."""
        memory = self._memory
        age = memory.count - 1 - case.alarm
        past = past_of(case.before, memory, case.normal)
        ranking = self._hypotheses.rank(past, case.normal.variance, case.ranking)
        odds = residual(memory, case.before.first, case.normal)[1]
        view = Case(age, len(past.u), odds, case.repeated, case.dubious, case.accepted)
        decision = self._policy.decide(ranking, view)
        self._case = case = self._apply(replace(case, ranking=ranking), past, decision)
        if self._policy.ends(age, case.accepted):
            self._close(case)

    def _apply(self, case: Opened, past: Past, decision: Decision) -> Opened:
        """Do what was decided on a look."""
        ranking = case.ranking
        assert ranking is not None  # there was a look
        if isinstance(decision, Accept):
            if case.accepted is None:
                self._find(case.onset, "")
            onset = case.before.first + ranking.change.onset
            case = replace(case, accepted=ranking.best, onset=onset)
            self._rewind.to_change(self._memory, case, past, ranking.change.theta, self._free)
            self._name(case)
        elif isinstance(decision, Retract):
            case = replace(case, accepted=TAKEN_BACK)
            theta = case.before.at(case.onset)["theta"]
            self._rewind.to_change(self._memory, case, past, theta, self._free)
            self._name(case)
        return case

    def _find(self, onset: int, reason: str) -> None:
        self.alarm = True
        self._found.append(Finding(self._memory.count - 1, onset, (), (), reason))

    def _name(self, case: Opened) -> None:
        """Write down what changed, as it is seen now."""
        names = self._design.model.names
        self._found[-1] = named(self._found[-1], case, self._memory.state, names)

    def _close(self, case: Opened) -> None:
        """End a case; where the residual stays large, say so and take it as the new noise."""
        white, _ = residual(self._memory, case.before.first, case.normal)
        if isinstance(self._policy.conclude(white, case.repeated), GiveUp):
            if self._policy.adapting and case.accepted is None and not case.again:
                self._case = reopened(case, self._memory)
                self._look(self._case)
                return
            self._memory.accept(self._policy.recent, noise=not self._design.noise)
            if case.accepted is None:
                self._find(case.onset, UNEXPLAINED)
        if case.accepted is not None:
            self._name(case)
            settled = self._memory.count + round(SETTLED / self._design.period)
            self._free |= {int(i): settled for i in case.active if i >= self._roles.known}
        self._case = None
        self._memory.arm()

    def _settle(self, found: Found, expected: Array) -> None:
        """Take up what a search has found, or say that there is nothing to be found."""
        if found.better is None:
            self._find(found.first, LOST)
            return
        self._rewind.to_start(self._memory, found.first, found.better, expected)
        self._case = None
        self._memory.arm()

    def _freeze(self) -> None:
        """Fix unidentified parameters at what they have been found to be."""
        count = self._memory.count
        for i in [i for i, when in self._free.items() if when <= count]:
            del self._free[i]
            self._memory.freeze(i)
