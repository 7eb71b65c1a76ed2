"""Where to start a fit: frequency responses of a log, several, judged by the fit itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import MODELS
from flexaxis.estimators.offline.prediction_error import Fitted
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.candidates import LINEAR, explain, inverse_values
from flexaxis.experiments.logs.identification.log import Log
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.spectra import (
    STRONG,
    Response,
    fit_response,
    measured_response,
    rough_guess,
)

Array = NDArray[np.float64]

ENOUGH = 10_000  # samples, to tell which start is the best
QUICK = 4000  # samples, to tell where not
LIKELY = 3  # places that are looked at twice: those that the frequency response tells, and found
RUNGS = 6
FASTEST = 1.0  # rad a sample, of the resonances that are tried

Place = tuple[Array, float]


@dataclass(frozen=True)
class Starts:
    """What a log offers to start from.

    Attributes
    ----------
    setup : Setup
        As the axis was given.
    known : bool
        Whether its nominal values are somebody's, and not a rough guess of their size.
    """

    setup: Setup
    known: bool

    @property
    def log(self) -> Log:
        """The log."""
        return self.setup.log

    @cached_property
    def dry(self) -> tuple[float, Array]:
        """About how much dry friction there is, in units of the torque, and its sign (N,)."""
        seen = explain(self.log, self.setup.delay or 0.0, LINEAR)
        if seen is None:
            return 0.0, np.zeros(len(self.log.u))
        return max(seen.value["dry"], 0.0), seen.motion.columns["dry"]

    def response(self, level: float = 0.0, floor: float = STRONG) -> Response:
        """Return the frequency response from the torque less some dry friction."""
        log = self.log
        u = log.u - level * self.dry[1]
        return measured_response(u[log.ok], log.y[log.ok], period=log.period, floor=floor)

    def seen_by(self, setup: Setup, fitted: Fitted) -> Response | None:
        """Return the frequency response without the dry friction that was found."""
        values = {"k_T": 1.0} | dict(setup.model.nominal) | setup.values(fitted)
        level = values.get("f_c", 0.0) if setup.model.laws else 0.0
        try:
            return self.response(level / values["k_T"])
        except LogError:
            return None

    def search(self, setup: Setup, level: float = 0.0) -> Fitted:
        """Fit from each start for two rounds."""
        first = explored(setup, self.places(setup, level), self.ladder(setup, level))
        if not np.isfinite(first.square):
            raise LogError(
                "no start could be simulated over the log: give nominal values of the right size, "
                "with --start NAME=VALUE"
            )
        return first

    def places(self, setup: Setup, level: float) -> list[Place]:
        """Return parameters and delays [s] to start from."""
        found, problems = [], []
        for floor in (STRONG, 0.0):
            try:
                seen = self.response(level, floor)
            except LogError as error:
                problems.append(error)
                continue
            found.append(self._place(setup, seen))
        if self.known:
            theta = setup.model.parametrize(setup.names).theta
            found.append((theta, 0.0))
        rigid = inverse_values(setup)
        if rigid is not None:
            found.append((rigid, 0.0))
        if not found:
            raise problems[0]
        return found

    def ladder(self, setup: Setup, level: float) -> list[Place]:
        """Return places with resonances up to the fastest that the log may show; none of a mass.

        Slow motion shows a spring below its resonance, where no peak says where to start.
        """
        if self.known or setup.model.name not in MODELS:
            return []
        try:
            seen = self.response(level)
        except LogError:
            return []
        linear = replace(setup.model, laws=())
        rungs = np.geomspace(seen.omega[0], FASTEST / self.log.period, RUNGS)
        guesses = [rough_guess(linear, seen, rung) for rung in rungs]
        if guesses[0] == guesses[-1]:
            return []
        values = [dict(setup.model.nominal) | guess for guess in guesses]
        return [(np.array([those[name] for name in setup.names]), 0.0) for those in values]

    def _place(self, setup: Setup, seen: Response) -> Place:
        names = setup.names
        linear = replace(setup.model, laws=())
        mine = tuple(name for name in names if name in linear.parameters)
        if not self.known and linear.name in MODELS:
            guess = rough_guess(linear, seen)
            values = {name: guess[name] for name in mine if name in guess}
            linear = replace(linear, nominal=dict(linear.nominal) | values)
        theta, lag = fit_response(
            linear,
            seen,
            identify=mine,
            period=self.log.period,
            output=self.log.output,
            delay=setup.delay,
            earliest=setup.earliest,
        )
        values = dict(setup.model.nominal) | dict(zip(mine, theta.tolist(), strict=True))
        return np.array([values[name] for name in names]), lag


def explored(setup: Setup, places: Sequence[Place], rungs: Sequence[Place] = ()) -> Fitted:
    """Return the best of a few rounds from each place, on a part of the log that is enough for it.

    A rich model of the noise explains what a model that is far off leaves, and little leads away
    from there, so that noise is taken for white at first; but where an axis drifts that is what
    would be explained, so that from the likeliest places it is not, too. Of rungs, which nothing
    speaks for, a short piece says which two are worth as much.
    """
    if rungs:
        quick = setup.part(QUICK)
        judged = [quick.solve(*rung, rounds=1, fine=False, plain=True).square for rung in rungs]
        places = [*places, *(rungs[i] for i in np.argsort(judged)[:2])]
    short = setup.part(ENOUGH)
    starts = [(place, setup.whiten) for place in places]
    starts += [(place, False) for place in places[:LIKELY]]
    tried = [short.solve(*place, rounds=2, fine=False, plain=plain) for place, plain in starts]
    likely = sorted(tried, key=lambda fitted: fitted.square)[:LIKELY]
    found = best([*likely, *(short.solve(at.z, rounds=2, plain=True, fine=False) for at in likely)])
    if short.log is setup.log or not np.isfinite(found.square):
        return found
    # a part has an initial state of its own, so that no more than parameters are taken from it
    theta, lag = found.z[: len(setup.names)], float(found.z[-1])
    return setup.solve(theta, lag, rounds=2, fine=False)


def best(fits: Sequence[Fitted]) -> Fitted:
    """Return the fit that predicts best."""
    return min(fits, key=lambda fitted: fitted.square)
