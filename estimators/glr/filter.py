"""The estimator glr, a joint Kalman filter with a bank of hypotheses about parameter jumps."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.filters.fault_monitor import begin_anew
from flexaxis.estimators.filters.filter import RecursiveEstimator
from flexaxis.estimators.glr.bank_arrays import BUDGET
from flexaxis.estimators.glr.cogging import strongest_wave
from flexaxis.estimators.glr.comparison import Comparison
from flexaxis.estimators.glr.initialisation import FirstSeconds
from flexaxis.estimators.glr.loop import glr
from flexaxis.estimators.glr.workspace import Workspace, take_up
from flexaxis.estimators.protocol import Finding

Array = NDArray[np.float64]

COMPARING, LEARNING = 1 / 8, 3 / 4  # cost of a decision relative to the budget


class Glr(RecursiveEstimator):
    """
    A joint Kalman filter with a hypothesis bank and an initialisation phase.

    Parameters
    ----------
    plain : Workspace
        Memory of the glr estimator before the first sample.
    rich : Workspace, optional
        Memory of a filter whose model includes cogging; this memory replaces ``plain`` if the data
        contain cogging.

    Attributes
    ----------
    theta, covariance : (p,), (p, p) arrays
        Mean and covariance of the tracked parameters over all jump hypotheses.
    findings : tuple of Finding
        Detected parameter jumps. The estimator can still attribute a jump to another parameter for
        up to 2.6 axis time scales after the onset.
    alarm : bool
        Whether the estimator detected a parameter jump in the last sample.
    learnt : dict of str to (float, float)
        Estimated value and standard deviation of every parameter, keyed by parameter name.
    beliefs : dict of str to float
        Probability that a parameter jumped at any onset in the hypothesis bank, keyed by parameter
        name.
    fixed_because : dict of str to str
        Reason why a parameter was fixed at its nominal value, keyed by parameter name.
    cogging : int
        Number of cogging waves per revolution, or 0 if the search found no cogging.
    """

    def __init__(self, plain: Workspace, rich: Workspace | None = None) -> None:
        super().__init__(plain.names[: plain.tracked], plain.design.output)
        self._plain, self._rich = plain, rich
        self.reset()
        self.run([], [])  # compile the loop now and not in the first step

    def _start(self) -> None:
        self._begin_at(0, self._plain.copy())

    def _begin_at(self, origin: int, work: Workspace, findings: Sequence[Finding] = ()) -> None:
        """Prepare the filter for its first sample or for the first sample after a reset."""
        self._work, self._learning = work, FirstSeconds(work)
        self._comparison, self.alarm = Comparison(work, origin, findings), False
        self.fixed_because: dict[str, str] = {}
        self.cogging = 0
        if work.timing.first == 0:
            work.bank["awake"] = 1

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._work.mean()[0][: len(self.names)]

    @property
    def covariance(self) -> Array:  # noqa: D102
        p = len(self.names)
        return self._work.mean()[1][:p, :p]

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return tuple(self._comparison.findings)

    @property
    def learnt(self) -> dict[str, tuple[float, float]]:  # noqa: D102
        theta, P = self._work.mean()
        pairs = zip(theta.tolist(), np.sqrt(np.maximum(np.diag(P), 0)).tolist(), strict=True)
        return dict(zip(self._work.names, pairs, strict=True))

    @property
    def beliefs(self) -> dict[str, float]:  # noqa: D102
        names, which = self._work.names, self._work.bank["which"]
        by = self._work.bank["weight"].reshape(-1, len(which)).sum(axis=0).tolist()
        return {names[i]: weight for i, weight in zip(which, by, strict=True)}

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done, running = 0, True
        while running:
            rest, work = slice(done, None), self._work
            samples = u[rest], y[rest], valid[rest], estimates[rest], trace[rest]
            self.alarm = self.alarm and not len(samples[0])
            states, bank = work.states, work.bank
            done += glr(states.block, states.at, bank.block, bank.at, *samples)
            self._attend()
            if done and not np.isfinite(estimates[done - 1]).all():  # just reset
                estimates[done - 1] = self._work.states["theta"][0, : len(self.names)]
            work = self._work
            running = done < len(u) or (work.busy and bool(work.bank["left"] > 0))
        estimates *= self._plain.design.scale[: len(self.names)]

    def _attend(self) -> None:
        """Make the decision that is due, or postpone it to stay within the computing budget."""
        work, bank = self._work, self._work.bank
        cost = int(BUDGET * (COMPARING if bank["awake"] else LEARNING))
        if work.states["anew"][0] > 0:
            self._begin_anew()
        elif not (work.caught_up if work.busy else bank["asks"]):
            return
        elif bank["left"] < cost:
            bank["left"] = 0
        else:
            bank["left"] -= cost
            self._decide()

    def _decide(self) -> None:
        """Evaluate a completed filter pass over old samples, or start the next filter pass."""
        work, bank = self._work, self._work.bank
        if not bank["awake"]:
            if work.busy:
                self._learning.go_on()
            elif not self._take_up_cogging():  # otherwise, wait for the next sample
                self.fixed_because = self._learning.begin()
        elif work.busy:
            self.alarm = self._comparison.go_on()
        elif 0 <= bank["due"] <= work.now:
            self._comparison.review()
        else:
            self._comparison.begin()

    def _take_up_cogging(self) -> bool:
        """If the data contain cogging, switch to the filter with cogging and return True."""
        work, wave = self._work, None
        if self._rich and work.bank["searching"]:
            wave = strongest_wave(work.bank, float(self._rich.design.scale[-2]) ** 2)
        if self._rich and wave:
            rich = self._rich.copy()
            take_up(work, rich, wave)
            self._begin_at(self._comparison.origin, rich, self.findings)
            self.cogging = wave[0]
        self._work.bank["searching"] = 0
        return wave is not None

    def _begin_anew(self) -> None:
        """Reset the state covariance after a sensor was stuck, or reset the whole filter."""
        work, p = self._work, self._work.p
        P, begin = work.states["P"][0], work.begin["P"][0]
        if work.states["anew"][0] < 2 and work.bank["awake"]:
            P[:, p:] = P[p:] = 0.0
            P[p:, p:] = begin[p:, p:]
            work.states["anew"][0] = 0.0
            self._comparison.forget()
            work.empty()
            return
        begin_anew(work.states, work.begin)
        numbers, taken = work.states["now"].copy(), int(work.bank["taken"])
        self._begin_at(self._comparison.origin + taken, self._plain.copy(), self.findings)
        self._work.states["now"] = numbers
