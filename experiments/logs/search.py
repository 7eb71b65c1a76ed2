"""Find nonlinear effects in a log, such as dry friction, and initial values for a fit.

Initial values are computed from frequency responses of the log. Dry friction and gravity are added
to the model if they improve the simulation of held-out pieces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from flexaxis.estimators.models.axis_models import BRISTLES, STATIC
from flexaxis.estimators.models.laws import Law
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.fit import Fit, Setup, candidate
from flexaxis.experiments.logs.signals import columns_beside
from flexaxis.experiments.logs.spectra import STRONG, fit_response, measured_response, rough_guess

FRICTION: Mapping[str, Law] = {
    "coulomb": replace(BRISTLES, parameters={"coulomb": "f_c", "stiffness": 1.0}),
    "stribeck": STATIC,
}
"""Laws of dry friction of the motor. The stiffness of the bristles depends on the log."""
REACH = 1e3  # factor between the initial value and both bounds of a parameter of a linear model
STIFF = 100.0  # natural frequency of the bristles that represent Coulomb friction [rad per sample]
LEVELS = 0.01, 0.07  # initial values of f_c, relative to its upper bound
LAWFUL = {
    "f_c": (0.03, 0.0, 3.0),
    "f_s": (0.05, 0.0, 5.0),
    "alpha": (10.0, 1.0, 50.0),
    "beta": (20.0, 1.0, 100.0),
}
"""Initial value, lower and upper bound of friction-law parameters at unit rms torque and speed."""
WINDOW = 0.05  # interval over which changes of momentum are compared with impulses [s]
SURE = 3.0  # minimum distance of a significant parameter from 0, in standard deviations
TURN = 0.5  # minimum range of the load angle [rad], below which gravity is nearly constant
EARLY = 4.0  # maximum time by which a torque may act before it is logged [samples]
ENOUGH, STEPS, NEAR = 4000, 6, 0.5  # samples, steps and accuracy of a fit that tests initial values
RUNGS, FASTEST = 6, 1.0  # number of resonances that are tried, and the highest [rad per sample]


@dataclass
class Search:
    """The search for the model that describes a log best.

    Attributes
    ----------
    setup : Setup
        Log, and the model at the beginning of the search.
    known : bool
        True if the nominal values are given or identified. False if they are a rough guess.
    friction : {"auto", "none", "coulomb", "stribeck"}
        Law of dry friction. ``"auto"`` adds a law if it improves the simulation.
    gravity : {"auto", "none", "sine"}
        Gravity torque. ``"auto"`` adds this torque if it improves the simulation.
    levels : mapping of str to float
        Values of the friction-law parameters. Parameters in `fix` keep these values. For all
        other parameters, the values are initial values of the fit.
    fix : sequence of str
        Parameters to hold at their nominal values.
    tried : dict of str to (bool, float, float)
        Comparisons of models with and without an additional effect. The keys are the names of the
        effects. The first entry of each value is True if the effect was added. The other entries
        are the rms simulation errors in held-out pieces [rad/s], without and with the effect.
    """

    setup: Setup
    known: bool
    friction: str
    gravity: str
    levels: Mapping[str, float]
    fix: Sequence[str]
    tried: dict[str, tuple[bool, float, float]] = field(default_factory=dict)

    def result(self) -> Fit:
        """Return the fit of the best model that the options allow."""
        setups = [self.setup] if self.known else self._guesses()
        model, box = setups[0].model, dict[str, tuple[float, float]]()
        for name in self.setup.names:
            low, high = sorted((model.nominal[name] / REACH, model.nominal[name] * REACH))
            box[name] = (0.0, np.inf) if name in model.law_parameters else (low, high)
        setups = [replace(one, box=box) for one in setups]
        best = self._explored([*setups, *self._responses(setups[0])])
        return self._early(self._rubbed(self._falling(best)))

    def _guesses(self) -> list[Setup]:
        """Return setups that start at rough guesses of the parameters.

        If the motion is slow, the frequency response has no peak at the resonance. Therefore, each
        setup assumes a different resonance frequency.

        Raises
        ------
        LogError
            If the torque and the motion are coherent at too few frequencies.
        """
        setup, period = self.setup, self.setup.log.period
        try:
            seen = measured_response(setup.log)
        except LogError:
            if {*setup.names} <= {"J_m", "f_m"}:
                return [setup.having(self._rigid())]
            raise
        peaks = [None, *np.geomspace(seen.omega[0], FASTEST / period, RUNGS).tolist()]
        return [setup.having(rough_guess(setup.model, seen, peak)) for peak in peaks]

    def _rigid(self) -> dict[str, float]:
        """Return rough parameters of a rigid axis, computed from changes in its momentum."""
        log = self.setup.log
        window = max(round(WINDOW / log.period), 1)
        impulse = log.period * np.convolve(log.u, np.ones(window), "valid")
        k_T = abs(self.setup.model.nominal.get("k_T", 1.0))
        gain = np.std(impulse) / np.std(log.y[window:] - log.y[:-window])
        damping = 0.1 * k_T * np.std(log.u) / np.std(log.y)
        return {"J_m": float(k_T * gain), "f_m": float(damping)}

    def _rubbed(self, best: Fit) -> Fit:
        """Add dry friction if the options require it, or if it improves the simulation."""
        kind, model = self.friction, self.setup.model
        able = "speed_motor" in model.states and "J_m" in model.parameters
        if kind in FRICTION and not (able or model.laws):
            raise LogError(
                f"--friction {kind} needs a model with the state speed_motor and the parameter "
                f"J_m, but {model.name} lacks at least one of them. Write a [[law]] in the TOML "
                "file, or use --friction none"
            )
        if not able or model.laws:
            return best
        setup = self._law(best, "coulomb")
        setups, k_T = [setup], abs(model.nominal.get("k_T", 1.0))
        for level in np.multiply(LEVELS, setup.box["f_c"][1]).tolist():
            started = setup.having({"f_c": self.levels.get("f_c", level)})
            setups += [started, *self._responses(started, level / k_T)]
        dry = self._explored(setups)
        if kind == "stribeck":
            return candidate(self._law(dry, kind))
        if kind == "coulomb" or self.levels:
            return dry
        better = self._taken("dry friction", best, dry, "f_c")
        if kind == "none":
            return best
        if better is dry and dry.lacks:
            other = candidate(self._law(dry, "stribeck"))
            return self._taken("Stribeck effect", dry, other, "f_s")
        return better

    def _taken(self, name: str, best: Fit, other: Fit, *sure: str) -> Fit:
        """Compare two fits, append the comparison to `tried`, and return the better fit.

        If `sure` contains parameter names, the fit `other` is returned only if one of these
        parameters differs significantly from 0.
        """
        pairs = (other.estimates[one] for one in sure if one in other.estimates)
        clear = not sure or any(abs(value) > SURE * sd for value, sd in pairs)
        taken = clear and best.better(other)
        self.tried[name] = taken, best.error, other.error
        return other if taken else best

    def _falling(self, best: Fit) -> Fit:
        """Add gravity if the options require it, or if it improves the simulation."""
        log, asked = self.setup.log, self.gravity == "sine"
        if not asked and (self.gravity == "none" or np.ptp(log.angle[log.ok]) < TURN):
            return best
        columns = columns_beside(log.angle)
        other = candidate(replace(best.found, beside=columns))
        return other if asked else self._taken("gravity", best, other, *columns)

    def _law(self, best: Fit, kind: str) -> Setup:
        """Return a setup that has a friction law and starts at the estimates of a fit."""
        setup, law = best.found, FRICTION[kind]
        nominal, log = setup.model.nominal, setup.log
        if kind == "coulomb":
            stiffness = (STIFF / log.period) ** 2 * abs(nominal["J_m"])
            law = replace(law, parameters={"coulomb": "f_c", "stiffness": stiffness})
        torque = abs(nominal.get("k_T", 1.0)) * float(np.std(log.u[log.ok]))
        slow = 1 / float(np.sqrt(np.mean(log.y[log.ok] ** 2)))
        sizes = {n: np.multiply(LAWFUL[n], torque if n[0] == "f" else slow) for n in law.names}
        nominal = {n: float(size[0]) for n, size in sizes.items()} | dict(nominal)
        names = dict.fromkeys((*setup.names, *law.names))
        return replace(
            setup,
            model=replace(setup.model, laws=(law,), nominal=nominal | dict(self.levels)),
            names=tuple(name for name in names if name not in self.fix),
            box={**setup.box} | {n: (size[1], size[2]) for n, size in sizes.items()},
        )

    def _early(self, best: Fit) -> Fit:
        """Allow a negative torque delay if it improves the simulation."""
        setup = best.found
        if setup.log.smooth or setup.timed or setup.delay > setup.earliest:
            return best
        lags = (-setup.log.period * np.array([0.5, 1.5, 2.5])).tolist()
        other = self._explored([replace(setup, early=EARLY, delay=lag) for lag in lags])
        return self._taken("a torque that acts before it is logged", best, other)

    def _responses(self, setup: Setup, level: float = 0.0) -> list[Setup]:
        """Return setups that start at parameters fitted to the measured frequency response."""
        setups = list[Setup]()
        for floor in (STRONG, 0.0):
            # least_squares raises a ValueError if the frequency response is not finite
            with suppress(LogError, ValueError):
                response = measured_response(setup.log, level, floor)
                setups.append(fit_response(setup, response))
        return setups

    def _explored(self, setups: Sequence[Setup]) -> Fit:
        """Fit part of the log from each setup, and then the log from the best of these fits."""
        fits = (Fit(setup, setup.part(ENOUGH).solve(most=STEPS, near=NEAR)) for setup in setups)
        best = min(fits, key=lambda one: one.fitted.square)
        if not np.isfinite(best.fitted.square):
            raise LogError(
                "the simulation of the log failed for all initial values. Give nominal values of "
                "the correct order of magnitude with --start NAME=VALUE"
            )
        return candidate(best.found)
