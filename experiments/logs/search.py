"""Where a fit starts, and what a log asks for beside its linear model.

Starts come from frequency responses of the log. Dry friction, gravity, a filter of the speed and
the like are taken where pieces that were not fitted are simulated better with them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import BRISTLES, STATIC
from flexaxis.estimators.offline.inverse import inverse_dynamics
from flexaxis.estimators.offline.prediction_error import damped_step
from flexaxis.estimators.signals import SIGNALS
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.fit import SURE, Candidate, candidate
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import columns_beside
from flexaxis.experiments.logs.spectra import (
    STRONG,
    Spectra,
    fit_response,
    measured_response,
    rough_guess,
    spectra,
)

Array = NDArray[np.float64]

FRICTION: Mapping[str, Mapping[str, str]] = {
    "coulomb": {"coulomb": "f_c"},
    "stribeck": {"coulomb": "f_c", "breakaway": "f_s", "alpha": "alpha", "beta": "beta"},
}
"""Laws of dry friction of the motor: roles, and parameters of those names."""
STIFF = 100.0  # rad a sample, at which bristles swing that stand for Coulomb's friction
LEAST_LEVEL = 0.03  # of the rms torque, of dry friction to start from
LEVEL, BREAKAWAY = 3.0, 5.0  # of the rms torque, that f_c and f_s may come to
SHAPES = {"alpha": (10.0, 1.0, 50.0), "beta": (20.0, 1.0, 100.0)}
"""Start and bounds of the shape of Stribeck's hump, over the rms speed."""
LINEAR = ("inertia", "viscous", "dry", "constant")
RIGID = {"J_m": "inertia", "f_m": "viscous", "f_c": "dry"}
GRAVITY, SIDED = {"g_sin": "sine", "g_cos": "cosine"}, {"f_sided": "sided"}
CERTAIN = 5.0  # deviations of a regressor, to be tried
TURN = 0.5  # rad of the load, below which gravity is about a constant
DRIFT = 0.5  # of the variance that a simulation leaves, that lies below the excitation
EARLY = 4.0  # samples, by which a torque is looked for before it is logged
ENOUGH, QUICK = 10_000, 4000  # samples, to tell which start is the best, and where not
LIKELY, RUNGS = 3, 6  # starts that are looked at twice, and resonances that are tried
FASTEST = 1.0  # rad a sample, of these

Place = tuple[Array, float]


@dataclass(frozen=True)
class Tried:
    """Something that was compared with less.

    Attributes
    ----------
    name : str
        In words.
    before, after : float
        Standard deviations of the error of a simulation of held-out pieces, without and with it.
    taken : bool
    """

    name: str
    before: float
    after: float
    taken: bool


@dataclass
class Search:
    """What is looked for in a log.

    Attributes
    ----------
    setup : Setup
        As the axis was stated.
    known : bool
        Whether its nominal values are somebody's, and not a rough guess of their size.
    friction : {"auto", "none", "coulomb", "stribeck"}
    gravity : {"auto", "none", "sine"}
    levels : mapping of str to float
        Values of parameters of the law of friction: starts, or what they stay at if fixed.
    fix : tuple of str
    tried : list of Tried
        What was compared so far.
    """

    setup: Setup
    known: bool
    friction: str = "auto"
    gravity: str = "auto"
    levels: Mapping[str, float] = field(default_factory=dict)
    fix: tuple[str, ...] = ()
    tried: list[Tried] = field(default_factory=list)

    def result(self) -> Candidate:
        """Return what the log asks for, or what was stated."""
        if not self.known:
            guess = self._guess()  # what is fixed stays
            self.setup = self.setup.having({n: guess[n] for n in self.setup.names if n in guess})
        best, corner = self._searched(self.setup), self._corner()
        if corner and self.setup.highpass is None and self._drifts(best, corner):
            other = self._searched(replace(self.setup, highpass=corner))
            best = self._taken(f"residuals above {corner:g} Hz only", best, other, highpass=corner)
        return self._early(best)

    def _guess(self) -> dict[str, float]:
        """Return the size of the parameters, by the frequency response or the inverse dynamics."""
        seen = self._seen
        return rough_guess(self.setup.model, seen) if seen else self._rigid_start(self.setup)

    def _rigid_start(self, setup: Setup) -> dict[str, float]:
        """Return parameters of a rigid axis by its inverse dynamics; none of any other."""
        if not self._rigid or not set(setup.names) <= RIGID.keys():
            return {}
        k_T = setup.model.nominal.get("k_T", 1.0)
        return {name: abs(k_T * self._rigid[RIGID[name]][0]) for name in setup.names}

    def _searched(self, setup: Setup) -> Candidate:
        """Return a setup with the friction and what else acts beside the torque."""
        best, kind, model = self._beside(self._fitted(setup), GRAVITY), self.friction, setup.model
        able = "speed_motor" in model.states and "J_m" in model.parameters
        if kind in FRICTION and not (able or model.laws):
            raise LogError(
                f"--friction {kind} acts on a state speed_motor by 1/J_m, which model {model.name} "
                "does not have: write its own [[law]] into the TOML, or use --friction none"
            )
        if able and not model.laws:
            dry = self._rubbing(best, "stribeck" if kind == "stribeck" else "coulomb")
            if kind in FRICTION or self.levels:
                best = dry
            else:
                better = self._taken("dry friction", best, dry, "f_c")
                best = best if kind == "none" else better
            if kind == "auto" and best is dry and best.lacks:
                best = self._taken("Stribeck's hump", best, self._rubbing(best, "stribeck"), "f_s")
        return self._beside(best, SIDED)

    def _taken(
        self,
        name: str,
        best: Candidate,
        other: Candidate,
        *sure: str,
        highpass: float | None = None,
    ) -> Candidate:
        """Return the other one where it simulates better and is sure, else the first; note it."""
        sizes = [float(np.sqrt(np.mean(c.errors(c.best, highpass)))) for c in (best, other)]
        taken = best.better(other, highpass) and other.sure(*sure)
        self.tried.append(Tried(name, sizes[0], sizes[1], taken))
        return other if taken else best

    def _corner(self) -> float | None:
        """Return the corner [Hz] of a high-pass well below the excitation, if there is room."""
        log = self.setup.log
        low, _ = spectra(log.u[log.ok], log.u[log.ok], log.period, pieces=6).band
        corner = float(f"{0.4 * low:.0e}")
        return corner if corner > 2 / (len(log.u) * log.period) else None

    def _drifts(self, best: Candidate, corner: float) -> bool:
        above, whole = (float(np.mean(best.errors(best.best, c))) for c in (corner, None))
        return above < (1 - DRIFT) * whole

    def _beside(self, best: Candidate, regressors: Mapping[str, str]) -> Candidate:
        """Return it with what acts beside the torque, where that is stated or simulates better."""
        log, asked = self.setup.log, self.gravity == "sine" and regressors is GRAVITY
        turns = self.gravity != "none" and float(np.ptp(log.angle[log.ok])) > TURN
        if not asked:
            if best.setup.highpass is not None or (regressors is GRAVITY and not turns):
                return best
            seen = self._explained(*LINEAR, "sided", *(("sine", "cosine") if turns else ()))
            pairs = [seen[name] for name in regressors.values()] if seen else []
            if all(abs(value) < CERTAIN * sd for value, sd in pairs):
                return best
        columns = columns_beside(log.angle, log.y, log.period)
        beside = dict(best.setup.beside) | {name: columns[name] for name in regressors}
        at = len(best.setup.names) + len(best.setup.beside)
        start = np.insert(best.best.z, [at] * len(regressors), 0.0)
        other = candidate(replace(best.setup, beside=beside), start)
        return other if asked else self._taken(" and ".join(regressors), best, other, *regressors)

    def _rubbing(self, best: Candidate, kind: str) -> Candidate:
        """Return it with a law of friction, from where it fits without."""
        setup, log = best.setup.having(best.setup.values(best.best)), self.setup.log
        linear, roles = replace(setup.model, laws=()), dict[str, str | float](FRICTION[kind])
        nominal = {name: setup.model.nominal[name] for name in linear.parameters}
        if kind == "coulomb":
            roles["stiffness"] = (STIFF / log.period) ** 2 * abs(nominal["J_m"])
        law = replace(STATIC if kind == "stribeck" else BRISTLES, parameters=roles)
        k_T, speed = abs(nominal.get("k_T", 1.0)), float(np.sqrt(np.mean(log.y[log.ok] ** 2)))
        torque = k_T * float(np.std(log.u[log.ok]))
        level = max(k_T * self._rigid.get("dry", (0.0, 0.0))[0], LEAST_LEVEL * torque)
        box = {"f_c": (0.0, LEVEL * torque), "f_s": (0.0, BREAKAWAY * torque)}
        start = {"f_c": level, "f_s": LEAST_LEVEL * torque}
        for name, (usual, low, high) in SHAPES.items():
            start[name], box[name] = usual / speed, (low / speed, high / speed)
        start = {name: start[name] for name in law.names} | dict(self.levels)
        names = [n for n in setup.names if n in linear.parameters and n not in law.names]
        names += [n for n in law.names if n not in self.fix]
        setup = replace(
            setup, model=replace(linear, laws=(law,), nominal=nominal | start), names=tuple(names),
            box={name: box[name] for name in law.names},
        )  # fmt: skip
        places = [(setup.start, float(best.best.z[-1])), *self._places(setup, level / k_T)]
        return self._explored(setup, places)

    @cached_property
    def _rigid(self) -> dict[str, tuple[float, float]]:
        """The inverse dynamics of the log as that of a rigid axis."""
        return self._explained(*LINEAR, delay=self.setup.delay or 0.0)

    def _explained(self, *names: str, delay: float = 0.0) -> dict[str, tuple[float, float]]:
        """Return coefficients of the inverse dynamics, with deviations; empty if little moves."""
        log = self.setup.log
        after, k = np.append(log.y[1:], log.y[-1]), np.arange(len(log.u))
        later, earlier = SIGNALS[log.output].mean_speed(log.period)
        angle = (log.angle + np.append(log.angle[1:], log.angle[-1])) / 2
        torque = np.interp(k - delay / log.period, k, log.u)
        ok = log.ok & np.append(log.ok[1:], False)
        speed = later * after + earlier * log.y
        return inverse_dynamics(torque, speed, angle, ok, log.period, names)

    def _early(self, best: Candidate) -> Candidate:
        """Return it with a torque that acts before it is logged, where the fit pulls that way."""
        fitted, setup = best.white, best.setup
        if setup.log.smooth or setup.delay is not None or fitted.z[-1] > setup.earliest:
            return best
        if damped_step(*fitted.curvature, 0.0)[-1] > -SURE * fitted.deviations[-1]:
            return best
        setup = replace(setup, early=EARLY)
        theta, lags = best.best.z[: len(setup.names)], -setup.log.period * np.array([0.5, 1.5, 2.5])
        other = self._explored(setup, [(theta, float(lag)) for lag in lags])
        return self._taken("a torque that acts before it is logged", best, other)

    def _fitted(self, setup: Setup) -> Candidate:
        places = self._places(setup, 0.0)
        if not places:
            self._response()  # raises the error
        if not self.known and (seen := self._seen) is not None:
            # slow motion shows a spring below its resonance, where no peak says where to start
            for resonance in np.geomspace(seen.omega[0], FASTEST / setup.log.period, RUNGS):
                rung = setup.having(rough_guess(setup.model, seen, resonance))
                if not np.array_equal(rung.start, setup.start):  # an axis without a resonance
                    places.append((rung.start, 0.0))
        return self._explored(setup, places)

    @cached_property
    def _seen(self) -> Spectra | None:
        """The frequency response, where the torque explains the motion."""
        with suppress(LogError):
            return self._response()
        return None

    def _response(self, level: float = 0.0, floor: float = STRONG) -> Spectra:
        """Return the frequency response from the torque less some dry friction."""
        log = self.setup.log
        u = log.u - level * np.sign(log.y)
        return measured_response(u[log.ok], log.y[log.ok], period=log.period, floor=floor)

    def _places(self, setup: Setup, level: float) -> list[Place]:
        """Return parameters and delays [s] to start from."""
        places = list[Place]()
        linear = replace(setup.model, laws=())
        own = tuple(name for name in setup.names if name in linear.parameters)
        for floor in (STRONG, 0.0):
            with suppress(LogError):
                theta, lag = fit_response(
                    linear, self._response(level, floor), identify=own, period=setup.log.period,
                    output=setup.log.output, earliest=setup.earliest,
                )  # fmt: skip
                values = dict(zip(own, theta.tolist(), strict=True))
                places.append((setup.having(values).start, lag))
        if self.known:
            places.append((setup.start, 0.0))
        if rigid := self._rigid_start(setup):
            places.append((setup.having(rigid).start, 0.0))
        return places

    def _explored(self, setup: Setup, places: Sequence[Place]) -> Candidate:
        """Return a setup fitted from the best of some places, on parts of the log that are enough.

        A rich model of the noise explains what a model that is far off leaves, and little leads
        away from there, so that noise is taken for white at first; where an axis drifts, that is
        what parameters would explain.
        """
        quick, short = setup.part(QUICK), setup.part(ENOUGH)
        likely = sorted(
            (quick.solve(*at, rounds=1, search=True, plain=True).square, i)
            for i, at in enumerate(places)
        )
        fits = [
            short.solve(*places[i], rounds=2, search=True, plain=plain)
            for _, i in likely[:LIKELY]
            for plain in (setup.whiten, False)
        ]
        best = min(fits, key=lambda fitted: fitted.square)
        if not np.isfinite(best.square):
            raise LogError(
                "no start could be simulated over the log: give nominal values of the right size, "
                "with --start NAME=VALUE"
            )
        if len(short.log.u) < len(setup.log.u):  # a part has an initial state of its own
            theta, lag = best.z[: len(setup.names)], float(best.z[-1])
            best = setup.solve(theta, lag, rounds=2, search=True)
        return candidate(setup, best.z)
