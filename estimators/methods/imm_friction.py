"""Interacting multiple models of an axis with friction: it tracks what changes, learns the rest."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.methods.start import Nominal
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.structure import TRACKED, prior, structure_names, with_laws
from flexaxis.estimators.recursion.design import above_zero, make_design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.recursion.joint import start_sample, state_covariance, with_state
from flexaxis.estimators.recursion.level import bound, judge, level, show
from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.records import Record, joined, on_lanes, record
from flexaxis.estimators.recursion.shared import (
    foresee,
    learn_from,
    mix_all,
    recentre,
    repetition,
    transit,
    weigh_all,
)
from flexaxis.estimators.sampling.compiler import Compiled, inlined, remembered
from flexaxis.estimators.sampling.pattern import Pattern, split

Array = NDArray[np.float64]


class ImmFriction(RecursiveEstimator):
    def __init__(
        self,
        model: Model,
        *,
        track: Sequence[str],
        learn: Sequence[str],
        torque,
        period,
        told=(),
        output="speed",
        noise=None,
        walk=1.41e-3,
        jump=0.2236,
        rate=1e-3,
        hold=0.1,
        spread=0.2,
        echo=10.0,
        state_walk=0.0,
        temper=True,
    ):
        names = (*track, *learn)
        thought = prior(model, names, torque=torque, period=period, told=told, spread=spread)
        design = make_design(
            model,
            identify=names,
            theta0=thought.start,
            P0=thought.P0,
            period=period,
            drift=None,
            bounds=thought.bounds,
            output=output,
            noise=noise,
            scale=thought.scale,
        )
        q, p = len(track), len(names)
        super().__init__(tuple(track), output, tuple(b[:q] for b in design.bounds))
        self.thought = thought
        self._design = design
        pattern = with_state(split(design.model)[0])
        n, m = pattern.states, pattern.p
        tuning, start = on_lanes(design, pattern)
        known, level_start = level(design)
        W = np.zeros(m)
        W[:q] = walk**2 * period
        W[p + 2] = state_walk
        tuning = joined(
            tuning,
            known,
            record(
                walk=W,
                jump=np.full(q, jump**2 * period / hold),
                quiet=1 - rate * period,
                stay=1 - period / hold,
                lower=design.lower,
                upper=design.upper,
                echo=period / echo,
                temper=float(temper),
            ),
        )
        blocks = design.model.blocks(design.theta0)
        X, C = start["X"][0], blocks[:, -1, :-1]
        X[:n, 1 + p : 1 + m] = np.eye(n)
        X[-1, 1 : 1 + p], X[-1, 1 + p : 1 + m] = C[1:] @ design.x0, C[0, :n]
        J = 1 + q
        P = np.zeros((J, m, m))
        P[:, :p, :p] = design.P0
        P[:, p:, p:] = state_covariance(design, None)
        weights = np.r_[1.0, np.zeros(q)]
        start = joined(
            start,
            level_start,
            record(
                P=P,
                delta=np.zeros((J, m)),
                Ph=np.zeros((J, m)),
                spread=np.zeros(J),
                shift=np.zeros(J),
                predicted=weights,
                probability=weights,
                logarithm=np.zeros(J),
                GP=np.zeros((n, m)),
                GT=np.zeros((m, n)),
                moved=np.zeros(n),
                gain=np.zeros(m),
                parted=np.zeros((J, m)),
                row=np.zeros((J, m)),
                share=np.zeros((J, J)),
                echo=np.array([0.0, 1.0, np.nan]),
            ),
        )
        self._tuning, self._begin, self._loop = tuning, start, shared_loop(pattern)
        self.all_names = names
        self.reset()

    def _start(self):
        self.state = self._begin.copy()
        self.log = np.zeros((0, 0))

    def _take(self, u, y, valid, estimates, trace):
        log = np.zeros((len(u), 1 + 2 * len(self.all_names) + self.state["P"].shape[1]))
        p = len(self.all_names)
        full = np.empty((len(u), p))
        self._loop(self._tuning, self.state, u, y, valid, full, trace, log)
        estimates[:] = full[:, : len(self.names)] * self._design.scale[: len(self.names)]
        self.log = log
        self.full = full * self._design.scale

    @property
    def theta(self):
        return (self.state["theta"][0] * 1.0)[: len(self.names)] * self._design.scale[
            : len(self.names)
        ]

    @property
    def covariance(self):
        q = len(self.names)
        s = self._design.scale[:q]
        return self.state["P"][0, 0, :q, :q] * np.outer(s, s)


@remembered
def shared_loop(pattern: Pattern) -> Compiled:
    """Return the compiled loop for models of this pattern."""
    return sample_loop(pattern, _take, "interacting multiple models, one linearisation")


@inlined
def _take(tunings, states, k, u, y, valid, estimates, trace, log):  # noqa: PLR0917
    tuning, state = tunings[0], states[0]
    mean, variance = foresee(state)
    used = judge(tuning, state, y[k], valid[k], mean, variance)
    noise = state["noise"]
    transit(tuning, state)
    if not np.isnan(used):
        learn_from(state, used, noise)
        repeated = repetition(tuning, state, used, variance + noise)
        weigh_all(state, repeated if tuning["temper"] > 0.0 else 1.0)
        log[k, 0] = repeated
    else:
        state["probability"][:] = state["predicted"]
        state["echo"][2] = np.nan
    p = estimates.shape[1]
    for j in range(len(state["probability"])):
        log[k, 1 + 2 * p + j] = state["probability"][j]
    mix_all(tuning, state)
    recentre(tuning, state)
    for i in range(p):
        estimates[k, i] = state["theta"][i]
        total = 0.0
        for j in range(len(state["predicted"])):
            total += state["predicted"][j] * (state["P"][j, i, i] + state["delta"][j, i] ** 2)
        log[k, 1 + i] = np.sqrt(total)
    start_sample(state["X"], len(state["moved"]), p)
    show(state, trace[k])
    return False
