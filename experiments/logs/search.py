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
from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.inverse import Inverse
from flexaxis.estimators.offline.prediction_error import Fitted, damped_step
from flexaxis.estimators.offline.sizes import motion
from flexaxis.estimators.offline.structure import guessed, prior
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.fit import SURE, Candidate, candidate, explain
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
LINEAR = ("inertia", "viscous", "dry", "constant")
RIGID = {"J_m": "inertia", "f_m": "viscous", "f_c": "dry"}
GRAVITY, SIDED = ("g_sin", "g_cos"), ("f_sided",)
CERTAIN, MOVES = 5.0, 0.01  # deviations of a regressor, and part of the torque, to be tried
TURN = 0.5  # rad of the load, below which gravity is about a constant
DRIFT = 0.5  # of the variance that a simulation leaves, that lies below the excitation
EARLY = 4.0  # samples, by which a torque is looked for before it is logged
FILTERED = 0.5  # samples of delay, from which on a speed may be filtered
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
    given : mapping of str to float
        Values of parameters of the law of friction: starts, or what they stay at if fixed.
    fix : tuple of str
    tried : list of Tried
        What was compared so far.
    """

    setup: Setup
    known: bool
    friction: str = "auto"
    gravity: str = "auto"
    given: Mapping[str, float] = field(default_factory=dict)
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
        return self._filtered(self._early(best))

    def _guess(self) -> dict[str, float]:
        """Return the size of the parameters, by the frequency response or the inverse dynamics."""
        if self._seen is not None:
            return rough_guess(self.setup.model, self._seen)
        rigid = self._rigid
        known = rigid is not None and set(self.setup.names) <= RIGID.keys()
        return {n: abs(rigid.value[RIGID[n]]) for n in self.setup.names} if rigid and known else {}

    def _searched(self, setup: Setup) -> Candidate:
        """Return a setup with the friction and what else acts beside the torque."""
        best, kind = self._beside(self._fitted(setup), GRAVITY, "sine", "cosine"), self.friction
        model = setup.model
        able = "speed_motor" in model.states and "J_m" in model.parameters
        if kind in FRICTION and not (able or model.laws):
            raise LogError(
                f"--friction {kind} acts on a state speed_motor by 1/J_m, which model {model.name} "
                "does not have: write its own [[law]] into the TOML, or use --friction none"
            )
        if able and not model.laws:
            dry = self._rubbing(best, "stribeck" if kind == "stribeck" else "coulomb")
            if kind in FRICTION or self.given:
                best = dry
            else:
                better = self._taken("dry friction", best, dry, "f_c")
                best = best if kind == "none" else better
            if kind == "auto" and best is dry and best.lacks:
                best = self._taken("Stribeck's hump", best, self._rubbing(best, "stribeck"), "f_s")
        return self._beside(best, SIDED, "sided")

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
        self.tried.append(Tried(name, *sizes, taken))  # type: ignore[arg-type, call-arg]
        return other if taken else best

    def _corner(self) -> float | None:
        """Return the corner [Hz] of a high-pass well below the excitation, if there is room."""
        log = self.setup.log
        low, _ = spectra(log.u[log.ok], log.u[log.ok], log.period, pieces=6).band
        corner = float(f"{0.4 * low:.0e}")
        return corner if corner > 2 / (len(log.u) * log.period) else None

    def _drifts(self, best: Candidate, corner: float) -> bool:
        above, all_of = (float(np.mean(best.errors(best.best, c))) for c in (corner, None))
        return above < (1 - DRIFT) * all_of

    def _beside(self, best: Candidate, names: Sequence[str], *regressors: str) -> Candidate:
        """Return it with what acts beside the torque, where that is stated or simulates better."""
        log, asked = self.setup.log, self.gravity == "sine" and names is GRAVITY
        turns = self.gravity != "none" and float(np.ptp(log.angle[log.ok])) > TURN
        if not asked:
            if best.setup.highpass is not None or (names is GRAVITY and not turns):
                return best
            more = ("sine", "cosine") if turns else ()
            seen = explain(log, 0.0, (*LINEAR, "sided", *more))
            if seen is None or max(map(seen.sure, regressors)) < CERTAIN:
                return best
            if seen.gain(regressors) < MOVES:
                return best
        columns = columns_beside(log.angle, log.y, log.period)
        setup = replace(
            best.setup,
            beside=best.setup.beside | {name: columns[name] for name in names},  # type: ignore[operator]
        )
        at = len(setup.names) + len(best.setup.beside)
        other = candidate(setup, np.insert(best.best.z, [at] * len(names), 0.0))
        return other if asked else self._taken(" and ".join(names), best, other, *names)

    def _rubbing(self, best: Candidate, kind: str) -> Candidate:
        """Return it with a law of friction, from where it fits without."""
        setup, lag = best.setup.having(best.setup.values(best.best)), float(best.best.z[-1])
        model, log, roles = setup.model, setup.log, dict[str, str | float](FRICTION[kind])
        linear = replace(model, laws=())
        model = replace(linear, nominal={n: model.nominal[n] for n in linear.parameters})
        if kind == "coulomb":
            roles["stiffness"] = (STIFF / log.period) ** 2 * abs(model.nominal["J_m"])
        law = replace(STATIC if kind == "stribeck" else BRISTLES, parameters=roles)
        moves = motion(log.u[log.ok], log.y[log.ok], log.period)
        nominal = dict(model.nominal) | dict.fromkeys(law.names, 1.0)
        model = guessed(
            replace(model, laws=(law,), nominal=nominal), model.parameters,
            period=log.period, motion=moves,
        )  # fmt: skip
        k_T = model.nominal.get("k_T", 1.0)
        dry = 0.0 if self._rigid is None else self._rigid.value["dry"]
        level = abs(k_T) * max(dry, LEAST_LEVEL * float(np.std(log.u[log.ok])))
        model = replace(model, nominal=dict(model.nominal) | {"f_c": level} | dict(self.given))
        thought = prior(model, law.names, period=log.period, motion=moves)
        box = {
            name: (0.0 if name == "f_c" else low, high)
            for name, low, high in zip(law.names, thought.lower, thought.upper, strict=True)
        }
        own = tuple(name for name in law.names if name not in self.fix)
        names = (*(n for n in setup.names if n in model.parameters and n not in law.names), *own)
        setup = replace(setup, model=model, names=names, box=box)
        places = [(model.parametrize(names).theta, lag), *self._places(setup, level / k_T)]
        return candidate(setup, self._explored(setup, places).z)

    @cached_property
    def _rigid(self) -> Inverse | None:
        """The inverse dynamics of the log as that of a rigid axis."""
        return explain(self.setup.log, self.setup.delay or 0.0, LINEAR)

    def _early(self, best: Candidate) -> Candidate:
        """Return it with a torque that acts before it is logged, where the fit pulls that way."""
        fitted, setup = best.white, best.setup
        if setup.log.smooth or setup.delay is not None or fitted.z[-1] > setup.earliest:
            return best
        J = fitted.gradient[:, fitted.good]
        pull = damped_step(J @ J.T, J @ fitted.white[fitted.good], 0.0)[-1]
        if pull > -SURE * fitted.deviations[-1]:
            return best
        setup = replace(setup, early=EARLY)
        places = [(best.best.z[: len(setup.names)], -k * setup.log.period) for k in (0.5, 1.5, 2.5)]
        other = candidate(setup, self._explored(setup, places).z)
        return self._taken("a torque that acts before it is logged", best, other)

    def _filtered(self, best: Candidate) -> Candidate:
        """Return it with a speed behind a low-pass, where delay and errors look like one."""
        setup, late = best.setup, float(best.best.z[-1])
        one = setup.log.output == "speed" and setup.model.C.count("1") == 1
        if not one or not best.lacks or late < FILTERED * setup.log.period:
            return best
        model = behind_lowpass(setup.having(setup.values(best.best)).model, late)
        setup = replace(setup, model=model, names=(*setup.names, "tau_y"))
        place = model.parametrize(setup.names).theta, 0.0
        other = candidate(setup, self._explored(setup, [place]).z)
        return self._taken("a speed behind a low-pass", best, other, "tau_y")

    def _fitted(self, setup: Setup) -> Candidate:
        places = self._places(setup, 0.0)
        if not places:
            self._response()  # raises the error
        if not self.known and (seen := self._seen) is not None:
            # slow motion shows a spring below its resonance, where no peak says where to start
            rungs = np.geomspace(seen.omega[0], FASTEST / setup.log.period, RUNGS)
            guesses = [setup.having(rough_guess(setup.model, seen, rung)) for rung in rungs]
            starts = [(one.model.parametrize(setup.names).theta, 0.0) for one in guesses]
            if not np.array_equal(starts[0][0], starts[-1][0]):
                quick = setup.part(QUICK)
                left = [quick.solve(*at, rounds=1, search=True, plain=True).square for at in starts]
                places += [starts[i] for i in np.argsort(left)[:2]]
        return candidate(setup, self._explored(setup, places).z)

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
            try:
                theta, lag = fit_response(
                    linear, self._response(level, floor), identify=own, period=setup.log.period,
                    output=setup.log.output, delay=setup.delay, earliest=setup.earliest,
                )  # fmt: skip
            except LogError:
                continue
            values = dict(setup.model.nominal) | dict(zip(own, theta.tolist(), strict=True))
            places.append((np.array([values[name] for name in setup.names]), lag))
        if self.known:
            places.append((setup.model.parametrize(setup.names).theta, 0.0))
        rigid = self._rigid
        if rigid is not None and set(setup.names) <= RIGID.keys():
            values = [rigid.value[RIGID[name]] for name in setup.names]  # type: ignore[assignment]
            places.append((np.array(values) * setup.model.nominal.get("k_T", 1.0), 0.0))
        return places

    def _explored(self, setup: Setup, places: Sequence[Place]) -> Fitted:
        """Return the best of a few rounds from each place, on a part of the log that is enough.

        A rich model of the noise explains what a model that is far off leaves, and little leads
        away from there, so that noise is taken for white at first.
        """
        short = setup.part(ENOUGH)
        tried = [
            short.solve(*place, rounds=2, search=True, plain=plain)
            for plain in (setup.whiten, False)
            for place in (places if plain else places[:LIKELY])
        ]
        likely = sorted(tried, key=lambda fitted: fitted.square)[:LIKELY]
        again = [short.solve(one.z, rounds=2, plain=True, search=True) for one in likely]
        best = min([*likely, *again], key=lambda fitted: fitted.square)
        if not np.isfinite(best.square):
            raise LogError(
                "no start could be simulated over the log: give nominal values of the right size, "
                "with --start NAME=VALUE"
            )
        if len(short.log.u) == len(setup.log.u):
            return best
        # a part has an initial state of its own, so that no more than parameters are taken from it
        return setup.solve(best.z[: len(setup.names)], float(best.z[-1]), rounds=2, search=True)


def behind_lowpass(model: Model, tau: float) -> Model:
    """Return a model whose speed is read behind a first-order low-pass.

    Examples
    --------
    >>> from flexaxis.estimators.models.axes import one_mass
    >>> behind_lowpass(one_mass({"k_T": 1.0, "J_m": 1e-3, "f_m": 0.01}), 0.005).A[1]
    ('1/tau_y', '-1/tau_y')
    """
    own = tuple("1/tau_y" if entry == "1" else "0" for entry in model.C)
    return replace(
        model,
        name=f"{model.name}, filtered speed",
        states=(*model.states, "speed_filtered"),
        A=(*((*row, "0") for row in model.A), (*own, "-1/tau_y")),
        B=(*model.B, "0"),
        C=(*("0" for _ in own), "1"),
        nominal=dict(model.nominal) | {"tau_y": tau},
        positive=(*model.positive, "tau_y"),
    )
