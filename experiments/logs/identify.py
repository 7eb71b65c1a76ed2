"""Identify the nominal values of an axis from its log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.structure import matrices
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import changes_in
from flexaxis.experiments.logs.findings import Finding, LogError, texts_of
from flexaxis.experiments.logs.fit import Candidate, answer
from flexaxis.experiments.logs.search import FRICTION, LAWFUL, Search, Tried
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of
from flexaxis.experiments.logs.verdict import Fit, correlation, fit_of, judged
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

GIVEN = ("k_T", "r")  # torque scale and gear ratio, which no log of a single axis determines
KINDS = ("auto", "none", *FRICTION)
GRAVITY = ("auto", "none", "sine")
# maximum difference between a delay and half a sample that suggests a held torque [samples]
HELD = 0.02
MOST = 500_000  # maximum number of samples in a fit


@dataclass(frozen=True)
class Identification:
    """The result of the identification of an axis from a record.

    Attributes
    ----------
    axis : Axis
        Axis with the new nominal values, laws, delay, offset, whitening filter and noise.
    answer : Candidate
        Fit to the whole log, with standard deviations of all unknowns: parameters, gains of
        additional torques, initial states, offset and delay.
    estimates : mapping of str to (float, float)
        Value and standard deviation of each parameter, of each gain of an additional torque, of
        ``delay`` [s], and of ``offset`` in the unit of the torque. The standard deviation of the
        delay is 0 if the delay was given, or if the delay is the smallest that the search allows.
    fit : float
        Fit 100 (1 − |y − ŷ|/|y − mean y|) [%] of a simulation of held-out pieces from the torque
        alone.
    whole : Fit
        Fit of a simulation of the whole log.
    friction : str
        Identified law of dry friction: ``"coulomb"``, ``"stribeck"`` or ``"none"``. If the axis
        file contains laws, the value is ``"as stated"``.
    tried : tuple of Tried
        Comparisons of models with and without an additional effect.
    findings : tuple of Finding
        Findings on the estimates.
    torque_unit : str
        Unit of the torque in the log, or an empty string if the log does not state a unit.
    linear : bool
        Whether the axis is linear, so that the torque is a force.
    """

    axis: Axis
    answer: Candidate
    estimates: Mapping[str, tuple[float, float]]
    fit: float
    whole: Fit
    friction: str
    tried: tuple[Tried, ...]
    findings: tuple[Finding, ...]
    torque_unit: str = ""
    linear: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the identified parameters, followed by the gains of additional torques."""
        return tuple(self.estimates)[:-2]

    @property
    def theta(self) -> Array:
        """Estimates (p,) in the order of `names`."""
        return np.array([*self.estimates.values()])[:-2, 0]

    @property
    def deviations(self) -> Array:
        """Standard deviations (p,) of `theta`."""
        return np.array([*self.estimates.values()])[:-2, 1]

    @property
    def warnings(self) -> list[str]:
        """The reasons why the estimates cannot be used, one sentence per reason."""
        return texts_of(self.findings, "problem")

    @property
    def correlation(self) -> float:
        """The autocorrelation of the whitened residual at the lag with the largest magnitude."""
        return correlation(self.answer.fitted.white[self.answer.fitted.good])

    @property
    def units(self) -> str:
        """Units of the parameters, which depend on the unit of k_T."""
        unit, k_T = self.torque_unit, self.axis.model.nominal.get("k_T")
        if unit not in {"", "1", "A", "V"} and k_T in {None, 1.0}:  # torque in N m or N
            return "SI"
        one = f"1 {unit}" if unit not in {"", "1"} else "1"
        text = (
            f"SI, if a logged torque of {one} equals {k_T or 1.0:g} {'N' if self.linear else 'N m'}"
        )
        return f"{text}; give the true value with --fix k_T=VALUE" if k_T == 1 else text


def identify(
    record: Record,
    axis: Axis,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    levels: Mapping[str, float] = MappingProxyType({}),
    delay: float | None = None,
    friction: str = "auto",
    gravity: str = "auto",
) -> Identification:
    """Identify the nominal values of an axis.

    Parameters
    ----------
    record : Record
        Record of the log.
    axis : Axis
        Axis with the nominal values at which the search starts.
    free : sequence of str
        Parameters to identify. By default, these are all parameters except k_T and r. If the
        nominal values are known, parameters with the nominal value 0 are also excluded.
    fix : sequence of str
        Parameters to hold at their nominal values.
    levels : mapping of str to float
        Values of parameters of the friction law. Parameters in `fix` keep these values. For all
        other parameters, the values are initial values of the fit.
    delay : float, optional
        Known delay of the torque [s]. By default, the delay is identified.
    friction : {"auto", "none", "coulomb", "stribeck"}
        Law of dry friction of the motor. ``"auto"`` adds a law if this law improves the simulation
        of held-out pieces of the record. Laws in the axis file are kept.
    gravity : {"auto", "none", "sine"}
        Additional torque that depends on the sine and cosine of the measured angle. ``"auto"`` adds
        this torque if it improves the simulation of held-out pieces.

    Raises
    ------
    LogError
        If a name is unknown, or if the record cannot determine the model.
    """
    for option, value, known in (("friction", friction, KINDS), ("gravity", gravity, GRAVITY)):
        if value not in known:
            raise LogError(f"--{option} {value} is not one of {', '.join(known)}")
    roles = FRICTION.get("coulomb" if friction == "auto" else friction, {})
    if levels and (axis.model.laws or not levels.keys() <= {*roles.values()}):
        known = (*axis.model.parameters, *LAWFUL)
        hints = "".join(did_you_mean(name, known) for name in levels if name not in known)
        raise LogError(f"--friction {friction} has no parameter {', '.join(levels)}.{hints}")
    linear = record.versions.get("motion") == "linear"
    log = log_of(record, replace(axis, beside={}))
    whole = log.cut(log.part(MOST))
    names = free_names(axis, free, fix)
    setup = Setup(whole, axis.model, names, delay=delay)
    if axis.known:
        _check_rate(axis.model, log.period)
    early, late = -4 * log.period, setup.latest
    if delay is not None and not early <= delay <= late:
        raise LogError(
            f"--delay {delay:g} is not possible. The model allows only a torque that acts "
            f"{early:g} … {late:g} s after it is logged. For any other delay, shift the torque "
            "column by whole samples"
        )
    falls = "none" if linear and gravity == "auto" else gravity
    search = Search(setup, axis.known, friction, falls, levels, tuple(fix))
    return _result(search, axis, record, len(log.u) > MOST)


def _result(search: Search, axis: Axis, record: Record, cut: bool) -> Identification:
    best = search.result()
    taken = answer(best)
    setup, fitted, log = taken.setup, taken.fitted, taken.setup.log
    whole = fit_of(log.y, fitted.residual, setup.ok)
    fit = 100 * (1 - best.error / whole.size)
    keys = (*setup.names, *setup.beside, "delay", "offset")
    rows = [*range(len(keys) - 2), -1, -2]
    z, sd = fitted.z[rows].tolist(), taken.deviations[rows].tolist()
    *_, lag, offset = z
    if setup.delay is not None or lag <= setup.earliest:
        sd[-2] = 0.0
    values = dict(zip(keys, z, strict=True))
    estimates = dict(zip(keys, zip(z, sd, strict=True), strict=True))
    model = setup.having({n: values[n] for n in setup.names}).model
    _check_rate(model, log.period)
    result = replace(
        axis,
        model=model,
        known=True,
        delay=lag,
        whitening=tuple(fitted.inverse.tolist()),
        noise=float(np.sqrt(fitted.square)),
        error=best.error,
        offset=offset if abs(offset) > 3 * sd[-1] else 0.0,
        beside={n: values[n] for n in setup.beside},
        rate=1 / log.period,
        deviation=dict(zip(keys[:-2], sd, strict=False)),
    )
    good, size = fitted.good, np.r_[z[:-2], log.period, 1.0]
    time: Any = log.period * np.flatnonzero(good)
    J = (fitted.gradient[rows] * size[:, None])[:, good].T
    changes, _ = changes_in(time, fitted.white[good], J, keys[:-2])
    findings = judged(search, best, taken, fit, changes)
    stated = record.versions.get("torque_because") == "as stated"
    if log.smooth and not stated and abs(lag / log.period - 0.5) < HELD:
        text = (
            "the torque acts half a sample late, like a held command, although flexaxis assumes a "
            "measured current. Give --torque-is held, or confirm a current with --torque-is smooth"
        )
        findings.append(Finding("problem", text))
    if cut:
        text = f"the fit uses {MOST} of {len(record.time)} samples, with the greatest torque"
        findings.append(Finding("info", text))
    word = "as stated" if axis.model.laws else "none"
    if setup.model.laws and not axis.model.laws:
        word = "coulomb" if "f_s" not in setup.model.parameters else "stribeck"
    return Identification(
        result, taken, estimates, fit, whole, word, tuple(search.tried), tuple(findings),
        record.versions.get("torque_unit", ""),
        record.versions.get("motion") == "linear",
    )  # fmt: skip


def free_names(axis: Axis, free: Sequence[str], fix: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters to identify: those in `free`, or all that a log can determine."""
    known = axis.model.parameters
    named = [n for n in (*free, *fix) if n not in LAWFUL or n in known]
    axis.having(dict.fromkeys(named, 1.0))  # raises an error for unknown names
    usual = [n for n in known if n not in GIVEN and (not axis.known or axis.model.nominal[n])]
    chosen = [name for name in ([n for n in free if n in known] or usual) if name not in fix]
    if not chosen:
        raise LogError("all parameters are fixed. Choose a parameter to identify with --free NAME")
    return tuple(chosen)


def _check_rate(model: Model, period: float) -> None:
    """Raise a LogError if the sampling rate is too low for the fastest mode of the model."""
    fastest = float(np.max(abs(np.linalg.eigvals(matrices(model)[0]).imag))) / (2 * np.pi)
    if 2 * fastest * period > 1:
        raise LogError(
            f"a log at {1 / period:.4g} Hz cannot show a mode at {fastest:.4g} Hz. Log at a higher "
            "rate, give better initial values with --start NAME=VALUE, or use a model with fewer "
            "masses"
        )
