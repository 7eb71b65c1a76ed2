"""A filter that tracks what changes and learns the rest once, in its first seconds."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.finding import Finding
from flexaxis.estimators.recursion.as_told import as_told, told_records
from flexaxis.estimators.recursion.astray import begin_anew
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.recursion.joint import start_sample, with_state
from flexaxis.estimators.recursion.jumps import Jumps
from flexaxis.estimators.recursion.level import judge, show
from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.modal import NEVER, Modes, modal_records
from flexaxis.estimators.recursion.records import Record, joined
from flexaxis.estimators.recursion.seen import seen
from flexaxis.estimators.recursion.shared import (
    foresee,
    mix_all,
    recentre,
    repetition,
    transit,
    watch,
    weigh_all,
)
from flexaxis.estimators.sampling.compiler import Compiled, inlined, remembered
from flexaxis.estimators.sampling.pattern import Pattern, split

Array = NDArray[np.float64]


class Tracker(RecursiveEstimator):
    """
    Interacting multiple models with one linearisation, commissioned in the first seconds.

    After these, what of ``fixable`` has hardly been seen is fixed as told; and they are gone
    through once more from what was learnt, which on-line is a pause of that many samples' cost.
    The first pass was linearised where nothing was known: the second is a step of Gauss and
    Newton. Until then no jump is told of.

    Parameters
    ----------
    design : Design
        Tracked parameters first, those that are learnt once after them.
    tracked : int
        Number of the tracked ones, the estimates.
    modes : Modes
    told : sequence of mapping of str to float
        Groups of parameters with the values to which their estimates are drawn where the data do
        not contradict, see `flexaxis.estimators.recursion.as_told`.
    fixable : mapping of str to str
        What of these is fixed where it is not seen, and how `fixed_because` says so.
    x0_covariance : (n, n) array
    commissioning : int
        Samples of it; 0 for an axis that is known already.

    Attributes
    ----------
    theta, covariance
        Of the tracked parameters, given what was told as far as the data do not contradict it.
    findings : tuple of Finding
        What was found, named anew one second after its alarm.
    alarm : bool
        Whether something was found in the last sample.
    learnt : dict of str to (float, float)
        All parameters, tracked ones included, with value and standard deviation; of the tracked
        ones and of those that were drawn to what was told these are as in ``theta``.
    fixed_because : dict of str to str
        Parameters that were not learnt, and why not.
    """

    _shared = (
        *RecursiveEstimator._shared,
        "_design",
        "_free",
        "_begin",
        "_loop",
        "_which",
        "_told",
        "_fixable",
    )

    def __init__(
        self,
        design: Design,
        *,
        tracked: int,
        modes: Modes,
        told: Sequence[Mapping[str, float]],
        fixable: Mapping[str, str],
        x0_covariance: Array,
        commissioning: int,
    ) -> None:
        names = design.model.names
        lower, upper = design.bounds
        super().__init__(names[:tracked], design.output, (lower[:tracked], upper[:tracked]))
        self._design, self._which, self._fixable = design, np.array(modes.which), dict(fixable)
        self._told = {
            names.index(name): value / design.scale[names.index(name)]
            for group in told
            for name, value in group.items()
        }
        groups = [[names.index(name) for name in group] for group in told if group]
        pattern = with_state(split(design.model)[0])
        parts = (
            modal_records(design, pattern, modes, x0_covariance),
            told_records(tracked, [(g, [self._told[i] for i in g]) for g in groups]),
        )
        self._free, self._begin = (joined(*pair) for pair in zip(*parts, strict=True))
        self._loop = shared_loop(pattern)
        self._commissioning = commissioning
        self.reset()
        self.run(np.zeros(1), np.zeros(1))  # what has to be compiled is compiled now
        self.reset()

    def _start(self) -> None:
        self.state = self._begin.copy()
        self._origin, self._before = 0, tuple[Finding, ...]()
        self._first_seconds()

    def _first_seconds(self) -> None:
        """Be about to be commissioned."""
        self._tuning = self._free
        self.state["due"] = self._commissioning - 1
        self.fixed_because: dict[str, str] = {}
        names = [self._design.model.names[i] for i in self._which]
        self._jumps = Jumps(names, self._design.period)
        self._first: list[tuple[Array, Array, NDArray[np.bool_]]] = []

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._all(self._drawn)[0][: len(self.names)]

    @property
    def covariance(self) -> Array:  # noqa: D102
        tracked = slice(len(self.names))
        return self._all(self._drawn)[1][tracked, tracked]

    @property
    def _drawn(self) -> bool:
        """Whether there is an estimate given what was told: there is none before a sample."""
        return bool(self.state["samples_taken"][0])

    def _all(self, drawn: bool) -> tuple[Array, Array]:
        """Return all parameters (p,) and their covariance (p, p), as filtered or given the told."""
        state, scale = self.state[0], self._design.scale
        p = slice(len(scale))
        weight, delta = state["predicted"], state["delta"][:, p]
        theta, P = state["theta"][p].copy(), np.einsum("j,jab->ab", weight, state["P"][:, p, p])
        P += np.einsum("j,ja,jb->ab", weight, delta, delta)
        if drawn:
            union = self._tuning["union"][0]
            theta[union] = state["given"]
            P[np.ix_(union, union)] = state["given_P"] + state["given_between"]
        return theta * scale, P * np.outer(scale, scale)

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return self._before + tuple(
            replace(f, alarm=f.alarm + self._origin, onset=f.onset + self._origin)
            for f in self._jumps.findings
        )

    @property
    def alarm(self) -> bool:  # noqa: D102
        return self._jumps.alarm

    @property
    def learnt(self) -> dict[str, tuple[float, float]]:  # noqa: D102
        return self._named(self._drawn)

    def _named(self, drawn: bool) -> dict[str, tuple[float, float]]:
        """Return value and standard deviation by name."""
        theta, P = self._all(drawn)
        pairs = zip(theta.tolist(), np.sqrt(np.diag(P)).tolist(), strict=True)
        return dict(zip(self._design.model.names, pairs, strict=True))

    def commissioned(self) -> dict[str, dict[str, float]]:
        """
        Return what is known of the axis now, from which another estimator may begin.

        Returns
        -------
        dict
            ``nominal``: values of physical parameters; ``deviations``: their standard deviations.
            What was fixed is not among them; and they are those of the data, not drawn to what was
            told, to which the other estimator draws by itself.
        """
        found: dict[str, dict[str, float]] = {"nominal": {}, "deviations": {}}
        for name, (value, deviation) in self._named(False).items():
            if name in self.fixed_because:
                continue
            inverse = name.startswith("1/")
            physical = name.removeprefix("1/")
            found["nominal"][physical] = 1 / value if inverse else value
            found["deviations"][physical] = deviation / value**2 if inverse else deviation
        return found

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done = 0
        while done < len(u):
            self._jumps.alarm = False
            rest = slice(done, None)
            given = u[rest], y[rest], valid[rest]
            taken = self._loop(self._tuning, self.state, *given, estimates[rest], trace[rest])
            kept = slice(done, done + taken)
            self._keep(u[kept], y[kept], valid[kept])
            done += taken
            self._attend()
            if self._drawn:  # it may just have begun anew
                estimates[done - 1] = self.state["given"][0, : len(self.names)]
        estimates *= self._design.scale[: len(self.names)]

    def _keep(self, u: Array, y: Array, valid: NDArray[np.bool_]) -> None:
        """Keep the samples of commissioning."""
        if int(self.state["samples_taken"][0]) <= self._commissioning:
            self._first.append((u.copy(), y.copy(), valid.copy()))

    def _attend(self) -> None:
        """Do what is due after a sample."""
        taken = int(self.state["samples_taken"][0])
        if self.state["anew"].any():
            self._before, self._origin = self.findings, self._origin + taken
            begin_anew(self._tuning, self.state, self._begin)
            self._first_seconds()
        elif taken == self._commissioning:
            self._commission()
        elif taken > self._commissioning and self.state["asks"][0]:
            self._jumps.attend(self.state)

    def _commission(self) -> None:
        """Fix what was not seen, and go through the first seconds again from what was learnt."""
        u, y, valid = (np.concatenate(parts) for parts in zip(*self._first, strict=True))
        started, unseen = self.state["theta"].copy(), self._unseen()
        self.state = self._begin.copy()
        self.state["theta"] = started
        self._fix(unseen)
        taken, estimates, trace = 0, np.empty((len(u), len(self.names))), np.empty((len(u), 3))
        while taken < len(u):  # jumps stop it, of which nobody is told
            given = (values[taken:] for values in (u, y, valid, estimates, trace))
            taken += self._loop(self._tuning, self.state, *given)
        self._weigh_once(started)
        self.state["due"], self.state["armed"], self.state["calm"] = NEVER, 0, 0
        self._first = []

    def _unseen(self) -> list[int]:
        """Return what of the fixable is hardly known better than before."""
        names, p = self._design.model.names, len(self._design.scale)
        known = seen(np.diag(self.state["P"][0, 0])[:p], np.diag(self._design.P0))
        fixable = [names.index(n) for n in self._fixable if n in names[len(self.names) :]]
        return [i for i in fixable if not known[i]]

    def _fix(self, unseen: Sequence[int]) -> None:
        """Take parameters as they were told, for good."""
        if not unseen:
            return
        self._tuning = self._tuning.copy()
        self.state["P"][:, :, unseen, :] = 0.0
        self.state["P"][:, :, :, unseen] = 0.0
        self._tuning["jump"][0, np.isin(self._which, unseen)] = 0.0
        for i in unseen:
            self.state["theta"][0, i] = self._told[i]
            name = self._design.model.names[i]
            self.fixed_because[name] = self._fixable[name]

    def _weigh_once(self, started: Record) -> None:
        """
        Take back that the second pass started where the first had ended, so that none counts twice.

        To first order, an estimate that started δ too far is P P(0)⁻¹ δ too far in the end.
        """
        state, p = self.state[0], len(self._design.scale)
        free = np.diag(state["P"][0])[:p] > 0
        apart = np.where(free, (started[0] - self._begin["theta"][0])[:p], 0.0)
        off = state["P"][0][:, :p] @ np.linalg.solve(self._design.P0, apart)
        state["theta"][:p] -= off[:p]
        state["X"][:, 0] -= state["X"][:, 1 : 1 + len(off)] @ off


@remembered
def shared_loop(pattern: Pattern) -> Compiled:
    """Return the compiled loop for models of this pattern."""
    return sample_loop(pattern, _take, "interacting multiple models, one linearisation")


@inlined
def _take(tunings, states, k, u, y, valid, estimates, trace):  # noqa: PLR0917
    """Do with a sample what `flexaxis.estimators.recursion.loop.sample_loop` asks for."""
    tuning, state = tunings[0], states[0]
    mean, variance = foresee(state)
    used = judge(tuning, state, y[k], valid[k], mean, variance)
    transit(tuning, state, used, state["noise"])
    repeated = repetition(tuning, state, used, variance + state["noise"])
    if np.isnan(used):
        state["probability"][:] = state["predicted"]
    else:
        weigh_all(state, repeated)
    mix_all(tuning, state)
    recentre(tuning, state)
    as_told(tuning, state, estimates[k])
    start_sample(state["X"], len(state["moved"]), len(tuning["lower"]))
    show(state, trace[k])
    return watch(tuning, state) or state["anew"] > 0.0
