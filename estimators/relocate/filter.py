"""
Detect, rewind, refit: a recursive filter that finds out what has changed, and when.

The main filter is the prediction-error method with forgetting, its state corrected. A CUSUM on
its whitened residual raises an alarm. Then hypotheses, "parameter i changed at sample k₀", with i
any physical parameter of the model, identified or not, are judged to first order, and the likely
ones fitted to the data since. The one with the most evidence wins, if it explains enough and leads
clearly. The filter goes back to k₀, takes the fitted value, and runs through the data again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.methods.start import ROBUST
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.recursion.design import Design, above_zero, make_design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.recursion.measurement import measured
from flexaxis.estimators.recursion.records import joined, on_lanes
from flexaxis.estimators.relocate.colour import repetition
from flexaxis.estimators.relocate.explain import (
    SPREAD,
    Hypotheses,
    Normal,
    Ranking,
    past_of,
    residual,
)
from flexaxis.estimators.relocate.finding import LOST, UNEXPLAINED, Finding
from flexaxis.estimators.relocate.fit import Past
from flexaxis.estimators.relocate.memory import Memory, Stretch
from flexaxis.estimators.relocate.policy import (
    TAKEN_BACK,
    Accept,
    Case,
    Decision,
    GiveUp,
    Policy,
    Retract,
    dubious,
)
from flexaxis.estimators.relocate.replay import replay
from flexaxis.estimators.relocate.search import Search
from flexaxis.estimators.relocate.suspects import with_suspects
from flexaxis.estimators.sampling.pattern import split
from flexaxis.estimators.sampling.sampled import terms

Array = NDArray[np.float64]

LOOK_BACK = 1.0  # s before an alarm in which its first sign may lie
AHEAD = 0.3  # s before the first sign in which the change is looked for
CHECK = 4.0  # s between two looks at whether the filter is lost altogether
LOST = 0.1  # of the mean square of y left unexplained …
FORETOLD = 0.8  # … of which so much could be foretold, so that it is no noise
BETTER = 0.25  # of the mean square of the residual, that other parameters have to leave
UNKNOWN = 1.0  # s after which a wrong state has been forgotten
SETTLED = 2.0  # s after which a change of an unidentified parameter is taken as known


@dataclass(frozen=True)
class Opened:
    """
    An alarm that is being looked into.

    Attributes
    ----------
    alarm : int
        Sample.
    before : Stretch
        What was known up to it, from where the change may have happened.
    normal : Normal
        What the residual was like before the first sign.
    repeated, dubious : float
        As of `flexaxis.estimators.relocate.policy.Case`.
    ranking : Ranking or None
        Of the last look.
    accepted : int or None
        Hypothesis that is in use …
    onset : int
        … and its time; before one is, that of the first sign.
    """

    alarm: int
    before: Stretch
    normal: Normal
    repeated: float
    dubious: float
    onset: int
    ranking: Ranking | None = None
    accepted: int | None = None

    @property
    def active(self) -> NDArray[np.int64]:
        """Parameters that changed, by the hypothesis in use."""
        if self.ranking is None or self.accepted in {None, TAKEN_BACK}:
            return np.arange(0)
        return self.ranking.explanations[self.accepted].active


class Relocate(RecursiveEstimator):
    """
    Prediction-error method that rewinds and refits after an abrupt change.

    Parameters
    ----------
    model : Model
        Linear grey-box model, such as ``three_mass(nominal)``.
    identify : sequence of str, optional
        Parameters to estimate, or their inverses; the model's own choice by default.
    suspects : sequence of str
        Parameters that are not estimated but may change; a change of one is found, named and
        put into the model.
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
    prediction, innovation, innovation_variance, innovations
        As of every `flexaxis.estimators.recursion.filter.RecursiveEstimator`.

    Raises
    ------
    EstimatorError
        If an option cannot be used.
    """

    _shared = (*RecursiveEstimator._shared, "_design", "_terms", "_hypotheses", "_policy")

    def __init__(
        self,
        model: Model,
        *,
        identify: Sequence[str] | None = None,
        suspects: Sequence[str] = (),
        theta0: ArrayLike | None = None,
        P0: ArrayLike,
        period: float,
        noise: float | None = None,
        forgetting: float | None = None,
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
            forgetting=forgetting,
            bounds=bounds,
            output=output,
            noise=noise,
            x0=x0,
        )
        above_zero("alarm", alarm, "evidence in nats, such as 10")
        above_zero("gain", gain, "evidence in nats, such as 14")
        super().__init__(narrow.model.names, output, narrow.bounds)
        self._design = design = with_suspects(narrow, model, suspects)
        self._p = len(self.names)
        pattern, _ = split(design.model)
        parts = on_lanes(design, pattern), measured(design, clip=ROBUST, correct=True)
        tuning, state = (joined(*pair) for pair in zip(*parts, strict=True))
        self._memory = Memory(pattern, tuning, state, alarm=alarm, period=period)
        order, substeps = int(tuning["order"][0]), int(tuning["substeps"][0])
        self._terms = terms(design.model, order, substeps, period)
        self._hypotheses = Hypotheses(self._terms, (design.lower, design.upper), self._p)
        self._policy = Policy(period, gain=gain)
        self._check = round(CHECK / period)
        self._hypotheses.warm_up(design.theta0)
        self.reset()

    def _start(self) -> None:
        self._memory.reset()
        self._case: Opened | None = None
        self._found: list[Finding] = []
        self._search: Search | None = None
        self._said = False  # that no parameters near here explain the data
        self._onset = 0  # of the stretch that is searched
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
        if memory.state["armed"] and memory.ringing:
            self._case = self._opened()
        if self._case is not None and memory.count - 1 - self._case.alarm in self._policy.ages:
            self._look(self._case)
        self._seek()
        for i in [i for i, when in self._free.items() if when <= memory.count]:
            del self._free[i]
            for name in ("P", "claim"):
                memory.state[name][i, :] = memory.state[name][:, i] = 0.0
        memory.state["stop"] = self._next_stop()

    def _next_stop(self) -> int:
        count = self._memory.count
        if self._search is not None:
            return count + 1
        due = [*self._free.values(), count - count % self._check + self._check]
        if self._case is not None:
            due += [self._case.alarm + 1 + age for age in self._policy.ages]
        return min(when for when in due if when > count)

    def _opened(self) -> Opened:
        """Return the case of an alarm, and stop learning what is normal, as it was before it."""
        memory, period = self._memory, self._design.period
        alarm = memory.count - 1
        silent = int(memory.state["silent"][np.argmax(memory.state["evidence"])])
        sign = max(silent, alarm - round(LOOK_BACK / period), memory.first)
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

    def _look(self, opened: Opened) -> None:
        """Rank the hypotheses on the data so far, and do what the policy decides."""
        memory = self._memory
        age = memory.count - 1 - opened.alarm
        past = past_of(opened.before, memory, opened.normal, self._terms.n)
        ranking = self._hypotheses.rank(past, opened.normal.variance, opened.ranking)
        odds = residual(memory, opened.before.first, opened.normal)[1]
        case = Case(age, len(past.u), odds, opened.repeated, opened.dubious, opened.accepted)
        opened = replace(opened, ranking=ranking)
        self._case = self._apply(opened, past, self._policy.decide(ranking, case))
        if age == self._policy.ages[-1]:
            self._close(self._case)

    def _apply(self, opened: Opened, past: Past, decision: Decision) -> Opened:
        """Do what was decided on a look."""
        ranking = opened.ranking
        assert ranking is not None  # there was a look
        if isinstance(decision, Accept):
            if opened.accepted is None:
                self._find(opened.onset, "")
            onset = opened.before.first + ranking.change.onset
            opened = replace(opened, accepted=ranking.best, onset=onset)
            self._rewind(opened, past, ranking.change.theta)
            self._name(opened)
        elif isinstance(decision, Retract):
            opened = replace(opened, accepted=TAKEN_BACK)
            self._rewind(opened, past, opened.before.at(opened.onset)["theta"])
            self._name(opened)
        return opened

    def _rewind(self, opened: Opened, past: Past, theta: Array) -> None:
        """Put the main filter back to the onset, and run it through the data again."""
        row, active, terms = opened.before.at(opened.onset), opened.active, self._terms
        P, claim = row["P"].copy(), row["claim"].copy()
        X = np.zeros((1 + len(theta), terms.n + 1))
        X[:, : terms.n] = row["X"][: terms.n, : len(X)].T
        X[1 + active] = 0.0  # what changes now had no influence before
        retired = [i for i in range(self._p, len(theta)) if i not in self._free]
        for M in (P, claim):
            M[retired, :] = M[:, retired] = M[active, :] = M[:, active] = 0.0
            M[active, active] = (SPREAD * row["theta"][active]) ** 2 / opened.normal.variance
        since = opened.onset - opened.before.first
        self._replay(row, theta, X, P, claim, past.y[since:], past.present[since:])

    def _replay(  # noqa: PLR0917
        self, row: np.void, theta: Array, X: Array, P: Array, claim: Array, y: Array, present: Array
    ) -> None:
        u = self._memory.read("u", int(row["count"]) - 1)
        replayed = replay(
            self._terms,
            theta,
            X,
            P,
            claim,
            (u, y, present),
            forgetting=self._design.forgetting,
            box=(self._design.lower, self._design.upper),
        )
        self._memory.rewrite(row, replayed)

    def _find(self, onset: int, reason: str) -> None:
        self.alarm = True
        self._found.append(Finding(self._memory.count - 1, onset, (), (), reason))

    def _name(self, opened: Opened) -> None:
        """Write down what changed, as it is seen now."""
        active, before = opened.active, opened.before.at(opened.onset)["theta"]
        ratio = self._memory.state["theta"][active] / before[active]
        self._found[-1] = replace(
            self._found[-1],
            onset=opened.onset,
            parameters=tuple(self._design.model.names[i] for i in active),
            ratio=tuple(ratio.tolist()),
            reason="" if len(active) else UNEXPLAINED,
        )

    def _close(self, opened: Opened) -> None:
        """End a case; where the residual stays large, say so and take it as the new noise."""
        memory = self._memory
        white, _ = residual(memory, opened.before.first, opened.normal)
        if isinstance(self._policy.conclude(white, opened.repeated), GiveUp):
            recent = memory.count - round(self._policy.recent / self._design.period)
            squares = memory.read("epsilon", recent) ** 2 / memory.read("scale", recent)
            if not self._design.noise:
                memory.state["noise"] = np.nanmean(squares)
            if opened.accepted is None:
                self._find(opened.onset, UNEXPLAINED)
        if opened.accepted is not None:
            self._name(opened)
            settled = memory.count + round(SETTLED / self._design.period)
            self._free |= {int(i): settled for i in opened.active if i >= self._p}
        self._case = None
        memory.arm()

    def _seek(self) -> None:
        """Look for other parameters where those of now leave most of the output unexplained."""
        memory = self._memory
        if self._search is not None:
            self._search.advance()
            if self._search.done:
                self._settle(self._search)
        elif memory.count % self._check == 0:
            lost = self._lost()
            self._said &= lost
            if lost and self._case is None:
                self._search = self._new_search()

    def _lost(self) -> bool:
        state = self._memory.state
        return bool(
            state["noise"] > LOST * state["power"] and 1 - state["model"][-1] > FORETOLD
        )

    def _new_search(self) -> Search:
        """Return a search over the last seconds; of the state before them, only rest is known."""
        memory = self._memory
        first = memory.count - self._check
        u, y, present = memory.signals(first)
        self._onset = first
        if first:
            present[: round(UNKNOWN / self._design.period)] = False
        return Search(
            self._terms,
            memory.state["theta"].copy(),
            (self._design.lower, self._design.upper),
            identified=self._p,
            x=memory.stretch(first).state(self._terms.n)[0],
            signals=(u[:-1], y, present),
        )

    def _settle(self, search: Search) -> None:
        """Take up what a search found, if that is much better than what the filter has."""
        memory, first, best = self._memory, self._onset, search.best
        self._search = None
        own = np.nanmean(memory.read("epsilon", first + round(UNKNOWN / self._design.period)) ** 2)
        if best is not None and best.square < BETTER * own:
            row, n = memory.beginning(first + 1), self._terms.n
            X, P = np.zeros((1 + len(best.theta), n + 1)), np.zeros_like(row["P"])
            X[0, :n] = memory.stretch(first).state(n)[0]
            mine = np.arange(self._p)
            P[mine, mine] = SPREAD**2 / best.square
            _, y, present = memory.signals(first)
            self._replay(row, best.theta, X, P, P, y, present)
            self._case = None
            memory.arm()
        elif self._lost() and not self._said:
            self._said = True
            self._find(first, LOST)
