"""Interacting multiple models of an axis with friction: it tracks what changes, learns the rest."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexaxis.estimators.entry import Entry
from flexaxis.estimators.finding import UNEXPLAINED, Finding
from flexaxis.estimators.methods.start import Nominal
from flexaxis.estimators.models.axes import PAPER
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import state_sizes
from flexaxis.estimators.offline.structure import LEARNT, TRACKED, prior, structure_names, with_laws
from flexaxis.estimators.recursion.as_told import as_told, told_records
from flexaxis.estimators.recursion.changes import Z95, single_change
from flexaxis.estimators.recursion.design import above_zero, make_design
from flexaxis.estimators.recursion.filter import RecursiveEstimator
from flexaxis.estimators.recursion.joint import start_sample, state_covariance, with_state
from flexaxis.estimators.recursion.level import judge, show
from flexaxis.estimators.recursion.loop import sample_loop
from flexaxis.estimators.recursion.modal import Modes, modal_records
from flexaxis.estimators.recursion.records import joined
from flexaxis.estimators.recursion.shared import (
    foresee,
    learn_from,
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

WALK = 7e-4  # 1/√s, of θ over its scale
SEEN = 0.25  # standard deviation after commissioning over that before, from which on it is learnt
FRICTION = ("f_c", "f_s")  # which are seen as soon as anything moves
UNSEEN = "the first seconds hardly move what it acts on, and it stays as it was told"
COMMISSIONING = 4.0  # s, which are gone through twice
LATER = 1.0  # s after an alarm, when what changed is named again
BEFORE = 0.05  # s before an onset, as of when θ is as it was
BEGUN = 0.05  # probability of a jump from which on it may have begun
SUSPECTED = 0.1  # of what is learnt once: how often it jumps, over how often what is tracked does
SIGNIFICANT = 9.0  # χ² of one degree of freedom, below which nothing explains an alarm
CERTAIN = 12.0  # that which an alarm needs
STORM = 60.0  # s, within which every alarm doubles what the next one needs
AGES = (
    0.01,
    0.02,
    0.02,
    0.05,
    0.1,
    0.1,
    0.2,
)  # s between looks at a jump that may become significant


class ImmFriction(RecursiveEstimator):
    """
    Joint extended Kalman filters in an interacting multiple model, on a model with laws.

    Parameters
    ----------
    model : Model
        As from `flexaxis.estimators.offline.structure.with_laws`.
    track : sequence of str
        What may change in use: these are the estimates.
    learn : sequence of str
        What is learnt once, as states without a walk.
    suspect : sequence of str
        What of ``learn`` may jump all the same, to be named.
    torque : (N,) array_like, optional
        Of a nominal run [N m].
    period : float
        Sampling period [s].
    told : sequence of str
        Parameters that were told.
    output : {"speed", "increment"}
    noise : float, optional
        σ of y, in its unit; learnt from the innovations by default.
    walk, jump, rate, hold, spread : float
        As for `imm_friction`.

    Attributes
    ----------
    findings : tuple of Finding
    """

    _shared = (
        *RecursiveEstimator._shared,
        "_design",
        "_free",
        "_begin",
        "_loop",
        "prior",
        "_as_told",
    )

    def __init__(
        self,
        model: Model,
        *,
        track: Sequence[str],
        learn: Sequence[str],
        suspect: Sequence[str] = (),
        torque: ArrayLike | None = None,
        period: float,
        told: Sequence[str] = (),
        groups=(),
        output: str = "speed",
        noise: float | None = None,
        walk: float = WALK,
        jump: float = 0.22,
        rate: float = 1e-3,
        hold: float = 0.1,
        spread: float = 0.2,
        commissioning: float = COMMISSIONING,
    ) -> None:
        names = (*track, *learn)
        self.prior = prior(model, names, torque=torque, period=period, told=told, spread=spread)
        self._design = design = make_design(
            model,
            identify=names,
            theta0=self.prior.start,
            P0=self.prior.P0,
            drift=self.prior.P0,  # not forgotten; what θ gains is that of the modes
            period=period,
            bounds=self.prior.bounds,
            output=output,
            noise=noise,
            scale=self.prior.scale,
        )
        super().__init__(
            tuple(track), output, (design.bounds[0][: len(track)], design.bounds[1][: len(track)])
        )
        pattern = with_state(split(design.model)[0])
        W = np.zeros(pattern.p)
        W[: len(track)] = walk**2 * period
        which = tuple(names.index(name) for name in (*track, *suspect))
        variances = np.full(len(which), jump**2 * period / hold)
        rates = rate * np.where(np.arange(len(which)) < len(track), 1.0, SUSPECTED)
        modes = Modes(which, W, variances, rates / rates.sum() * rate, hold)
        covariance = state_covariance(design, state_sizes(model, torque, period) ** 2)
        parts = (
            modal_records(design, pattern, modes, covariance),
            told_records(len(track), self._told_groups(groups)),
        )
        self._free, self._begin = (joined(*pair) for pair in zip(*parts, strict=True))
        self._loop = shared_loop(pattern)
        self._which = np.array(which)
        self._as_told = {name: value for group in groups for name, value in group.items()}
        self._commissioning = round(commissioning / period)
        self.reset()
        self.run(np.zeros(1), np.zeros(1))  # what has to be compiled is compiled now
        self.reset()

    def _told_groups(self, groups):
        names = self._design.model.names
        found = []
        for group in groups:
            inside = [n for n in group if n in names]
            if inside:
                i = np.array([names.index(n) for n in inside])
                told = [group[n] for n in inside] / self._design.scale[i]
                found.append((i, told))
        return found

    def _start(self) -> None:
        self.state = self._begin.copy()
        self._found: list[Finding] = []
        self._tuning = self._free
        self.fixed_because: dict[str, str] = {}
        self._first: list[tuple[Array, Array, NDArray[np.bool_]]] = []
        self.state["due"] = self._commissioning - 1
        self._case: int | None = None  # onset of a jump that is not significant yet
        self._ages: list[float] = []
        self.alarm = False

    @property
    def theta(self) -> Array:  # noqa: D102
        return self._all[: len(self.names)]

    @property
    def _all(self) -> Array:
        return self.state["theta"][0, : len(self._design.scale)] * self._design.scale

    @property
    def covariance(self) -> Array:  # noqa: D102
        return self._covariance()[: len(self.names), : len(self.names)]

    def _covariance(self) -> Array:
        """Return that of all parameters (p, p), over the mixture."""
        state, p = self.state[0], len(self._design.scale)
        weight, delta = state["predicted"], state["delta"][:, :p]
        P = np.einsum("j,jab->ab", weight, state["P"][:, :p, :p])
        P += np.einsum("j,ja,jb->ab", weight, delta, delta)
        return P * np.outer(self._design.scale, self._design.scale)

    @property
    def findings(self) -> tuple[Finding, ...]:  # noqa: D102
        return tuple(self._found)

    @property
    def learnt(self) -> dict[str, tuple[float, float]]:
        """Every parameter that is tracked or learnt, with its value and standard deviation."""
        deviation = np.sqrt(np.diag(self._covariance()))
        values = zip(self._all.tolist(), deviation.tolist(), strict=True)
        return dict(zip(self._design.model.names, values, strict=True))

    def _take(
        self, u: Array, y: Array, valid: NDArray[np.bool_], estimates: Array, trace: Array
    ) -> None:
        done = 0
        while done < len(u):
            self.alarm = False
            rest = slice(done, None)
            given = u[rest], y[rest], valid[rest]
            taken = self._loop(self._tuning, self.state, *given, estimates[rest], trace[rest])
            self._keep(*(values[:taken] for values in given))
            done += taken
            self._attend()
        estimates *= self._design.scale[: len(self.names)]

    def _keep(self, u: Array, y: Array, valid: NDArray[np.bool_]) -> None:
        """Keep the samples of commissioning."""
        left = self._commissioning - sum(len(part[0]) for part in self._first)
        if left > 0:
            self._first.append((u[:left].copy(), y[:left].copy(), valid[:left].copy()))

    def _again(self) -> None:
        """
        Go through the samples of commissioning once more, from what was learnt in them.

        The first pass is linearised where nothing is known yet; the second, a step of Gauss and
        Newton, where it ended. What it may deviate by from there is what it was in the first.
        """
        u, y, valid = (np.concatenate(parts) for parts in zip(*self._first, strict=True))
        learnt, unseen = self.state["theta"].copy(), self._unseen()
        self.state = self._begin.copy()
        self.state["theta"] = learnt
        self._fix(unseen)
        taken, estimates, trace = 0, np.empty((len(u), len(self.names))), np.empty((len(u), 3))
        while taken < len(u):  # jumps stop it, of which nobody is told
            given = (values[taken:] for values in (u, y, valid, estimates, trace))
            taken += self._loop(self._tuning, self.state, *given)
        self._weigh_once(learnt)
        self.state["due"], self.state["armed"], self.state["calm"] = -1, 0, 0
        self._first = []

    def _weigh_once(self, started: Array) -> None:
        """
        Take back that the second pass started where the first had ended, and not where P(0) is of.

        To first order an estimate that started δ too far is P P(0)⁻¹ δ too far in the end.
        """
        state, p = self.state[0], len(self._design.scale)
        m = state["P"].shape[-1]
        off = (started[0] - self._begin["theta"][0])[:p]
        free = np.diag(state["P"][0])[:p] > 0
        off = np.where(free, off, 0.0) / np.diag(self._design.P0)
        off = state["P"][0][:, :p] @ off
        state["theta"][:p] -= off[:p]
        state["X"][:, 0] -= state["X"][:, 1 : 1 + m] @ off

    def _unseen(self) -> list[int]:
        """Return what of the linear model is hardly known better than before."""
        names, p = self._design.model.names, len(self._design.scale)
        known = np.sqrt(np.diag(self.state["P"][0, 0])[:p] / np.diag(self._design.P0))
        fixable = [names.index(n) for n in self._as_told if n in names and n not in FRICTION]
        return [i for i in fixable if not known[i] < SEEN]

    def _fix(self, unseen: Sequence[int]) -> None:
        """Take parameters as they were told, for good."""
        if not unseen:
            return
        self._tuning = self._tuning.copy()
        self.state["P"][:, :, unseen, :] = 0.0
        self.state["P"][:, :, :, unseen] = 0.0
        self._tuning["jump"][0, np.isin(self._which, unseen)] = 0.0
        for i in unseen:
            name = self._design.model.names[i]
            self.state["theta"][0, i] = self._as_told[name] / self._design.scale[i]
            self.fixed_because[name] = UNSEEN

    def _attend(self) -> None:
        """Do what is due after a sample: tell of a jump, or name it again."""
        state = self.state[0]
        now = int(state["samples_taken"]) - 1
        if self._first and now + 1 == self._commissioning:
            self._again()
        elif now < self._commissioning:
            return
        elif now == state["due"] and self._case is None:
            self._found[-1] = self._named(self._found[-1], now)
        elif self._case is None:
            self.state["armed"], self.state["calm"] = 0, 0
            self._case, self._ages = self._onset(now), list(AGES)
        if self._case is not None:
            self._look(now)

    def _look(self, now: int) -> None:
        """Tell of a jump as soon as the change is significant."""
        assert self._case is not None
        seen = self._named(Finding(now, self._case, (), ()), now)
        if seen.parameters:
            self.alarm = True
            self._found.append(seen)
            later, self._case = LATER, None
        elif self._ages:
            later = self._ages.pop(0)
        else:
            self._case = None
            return
        self.state["due"] = now + round(later / self._design.period)

    def _onset(self, now: int) -> int:
        """Return the sample at which a jump began to be likely."""
        ring = self.state[0]["ring"]
        first = now
        while now - first < min(len(ring), now) - 1 and ring[(first - 1) % len(ring), -1] > BEGUN:
            first -= 1
        return max(first - 1, 0)

    def _named(self, finding: Finding, now: int) -> Finding:
        """Return a finding with what changed, as it is seen now."""
        ring, q = self.state[0]["ring"], len(self._which)
        size = len(ring)
        past = max(finding.onset - round(BEFORE / self._design.period), now - size + 1, 0)
        before, after = ring[past % size], ring[now % size]
        covariance = (before + after)[q : q + q * q].reshape(q, q)
        change = single_change(after[:q] - before[:q], covariance)
        i = change.index
        recent = sum(now - f.alarm < STORM / self._design.period for f in self._found)
        least = SIGNIFICANT if finding.parameters else CERTAIN * 2.0**recent
        if change.gain < least or before[i] == 0.0:
            return replace(finding, parameters=(), ratio=(), interval=(), reason=UNEXPLAINED)
        ratio = 1 + change.size / before[i]
        half = Z95 * change.deviation / abs(before[i])
        return replace(
            finding,
            parameters=(self._design.model.names[self._which[i]],),
            ratio=(float(ratio),),
            interval=((float(ratio - half), float(ratio + half)),),
            reason="",
        )


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
    transit(tuning, state)
    repeated = repetition(tuning, state, used, variance + state["noise"])
    if np.isnan(used):
        state["probability"][:] = state["predicted"]
    else:
        learn_from(state, used, state["noise"])
        weigh_all(state, repeated)
    mix_all(tuning, state)
    recentre(tuning, state)
    as_told(tuning, state, estimates[k])
    start_sample(state["X"], len(state["moved"]), len(tuning["lower"]))
    show(state, trace[k])
    return watch(tuning, state)


def imm_friction(
    nominal: Nominal,
    period: float,
    *,
    identify: Sequence[str] = PAPER,
    output: str = "speed",
    P0: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    learn: Sequence[str] | str = "auto",
    track: Sequence[str] = TRACKED,
    suspect: Sequence[str] = ("J_m", "k_g"),
    shrink=(0, 1, 2, 3, 4),
    walk: float = WALK,
    jump: float = 0.22,
    rate: float = 1e-3,
    hold: float = 0.1,
    noise: float | None = None,
    spread: float = 0.2,
    commissioning: float = COMMISSIONING,
) -> ImmFriction:
    """
    Make the interacting multiple models of an axis with friction.

    Parameters
    ----------
    P0
        Taken as by every entry, and left: P(0) is that of what is thought of each parameter.
    torque : (N,) array_like, optional
        Torque of a nominal run, from which the sizes of friction and play are taken.
    learn : "auto", "none" or sequence of str
        What is learnt once.
    track : sequence of str
        What is tracked, besides ``identify``.
    walk : float
        Standard deviation of the random walk of tracked parameters after a second, over their
        scale.
    jump : float
        Standard deviation of a jump, over the scale.
    rate, hold : float
        How often a jump comes [1/s], and how long it lasts on average [s].
    noise : float, optional
        Standard deviation of the output, in its unit; else that of the data sheet, or learnt.
    spread : float
        Standard deviation of the tracked parameters of θ(0), relative to it.
    """
    above_zero("period", period, "the sampling period in seconds")
    model = with_laws(nominal, torque=torque, period=period)
    tracked = tuple(dict.fromkeys([*identify, *(n for n in track if _has(model, n, identify))]))
    found = structure_names(model, tracked)
    learnt = found if learn == "auto" else () if learn == "none" else tuple(learn)
    groups = [
        {n: model.nominal[n] for n in LEARNT if n in learnt},
        {"kappa": 0.0, "gap": 0.0},
        {"c_sin": 0.0, "c_cos": 0.0},
        {"f_c": 0.0, "f_s": 0.0},
        {"f_s": 0.0},
    ]
    groups = [groups[i] for i in shrink]
    told = () if isinstance(nominal, Model) else tuple(nominal)
    if noise is None and not isinstance(nominal, Model):
        noise = nominal.get("noise")
    return ImmFriction(
        model,
        track=tracked,
        learn=learnt,
        suspect=tuple(n for n in suspect if n in learnt),
        torque=torque,
        period=period,
        told=told,
        groups=groups,
        output=output,
        noise=noise,
        walk=walk,
        jump=jump,
        rate=rate,
        hold=hold,
        spread=spread,
        commissioning=commissioning,
    )


def _has(model: Model, name: str, identify: Sequence[str]) -> bool:
    """Whether a model has a parameter that is not identified already, itself or inverted."""
    physical = name.removeprefix("1/")
    return physical in model.parameters and physical not in {n.removeprefix("1/") for n in identify}


ENTRIES = (
    Entry(
        "imm-friction",
        "interacting multiple models of an axis with dry friction: tracks changes, learns the rest",
        imm_friction,
        knob="walk",
        default=WALK,
        look=("#882255", "D"),
        rank=9.5,
        laws=True,
    ),
)
