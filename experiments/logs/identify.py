"""Identify the nominal values of an axis from its log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.structure import matrices
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.findings import Finding, LogError, texts_of
from flexaxis.experiments.logs.fit import Fit, answer
from flexaxis.experiments.logs.search import FRICTION, LAWFUL, Search, Tried
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of
from flexaxis.experiments.logs.verdict import judged
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.record import Record

GIVEN = ("k_T", "r")  # torque scale and gear ratio, which no log of a single axis determines
KINDS = ("auto", "none", *FRICTION)
GRAVITY = ("auto", "none", "sine")
MOST = 500_000  # maximum number of samples in a fit


@dataclass(frozen=True)
class Identification:
    """The result of the identification of an axis from a record.

    Attributes
    ----------
    axis : Axis
        Axis with the new nominal values, laws, delay, offset, whitening filter and noise.
    answer : Fit
        Fit to the whole log, with standard deviations of all unknowns: parameters, gains of
        additional torques, initial states, offset and delay.
    estimates : DataFrame
        A column for each parameter, for each gain of an additional torque, for ``delay`` [s], and
        for ``offset`` in the unit of the torque. The rows are ``value`` and ``sd``, the standard
        deviation. The standard deviation of the delay is 0 if the delay was given, or if the delay
        is the smallest that the search allows.
    fit : float
        Fit 100 (1 − |y − ŷ|/|y − mean y|) [%] of a simulation of held-out pieces from the torque
        alone.
    friction : str
        Identified law of dry friction: ``"coulomb"``, ``"stribeck"`` or ``"none"``. If the axis
        file contains laws, the value is ``"as stated"``.
    tried : sequence of Tried
        Comparisons of models with and without an additional effect.
    findings : sequence of Finding
        Findings on the estimates.
    units : str
        Units of the parameters.
    """

    axis: Axis
    answer: Fit
    estimates: pd.DataFrame
    fit: float
    friction: str
    tried: Sequence[Tried]
    findings: Sequence[Finding]
    units: str

    @property
    def warnings(self) -> list[str]:
        """The reasons why the estimates cannot be used, one sentence per reason."""
        return texts_of(self.findings, "problem")


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
    law = FRICTION.get("coulomb" if friction == "auto" else friction)
    if levels and (axis.model.laws or not law or not levels.keys() <= {*law.names}):
        known = (*axis.model.parameters, *LAWFUL)
        hints = "".join(did_you_mean(name, known) for name in levels if name not in known)
        raise LogError(f"--friction {friction} has no parameter {', '.join(levels)}.{hints}")
    names = free_names(axis, free, fix)
    log = log_of(record, replace(axis, beside={}))
    setup = Setup(log, axis.model, names, delay or 0.0, delay is not None).part(MOST)
    if axis.known:
        _check_rate(axis.model, log.period)
    early, late = -4 * log.period, setup.latest
    if not early <= setup.delay <= late:
        raise LogError(
            f"--delay {delay:g} is not possible. The model allows only a torque that acts "
            f"{early:g} … {late:g} s after it is logged. For any other delay, shift the torque "
            "column by whole samples"
        )
    if gravity == "auto" and record.versions.get("motion") == "linear":
        gravity = "none"
    search = Search(setup, axis.known, friction, gravity, levels, tuple(fix))
    return _result(search, axis, record)


def _result(search: Search, axis: Axis, record: Record) -> Identification:
    best = search.result()
    chosen = answer(best)
    setup, fitted, found = chosen.setup, chosen.fitted, chosen.found
    names = (*setup.names, *setup.beside)
    keys, rows = (*names, "delay", "offset"), [*range(len(names)), -1, -2]
    z, sd = fitted.z[rows], chosen.deviations[rows]
    if setup.timed or found.delay <= setup.earliest:
        sd[-2] = 0.0
    _check_rate(found.model, setup.log.period)
    result = replace(
        axis,
        model=found.model,
        known=True,
        delay=found.delay,
        whitening=tuple(fitted.inverse.tolist()),
        noise=float(np.sqrt(fitted.square)),
        error=best.error,
        offset=float(z[-1]) if abs(z[-1]) > 3 * sd[-1] else 0.0,
        beside=dict(zip(setup.beside, z[len(setup.names) :].tolist(), strict=False)),
        rate=1 / setup.log.period,
        deviation=dict(zip(names, sd.tolist(), strict=False)),
    )
    friction = "as stated" if axis.model.laws else "none"
    if setup.model.laws and not axis.model.laws:
        friction = "stribeck" if "f_s" in setup.model.parameters else "coulomb"
    return Identification(
        result, chosen, pd.DataFrame([z, sd], ["value", "sd"], keys),
        100 * (1 - best.error / chosen.size), friction, search.tried,
        judged(search, best, chosen, record), units_of(record, axis.model.nominal.get("k_T")),
    )  # fmt: skip


def units_of(record: Record, k_T: float | None) -> str:
    """Return the units of the parameters, which depend on the unit of k_T."""
    unit = record.versions.get("torque_unit", "")
    if unit not in {"", "1", "A", "V"} and k_T in {None, 1.0}:  # torque in N m or N
        return "SI"
    one = f"1 {unit}" if unit not in {"", "1"} else "1"
    newton = "N" if record.versions.get("motion") == "linear" else "N m"
    text = f"SI, if a logged torque of {one} equals {k_T or 1.0:g} {newton}"
    return f"{text}; give the true value with --fix k_T=VALUE" if k_T == 1 else text


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
