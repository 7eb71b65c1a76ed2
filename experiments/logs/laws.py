"""Which law of friction a log asks for: the simplest that predicts what it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.attempt import Attempt, Log, best
from flexaxis.experiments.logs.friction import CHOICES, Sizes, rubbing
from flexaxis.experiments.logs.pieces import Comparison, compare, held_out
from flexaxis.experiments.logs.starts import Starts

LEAST_LEVEL = 0.03  # of the rms torque, of dry friction to start from
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
    """

    name: str
    against: str
    comparison: Comparison
    taken: bool


def choose(
    starts: Starts,
    linear: Attempt,
    fitted: Fitted,
    wanted: str,
    free: Sequence[str],
    fix: Sequence[str],
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
        As for `flexaxis.experiments.logs.identify.identify`.
    """
    if wanted == "none" or linear.model.laws or "speed_motor" not in linear.model.states:
        return linear, fitted, (), "as told"
    if "J_m" not in linear.model.parameters and wanted == "auto":
        return linear, fitted, (), "none"
    bench = _Bench(starts, linear, fitted, tuple(free), tuple(fix), starts.level())
    if wanted != "auto":
        attempt, found = bench.fit(wanted)
        return attempt, found, (), wanted
    return bench.compared()


@dataclass(frozen=True)
class _Bench:
    starts: Starts
    linear: Attempt
    fitted: Fitted
    free: tuple[str, ...]
    fix: tuple[str, ...]
    level: float

    def fit(self, kind: str, *, final: bool = True) -> tuple[Attempt, Fitted]:
        """Fit a law from the linear model's values, and from a response without the friction."""
        attempt = self.attempt(kind)
        level = self.level or LEAST_LEVEL * float(np.std(self.linear.log.u))
        if kind == "coulomb":
            places = [*self.starts.places(attempt, level), self._here(attempt)]
        else:
            simple, found = self.fit("coulomb", final=False)
            values = simple.values(found)
            attempt = attempt.having(values)
            places = [(attempt.model.parametrize(attempt.names).theta, float(found.z[-1]))]
        tries = [attempt.solve(theta, lag, rounds=2, fine=False) for theta, lag in places]
        first = best(tries)
        p = len(attempt.names)
        return attempt, attempt.solve(first.z[:p], float(first.z[-1]), fine=final)

    def attempt(self, kind: str) -> Attempt:
        """Return the attempt with a law."""
        linear = self.linear
        k_T = linear.model.nominal.get("k_T", 1.0)
        model, box = rubbing(
            linear.having(linear.values(self.fitted)).model,
            kind,
            _sizes(linear.log, linear, self.fitted),
            abs(self.level * k_T),
        )
        mine = [n for n in box.start if (not self.free or n in self.free) and n not in self.fix]
        return replace(
            linear, model=model, names=(*linear.names, *mine), lower=box.lower, upper=box.upper
        )

    def _here(self, attempt: Attempt) -> tuple[np.ndarray, float]:
        return attempt.model.parametrize(attempt.names).theta, float(self.fitted.z[-1])

    def compared(self) -> tuple[Attempt, Fitted, tuple[Tried, ...], str]:
        """Return the simplest law that predicts best what is held out."""
        without = held_out(self.linear.log.ok)
        word, attempt, full = "none", self.linear, self.fitted
        part = self._again(attempt, full, without)
        tried: list[Tried] = []
        for kind in ORDER:
            other, found = self.fit(kind, final=False)
            other_part = self._again(other, found, without)
            comparison = compare(part, other_part, without, self.linear.log.ok)
            tried.append(Tried(kind, word, comparison, comparison.better))
            if comparison.better:
                word, attempt, full, part = kind, other, found, other_part
            elif kind == "coulomb":
                break
        if word != "none":
            p = len(attempt.names)
            full = attempt.solve(full.z[:p], float(full.z[-1]), rounds=3)
        return attempt, full, tuple(tried), word

    @staticmethod
    def _again(attempt: Attempt, fitted: Fitted, without: np.ndarray) -> Fitted:
        p = len(attempt.names)
        return attempt.solve(
            fitted.z[:p], float(fitted.z[-1]), without=without, rounds=2, fine=False
        )


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
