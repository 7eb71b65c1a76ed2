"""Which law of friction a log asks for: the simplest that predicts what it was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt, Log, explored
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.friction import CHOICES, Sizes, names_by, rubbing
from flexaxis.experiments.logs.pieces import LEAST_GAIN, Comparison, compare, held_out
from flexaxis.experiments.logs.starts import SMOOTHER, Starts, gained, smoother

LEAST_LEVEL = 0.03  # of the rms torque, of dry friction to start from
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST = 20_000  # samples that laws are compared on
OPEN = ("auto", "none")  # where laws are compared, if only to say what is missing
HOPEFUL = 1 - 2 * LEAST_GAIN  # times the square of the error: the least that is worth it
ORDER = ("coulomb", "lugre", "static")


@dataclass(frozen=True)
class Tried:
    """A law that was compared with a simpler one.

    Attributes
    ----------
    name, against : str
        Words of both.
    comparison : Comparison
    taken : bool
    held : bool
        Whether what is compared was held out of the fit, and not fitted to as well.
    """

    name: str
    against: str
    comparison: Comparison
    taken: bool
    held: bool = True


def best_of_laws(
    starts: Starts,
    friction: str,
    free: Sequence[str],
    fix: Sequence[str],
    given: Mapping[str, float],
) -> tuple[Attempt, Fitted, tuple[Tried, ...], str]:
    """Return the fit with the law and the kind of torque that predict best.

    Dry friction that is left out makes a held torque seem to act before it is set, and so does a
    torque that is smooth; so where both could be, laws are looked for with both.
    """
    law = partial(choose, wanted=friction, free=free, fix=fix, given=given)
    held = starts.search(starts.attempt)
    if starts.attempt.model.laws:
        return law(starts, *held)
    other = smoother(*held)
    found = law(starts, *other)
    if other[0] is held[0] or not (starts.whole and able(held[0].model)):
        return found
    rubbing = law(starts, *held)
    return found if gained(rubbing[1], found[1]) > SMOOTHER else rubbing


def choose(
    starts: Starts,
    linear: Attempt,
    fitted: Fitted,
    wanted: str,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    given: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Attempt, Fitted, tuple[Tried, ...], str]:
    """Return the attempt with the law that is wanted, or with the one that the log asks for.

    Parameters
    ----------
    starts : Starts
    linear, fitted
        The attempt without a law, or with those of the axis, and its fit.
    wanted : str
        Word of the law, or ``"auto"``.
    free, fix : sequence of str
    given : mapping of str to float
        As for `flexaxis.experiments.logs.identify.identify`.
    """
    if linear.model.laws:
        return linear, fitted, (), "as told"
    if wanted in OPEN and not (able(linear.model) and starts.whole):
        return linear, fitted, (), "none"
    short = replace(linear, log=linear.log.part(MOST))
    level = given["f_c"] / torque_constant(linear.model) if "f_c" in given else starts.level()
    bench = _Bench(starts, short, fitted, tuple(free), tuple(fix), level, given)
    begun, tried = bench.compared(wanted) if wanted in OPEN else (bench.started(wanted, None), ())
    if begun is None or wanted == "none":
        return linear, fitted, tried, "none"
    begun = replace(begun, attempt=replace(begun.attempt, log=linear.log))
    return begun.attempt, begun.finished(), tried, tried_word(tried) or wanted


def torque_constant(model: Model) -> float:
    """Return the torque constant of a model, 1 where it has none."""
    return float(model.nominal.get("k_T", 1.0))


def check_given(model: Model, wanted: str, given: Mapping[str, float]) -> None:
    """Refuse values of parameters that no law has which is looked for.

    Raises
    ------
    LogError
    """
    if not given:
        return
    kinds = ORDER if wanted == "auto" else (wanted,) if wanted in ORDER else ()
    fitting = [kind for kind in kinds if given.keys() <= names_by(kind)]
    if model.laws or not fitting:
        have = "; ".join(f"{kind} has {', '.join(sorted(names_by(kind)))}" for kind in ORDER)
        whose = "the axis, with laws of its own," if model.laws else f"--friction {wanted}"
        raise LogError(f"{whose} has no {', '.join(given)}; of --friction, {have}")


def able(model: Model) -> bool:
    """Return whether a model has the motor that laws of friction act on."""
    return "speed_motor" in model.states and "J_m" in model.parameters


def tried_word(tried: Sequence[Tried]) -> str:
    """Return the word of the last law that was taken."""
    return next((t.name for t in reversed(tried) if t.taken), "")


@dataclass(frozen=True)
class _Bench:
    starts: Starts
    linear: Attempt
    fitted: Fitted
    free: tuple[str, ...]
    fix: tuple[str, ...]
    level: float
    given: Mapping[str, float]

    def started(self, kind: str, simple: Begun | None) -> Begun:
        """Return a law about where it fits: from the linear model's values, or a simpler law's."""
        attempt = self.attempt(kind)
        level = self.level or LEAST_LEVEL * float(np.std(self.linear.log.u))
        if kind != "coulomb":
            simple = simple or self.started("coulomb", None)
            attempt = attempt.having(simple.attempt.values(simple.fitted))
            places = [(theta_of(attempt), float(simple.fitted.z[-1]))]
        else:
            places = [(theta_of(attempt), self._lag), *self.starts.places(attempt, level)]
        rungs = self.starts.ladder(attempt, level) if kind == "coulomb" else []
        return Begun(attempt, explored(attempt, places, rungs))

    def attempt(self, kind: str) -> Attempt:
        """Return the attempt with a law."""
        linear = self.linear
        model, box = rubbing(
            linear.having(linear.values(self.fitted)).model,
            kind,
            _sizes(linear.log, linear, self.fitted),
            abs(self.level * torque_constant(linear.model)),
        )
        told = {name: value for name, value in self.given.items() if name in box.start}
        model = replace(model, nominal=dict(model.nominal) | told)
        mine = [n for n in box.start if (not self.free or n in self.free) and n not in self.fix]
        return replace(
            linear, model=model, names=(*linear.names, *mine), lower=box.lower, upper=box.upper
        )

    @staticmethod
    def from_there(simple: Begun, richer: Begun) -> Begun:
        """Return a simpler law fitted from where a richer one came to."""
        values = richer.attempt.values(richer.fitted)
        attempt = simple.attempt.having({name: values[name] for name in simple.attempt.names})
        lag = float(richer.fitted.z[-1])
        return Begun(attempt, attempt.solve(theta_of(attempt), lag, rounds=2, fine=False))

    @property
    def _lag(self) -> float:
        return float(self.fitted.z[-1])

    def compared(self, wanted: str) -> tuple[Begun | None, tuple[Tried, ...]]:
        """Return the simplest law that predicts best what is held out, None for no law at all."""
        ok = self.linear.log.ok
        without, word = held_out(ok), "none"
        begun, part = None, Begun(self.linear, self.fitted).fitted_without(without)
        tried: list[Tried] = []
        kinds = tuple(kind for kind in ORDER if self.given.keys() <= names_by(kind))
        for kind in kinds if wanted == "auto" else ORDER[:1]:
            other = self.started(kind, begun)
            if not np.isfinite(other.fitted.square):
                break  # no start could be simulated with it
            hopeful = begun is None or other.fitted.square < begun.fitted.square * HOPEFUL
            # what explains a log no better will not predict it
            other_part = other.fitted_without(without) if hopeful else other.fitted
            comparison = compare(part, other_part, without, ok)
            taken = hopeful and comparison.better
            taken &= kind == ORDER[0] or comparison.worth_it
            taken |= bool(self.given) and begun is None  # whoever gives its value says it is there
            if taken and begun is not None and word == ORDER[0]:
                # what a richer law has found may have been another place, and not its shape
                there = self.from_there(begun, other)
                if there.fitted.square < begun.fitted.square * HOPEFUL:
                    begun, part = there, there.fitted_without(without)
                    comparison = compare(part, other_part, without, ok)
                    taken = comparison.worth_it
            tried.append(Tried(kind, word, comparison, taken, hopeful))
            if taken:
                word, begun, part = kind, Begun(other.attempt, other_part), other_part
            elif kind == "coulomb":
                break
        return begun, tuple(tried)


@dataclass(frozen=True)
class Begun:
    """An attempt, and about what comes of it."""

    attempt: Attempt
    fitted: Fitted

    def fitted_without(self, without: Flags) -> Fitted:
        """Return the fit to the rest of the log."""
        return self.attempt.solve(self.fitted.z, without=without, rounds=3)

    def finished(self) -> Fitted:
        """Return the fit to all of the log."""
        return self.attempt.solve(self.fitted.z)


def theta_of(attempt: Attempt) -> Array:
    """Return the nominal values of what is identified."""
    return attempt.model.parametrize(attempt.names).theta


def _sizes(log: Log, attempt: Attempt, fitted: Fitted) -> Sizes:
    """Return how large what the axis does is, with the rate of its fastest mode."""
    model = attempt.having(attempt.values(fitted)).model
    every = model.parametrize(model.parameters)
    poles = np.linalg.eigvals(every.matrices(every.theta)[0])
    speed, torque = float(np.std(log.y[log.ok])), float(np.std(log.u[log.ok]))
    change = float(np.std(np.diff(log.u[log.ok]))) / torque / log.period
    rate = min(max(float(np.max(abs(poles))), change), 1 / log.period)
    return Sizes(abs(model.nominal.get("k_T", 1.0)) * torque, speed, rate)


assert set(ORDER) == set(CHOICES)
