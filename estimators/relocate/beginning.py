"""
Fit what is learnt once to all data since the start, again and again while they are few.

A recursive filter linearises early data at a poor start, and never forgets what it made of them
where it forgets nothing. So the first seconds are fitted anew from what was known before them,
until they say more than that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models import meaning
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.sizes import motion
from flexaxis.estimators.offline.structure import guessed
from flexaxis.estimators.offline.structure import prior as thought
from flexaxis.estimators.recursion.design import Design
from flexaxis.estimators.recursion.seen import (
    AS_ABSENT,
    AS_TOLD,
    NOT_ASKED_FOR,
    NOT_THERE,
    seen,
)
from flexaxis.estimators.relocate.colour import ORDER
from flexaxis.estimators.relocate.memory import Memory, Present
from flexaxis.estimators.relocate.needed import Posterior, Question, asking
from flexaxis.estimators.relocate.normal import summing
from flexaxis.estimators.relocate.prior import Fitted, Prior, output_gain
from flexaxis.estimators.relocate.remainder import Remainder, remaining
from flexaxis.estimators.relocate.search import Descent, Evaluated
from flexaxis.estimators.relocate.suspects import Roles
from flexaxis.estimators.relocate.work import CALL, PAST, Work
from flexaxis.estimators.sampling.sampled import Terms

Array = NDArray[np.float64]

STARTED = 1.0  # s of motion that say how large it is, and what the noise
OTHER = 0.2  # of the logarithm of a variance: then that of the noise is another than was thought
WORSE = 40.0  # Σε²/σ² that a model with less parameters may leave more: 20 nats, for ten of them
ITERATIONS = 60  # of a fit, at most
CONVERGED = 1e-5  # of the sum of squares, that a further step gains
WARMING = 3.0
"""How much faster than inertias frictions walk with it, for what they are expected to be."""
SIZES, SPREADS = 10 * CALL, 16 * CALL  # operations of a start by the motion, and of how sure it is
QUESTIONS = 10 * CALL  # operations of what is asked about a model, or answered
FITTED = (1.0, 2.0, 4.0)  # s of motion, of which all is fitted


@dataclass(frozen=True)
class Beginning:
    """
    What is known before the first sample, and how more is made of it.

    Attributes
    ----------
    terms : Terms
        The model with all parameters.
    design : Design
        That of the filter.
    roles : Roles
    model : Model
        As it was told.
    told : tuple of str
        Parameters whose values were given.
    grain : float
        Operations of a piece of the work.
    """

    terms: Terms
    design: Design
    roles: Roles
    model: Model
    told: tuple[str, ...]
    grain: float = np.inf

    def prior(self, memory: Memory) -> Work[Prior | None]:
        """Return what was known before, in sizes of what has moved since; None while that rests."""
        yield PAST
        samples = round(STARTED / self.design.period)
        noise = self.design.noise**2 or memory.roughness(samples)
        if memory.state["samples"] < samples or not noise > 0:
            return None
        u, y, present = memory.signals(memory.first)
        foreseen = memory.read("expected", memory.first + 1)  # stands for y in a gap
        speed = np.where(present, y, foreseen) / output_gain(self.design)
        period, known = self.design.period, self.roles.known
        torque = u[:-1, 0]
        moves = motion(torque, speed, period)
        yield SIZES
        start = guessed(self.model, self.told, torque=torque, period=period, motion=moves)
        yield SPREADS
        of = thought(
            start,
            self.design.model.names[:known],
            torque=torque,
            period=period,
            told=self.told,
            motion=moves,
        )
        theta, scale = self.design.theta0.copy(), self.design.scale[:known]
        theta[:known] = of.start / scale
        return Prior(np.clip(theta, *self.box), np.abs(of.deviation / scale), noise)

    @property
    def fitted(self) -> tuple[float, ...]:
        """Seconds of motion of which all is fitted: the first where somebody told of all laws."""
        return FITTED[:1] if set(self.model.law_parameters) <= set(self.told) else FITTED

    @property
    def box(self) -> tuple[Array, Array]:
        """Where the parameters may be."""
        return self.design.lower, self.design.upper

    def drift(self, state: Present, prior: Prior, walk: float) -> Array:
        """
        Return Δ (p, p), what P gains in a sample.

        What is tracked walks, relative to what it was expected to be, or to what dry friction, of
        which little was expected, is found to be. The sum of speeds is an angle
        that wanders by T σ in a sample, and so does the phase of what depends on it:
        a sin Nφ + b cos Nφ by N T σ.
        """
        design, T = self.design, self.design.period
        theta, in_use = state["theta"], np.diag(state["P"]) > 0
        walks, laws = np.zeros(len(theta)), np.array(design.model.additive, bool)
        size = np.where(laws, np.maximum(abs(theta), abs(prior.theta)), abs(prior.theta))
        warm = (*meaning.motor_friction(self.model), *meaning.dry_friction(self.model))
        for i, name in enumerate(design.model.names[: self.roles.tracked]):
            walks[i] = walk * (WARMING if name in warm else 1.0) * size[i] * in_use[i]
        drift = np.diag(walks**2 * T / prior.noise)
        for a_sine, poles in meaning.ripples(self.model) if design.output == "speed" else ():
            if not set(a_sine) <= set(design.model.names):
                continue
            turning = [design.model.names.index(name) for name in a_sine]
            a, b = (in_use * theta)[turning] * design.scale[turning]
            along = poles * T * np.array([-b, a]) / design.scale[turning]
            drift[np.ix_(turning, turning)] += np.outer(along, along)
        return drift

    def fit(self, memory: Memory, prior: Prior) -> Work[Fitted | None]:
        """Explain all data that are remembered, with no more parameters than they ask for."""
        names, every = self.design.model.names, np.arange(self.roles.known)
        ripple = meaning.named(self.model.laws, ("sine", "cosine"))  # as linear as what is tracked
        few = np.array([i for i in every if i < self.roles.tracked or names[i] in ripple])
        now = memory.state["theta"].copy()
        first = yield from self._descend(memory, prior, few, (prior.theta, now))
        whole = yield from self._descend(memory, prior, every, (first.theta,))
        if not np.isfinite(whole.square):
            return None
        left = yield from self._left(memory, whole)
        if not left.explained:  # something is far from what was told, and all may be that
            return Fitted(whole.theta, every, prior.noise, {})
        noise = max(left.variance * left.repeated, self.design.noise**2)
        if abs(np.log(noise / prior.noise)) > OTHER:  # what a white residual of it would tell
            prior = prior._replace(noise=noise)
            whole = yield from self._descend(memory, prior, every, (whole.theta, first.theta))
            left = yield from self._left(memory, whole)
        return (yield from self._reduced(memory, prior, (first, whole), left))

    def _left(self, memory: Memory, whole: Evaluated) -> Work[Remainder]:
        """Return what a fit leaves of all data."""
        u, y, present = memory.signals(memory.first)
        x = memory.state_at(memory.first)
        signals = u[:-1].copy(), y, present
        given = self.terms, whole.theta, x, signals, self.roles.known
        return (yield from remaining(*given, grain=self.grain))

    def _reduced(
        self, memory: Memory, prior: Prior, fits: tuple[Evaluated, Evaluated], left: Remainder
    ) -> Work[Fitted]:
        """Return a fit with less parameters than the whole, or that if less explain much less."""
        yield QUESTIONS
        first, whole = fits
        known, unit = self.roles.known, prior.deviation  # in these units no matrix is singular
        questions = [q._replace(told=q.told / unit[q.places]) for q in self._questions(prior)]
        worth = max(left.variance * left.repeated / prior.noise, 1.0)
        data = whole.H * np.outer(unit, unit) - np.eye(known)
        posterior = Posterior(
            np.arange(known), whole.theta[:known] / unit, data / worth + np.eye(known)
        )
        yield QUESTIONS
        unseen = self._unseen(posterior, questions)
        mean = prior.theta[:known] / unit
        active, fixed = yield from asking(
            posterior, questions, mean=mean, deviation=np.ones(known), unseen=unseen
        )
        theta, start = prior.theta.copy(), first.theta.copy()
        theta[active.active] = active.theta * unit[active.active]
        for places, told in fixed:
            theta[places] = start[places] = told * unit[places]
        starts = np.clip(theta, *self.box), np.clip(start, *self.box)
        found = yield from self._descend(memory, prior, active.active, starts)
        if found.square > whole.square + WORSE * worth:
            return (yield from self._shown(memory, prior, fits, unseen))
        yield QUESTIONS
        because = self._because(active.active, unseen)
        return Fitted(found.theta, active.active, prior.noise, because)

    def _shown(
        self,
        memory: Memory,
        prior: Prior,
        fits: tuple[Evaluated, Evaluated],
        unseen: Sequence[Question],
    ) -> Work[Fitted]:
        """Return a fit with all but what the excitation does not show."""
        gone = np.concatenate([np.zeros(0, np.int64), *(q.places for q in unseen)])
        rest = np.setdiff1d(np.arange(self.roles.known), gone)
        starts = [fit.theta.copy() for fit in fits]
        for theta in starts:
            theta[gone] = prior.theta[gone]
        found = yield from self._descend(memory, prior, rest, starts)
        yield QUESTIONS
        return Fitted(found.theta, rest, prior.noise, self._because(rest, unseen))

    def _because(self, active: NDArray[np.int64], unseen: Sequence[Question]) -> dict[str, str]:
        """Return why each of the others is not learnt."""
        hidden = {int(i) for question in unseen for i in question.places}
        structure, found = meaning.structure(self.model), {}
        for i in np.setdiff1d(np.arange(self.roles.known), active):
            name = self.design.model.names[i]
            stated = name in self.told or name in structure
            words = (AS_TOLD, AS_ABSENT) if int(i) in hidden else (NOT_ASKED_FOR, NOT_THERE)
            found[name] = words[not stated]
        return found

    def _unseen(self, posterior: Posterior, questions: Sequence[Question]) -> list[Question]:
        """Return the questions about what the excitation does not show."""
        known = seen(np.diag(np.linalg.inv(posterior.H)), np.ones(len(posterior.H)))
        names = self.design.model.names
        fixable = meaning.fixable(self.model)
        hidden = [i for i, name in enumerate(names[: len(known)]) if name in fixable]
        return [
            q for q in questions if np.isin(q.places, hidden).all() and not known[q.places].any()
        ]

    def _questions(self, prior: Prior) -> list[Question]:
        """Return what may be as it was told, for parameters that the model has."""
        names = self.design.model.names[: self.roles.known]
        theta = np.where(np.isin(names, self.told), prior.theta[: len(names)], 0.0)
        lower = np.maximum(self.design.lower[: len(names)], 0.0)
        theta = np.where(theta != 0, theta, lower)  # kappa may be told to be below zero

        def places(of: Sequence[str]) -> NDArray[np.int64]:
            return np.array([names.index(name) for name in of if name in names], np.int64)

        dry = set(meaning.dry_friction(self.model))
        absent = [
            Question(places(of), theta[places(of)], places(with_them))
            for of, with_them in dict.fromkeys(meaning.may_be_absent(self.model))
            if set(of) <= set(names) and not set(of) & set(self.told) & dry
        ]
        asked = set(names[: self.roles.tracked]) - set(meaning.LEARNT)
        structure = [name for name in meaning.structure(self.model) if name not in asked]
        sheet = [places([name]) for name in structure if name in names]
        return absent + [Question(i, prior.theta[i], places([])) for i in sheet]

    def _descend(
        self, memory: Memory, prior: Prior, active: NDArray[np.int64], starts: Sequence[Array]
    ) -> Work[Evaluated]:
        """Return the most probable values of some parameters, all others as they are."""
        u, y, present = memory.signals(memory.first)
        x, nothing = memory.state_at(memory.first), np.zeros(ORDER)
        signals = u[:-1].copy(), y, present, nothing, nothing, prior.noise, active
        known, deviation = self.roles.known, prior.deviation

        def evaluate(theta: Array) -> Work[Evaluated]:
            square, H, g = yield from summing(self.terms, theta, x, *signals, grain=self.grain)
            yield PAST
            if not np.isfinite(square):
                return Evaluated(theta, np.inf, np.zeros_like(H), np.zeros_like(g))
            off = (theta - prior.theta)[:known] / deviation
            H += np.diag(deviation[active] ** -2)
            return Evaluated(theta, float(square + off @ off), H, g - (off / deviation)[active])

        seen = []
        for theta in starts:
            seen.append((yield from evaluate(theta)))
        descent = Descent(
            min(seen, key=_square),
            self.box,
            active,
            sizes=deviation[active],
            iterations=ITERATIONS,
            converged=CONVERGED,
        )
        while not descent.done:
            descent.take((yield from evaluate(descent.trial)))
        return descent.at


def _square(tried: Evaluated) -> float:
    return tried.square
