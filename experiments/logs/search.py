"""Find initial values for a fit, and effects in a log that a linear model does not describe.

Initial values are computed from frequency responses of the log. Dry friction and gravity are added
if they improve the simulation of held-out pieces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.axes import BRISTLES, STATIC
from flexaxis.estimators.offline.prediction_error import inverse_of
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
)

Array = NDArray[np.float64]

FRICTION: Mapping[str, Mapping[str, str]] = {
    "coulomb": {"coulomb": "f_c"},
    "stribeck": {"coulomb": "f_c", "breakaway": "f_s", "alpha": "alpha", "beta": "beta"},
}
"""Laws of dry friction of the motor, with the name of the parameter for each role in the law."""
STIFF = 100.0  # natural frequency of the bristles that represent Coulomb friction [rad per sample]
LEVELS = 0.01, 0.07  # initial values of f_c, relative to its upper bound
LAWFUL = {
    "f_c": (0.03, 0.0, 3.0),
    "f_s": (0.05, 0.0, 5.0),
    "alpha": (10.0, 1.0, 50.0),
    "beta": (20.0, 1.0, 100.0),
}
"""Initial value, lower and upper bound of each parameter for an rms torque and rms speed of one."""
WINDOW = 0.05  # interval over which changes of momentum are compared with impulses [s]
TURN = 0.5  # minimum range of the load angle [rad], below which gravity is nearly constant
EARLY = 4.0  # maximum time by which a torque may act before it is logged [samples]
ENOUGH, STEPS, NEAR = 4000, 6, 0.5  # samples, steps and accuracy of a fit that tests initial values
RUNGS, FASTEST = 6, 1.0  # number of resonances that are tried, and the highest [rad per sample]

Place = tuple[Array, float]


@dataclass(frozen=True)
class Tried:
    """A comparison of a model with and without an additional effect.

    Attributes
    ----------
    name : str
        Name of the added effect.
    before, after : float
        Rms simulation errors in held-out pieces [rad/s], without and with the effect.
    taken : bool
        Whether the effect is included in the model.
    """

    name: str
    before: float
    after: float
    taken: bool


@dataclass
class Search:
    """The search for the model that describes a log.

    Attributes
    ----------
    setup : Setup
        Log, and the model at the beginning of the search.
    known : bool
        True if the nominal values are given or identified, False if they are a rough guess.
    friction : {"auto", "none", "coulomb", "stribeck"}
        Law of dry friction. ``"auto"`` adds a law if this law improves the simulation.
    gravity : {"auto", "none", "sine"}
        Torque of gravity. ``"auto"`` adds this torque if it improves the simulation.
    levels : mapping of str to float
        Values of parameters of the friction law. Parameters in `fix` keep these values. For all
        other parameters, the values are initial values of the fit.
    fix : tuple of str
        Parameters to hold at their nominal values.
    tried : list of Tried
        Comparisons of models with and without an additional effect.
    """

    setup: Setup
    known: bool
    friction: str = "auto"
    gravity: str = "auto"
    levels: Mapping[str, float] = field(default_factory=dict)
    fix: tuple[str, ...] = ()
    tried: list[Tried] = field(default_factory=list)

    def result(self) -> Candidate:
        """Return the fit of the best model, among the models that the options allow."""
        if not self.known:
            guess = rough_guess(self.setup.model, self._seen) if self._seen else self._rigid
            self.setup = self.setup.having({n: guess[n] for n in self.setup.names if n in guess})
        best = self._falling(self._explored(self.setup, self._first_places()))
        return self._early(self._rubbed(best))

    @cached_property
    def _rigid(self) -> dict[str, float]:
        """Rough parameters of a rigid axis from its momentum, or an empty dict for other models."""
        log, names = self.setup.log, self.setup.names
        window = max(round(WINDOW / log.period), 1)
        impulse = log.period * np.convolve(log.u, np.ones(window), "valid")
        gain = np.std(impulse) / np.std(log.y[window:] - log.y[:-window])
        k_T = abs(self.setup.model.nominal.get("k_T", 1.0))
        values = {"J_m": k_T * gain, "f_m": 0.1 * k_T * np.std(log.u) / np.std(log.y)}
        return {n: float(values[n]) for n in names} if {*names} <= {*values} else {}

    def _rubbed(self, best: Candidate) -> Candidate:
        """Add dry friction if the options require it, or if it improves the simulation."""
        kind, model = self.friction, self.setup.model
        able = "speed_motor" in model.states and "J_m" in model.parameters
        if kind in FRICTION and not (able or model.laws):
            raise LogError(
                f"--friction {kind} needs a model with a state speed_motor and a parameter J_m, "
                f"unlike {model.name}. Write a [[law]] in the TOML file, or use --friction none"
            )
        if not able or model.laws:
            return best
        setup, theta, lag = self._law(best, "coulomb")
        places = [(theta, lag)]
        for level in np.multiply(LEVELS, setup.box["f_c"][1]) if kind != "none" else ():
            started = setup.having({"f_c": self.levels.get("f_c", level)})
            places += self._places(started, level / abs(model.nominal.get("k_T", 1.0)))
        dry = self._explored(setup, places)
        if kind == "stribeck":
            return candidate(*self._law(dry, "stribeck"))
        if kind == "coulomb" or self.levels:
            return dry
        better = self._taken("dry friction", best, dry, "f_c")
        if kind == "none" or better is best or not dry.lacks:
            return best if kind == "none" else better
        return self._taken("Stribeck effect", dry, candidate(*self._law(dry, "stribeck")), "f_s")

    def _taken(self, name: str, best: Candidate, other: Candidate, *sure: str) -> Candidate:
        """Compare two candidates, add the comparison to `tried`, and return the better candidate.

        The candidate `other` is returned only if one of the parameters `sure` differs significantly
        from 0.
        """
        taken = best.better(other) and other.sure(*sure)
        self.tried.append(Tried(name, best.error, other.error, taken))
        return other if taken else best

    def _falling(self, best: Candidate) -> Candidate:
        """Add gravity if the options require it, or if it improves the simulation."""
        log, asked = self.setup.log, self.gravity == "sine"
        if not asked and (self.gravity == "none" or np.ptp(log.angle[log.ok]) < TURN):
            return best
        columns = columns_beside(log.angle)
        other = candidate(replace(best.setup, beside=columns), *_place(best))
        return other if asked else self._taken("gravity", best, other, *columns)

    def _law(self, best: Candidate, kind: str) -> tuple[Setup, Array, float]:
        """Return a setup with a friction law, and the initial parameters and delay [s]."""
        theta, lag = _place(best)
        setup = best.setup.having(dict(zip(best.setup.names, theta.tolist(), strict=True)))
        nominal, log, roles = setup.model.nominal, setup.log, dict[str, Any](FRICTION[kind])
        if kind == "coulomb":
            roles["stiffness"] = (STIFF / log.period) ** 2 * abs(nominal["J_m"])
        law = replace(STATIC if kind == "stribeck" else BRISTLES, parameters=roles)
        torque = abs(nominal.get("k_T", 1.0)) * float(np.std(log.u[log.ok]))
        unit = {"f_c": torque, "f_s": torque}
        slow = 1 / float(np.sqrt(np.mean(log.y[log.ok] ** 2)))
        sizes = {n: (np.array(LAWFUL[n]) * unit.get(n, slow)).tolist() for n in law.names}
        nominal = {n: start for n, (start, *_) in sizes.items()} | dict(nominal) | dict(self.levels)
        setup = replace(
            setup,
            model=replace(setup.model, laws=(law,), nominal=nominal),
            names=tuple(n for n in dict.fromkeys((*setup.names, *law.names)) if n not in self.fix),
            box={n: (low, high) for n, (_, low, high) in sizes.items()},
        )
        return setup, setup.start, lag

    def _early(self, best: Candidate) -> Candidate:
        """Allow a torque that acts before it is logged, if this improves the simulation."""
        fitted, setup = best.fitted, best.setup
        if setup.log.smooth or setup.delay is not None or fitted.z[-1] > setup.earliest:
            return best
        H, g = fitted.curvature
        if (inverse_of(H) @ g)[-1] > -SURE * fitted.deviations[-1]:
            return best
        setup, lags = replace(setup, early=EARLY), -setup.log.period * np.array([0.5, 1.5, 2.5])
        other = self._explored(setup, [(_place(best)[0], float(lag)) for lag in lags])
        return self._taken("a torque that acts before it is logged", best, other)

    def _first_places(self) -> list[Place]:
        """Return initial parameters and delays [s] of the linear model.

        Raises
        ------
        LogError
            If no initial values can be found.
        """
        setup = self.setup
        places = self._places(setup) + self._places(setup, floor=0.0)[:1]
        if not places:
            self._response()  # raises the LogError
        if not self.known and (seen := self._seen) is not None:
            # a log of slow motion shows no peak at the resonance, so several resonances are tried
            for resonance in np.geomspace(seen.omega[0], FASTEST / setup.log.period, RUNGS):
                rung = setup.having(rough_guess(setup.model, seen, resonance))
                if not np.array_equal(rung.start, setup.start):  # equal if no mode exists
                    places.append((rung.start, 0.0))
        return places

    @cached_property
    def _seen(self) -> Spectra | None:
        """The frequency response if the torque explains the motion, else None."""
        with suppress(LogError):
            return self._response()
        return None

    def _response(self, level: float = 0.0, floor: float = STRONG) -> Spectra:
        """Return the frequency response to the torque minus dry friction of a given level."""
        log = self.setup.log
        u = log.u - level * np.sign(log.y)
        return measured_response(u[log.ok], log.y[log.ok], period=log.period, floor=floor)

    def _places(self, setup: Setup, level: float = 0.0, floor: float = STRONG) -> list[Place]:
        """Return pairs of initial parameters and an initial delay [s]."""
        places = list[Place]()
        linear = replace(setup.model, laws=())
        own = tuple(name for name in setup.names if name in linear.parameters)
        with suppress(LogError):
            theta, late = fit_response(
                linear, self._response(level, floor), identify=own, period=setup.log.period,
                output=setup.log.output, earliest=setup.earliest,
            )  # fmt: skip
            values = dict(zip(own, theta.tolist(), strict=True))
            places.append((setup.having(values).start, late))
        if self.known:
            places.append((setup.start, 0.0))
        if self._rigid:
            places.append((setup.having(self._rigid).start, 0.0))
        return places

    def _explored(self, setup: Setup, places: Sequence[Place]) -> Candidate:
        """Fit a setup, starting at the initial values that fit a part of the log best."""
        part = setup.part(ENOUGH)
        fits = (part.solve(*place, most=STEPS, near=NEAR) for place in places)
        best = min(fits, key=lambda fitted: fitted.square)
        if not np.isfinite(best.square):
            raise LogError(
                "the log could not be simulated from any initial values. Give nominal values of "
                "the correct order of magnitude with --start NAME=VALUE"
            )
        return candidate(setup, best.z[: len(setup.names)], float(best.z[-1]))


def _place(best: Candidate) -> Place:
    """Return the parameters and the delay [s] of a fit."""
    return best.fitted.z[: len(best.setup.names)], float(best.fitted.z[-1])
