"""Nominal values of an axis from its log: three fits of what the log asks for, and one answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.inverse import Inverse
from flexaxis.experiments.logs.axis_file import Axis, is_smooth
from flexaxis.experiments.logs.doubts.torque_kind import UNSEEN
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.findings import Finding, texts_of
from flexaxis.experiments.logs.identification.candidates import (
    LINEAR,
    Candidate,
    answer,
    candidates_of,
    explain,
)
from flexaxis.experiments.logs.identification.friction import KINDS, Asked, linear_part
from flexaxis.experiments.logs.identification.laws import Chosen, Tried, check_given, chosen
from flexaxis.experiments.logs.identification.log import log_of
from flexaxis.experiments.logs.identification.setup import Setup
from flexaxis.experiments.logs.identification.starts import Starts
from flexaxis.experiments.logs.identification.validate import Fit, correlation, fit_of
from flexaxis.experiments.logs.identification.verdict import judged
from flexaxis.experiments.logs.spectra import Response
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

GIVEN = ("k_T", "r")  # scale of the torque and gear ratio: no log of one axis determines them
LARGEST = 1e30  # of a parameter in SI units, and its reciprocal: powers of it can be computed with
LOWEST = 1e-6  # corner of a high-pass over the rate: that of a log of 1e6 samples
FRICTION = ("auto", "none", *KINDS)
GRAVITY = ("auto", "none", "sine")
LAWFUL = tuple(dict.fromkeys(n for names in KINDS.values() for n in names.values()))
"""Parameters that may come by --friction."""


@dataclass(frozen=True)
class Identification:
    """What was identified from a record, and how far it can be trusted.

    Attributes
    ----------
    axis : Axis
        With the new nominal values, laws, delay, offset, whitening filter and noise.
    sd : ndarray (q,)
        Standard deviations of all unknowns of the fit that was taken, widened to what fits differ
        by: parameters, gains of what acts beside the torque, the state, the offset and the delay.
    candidates : tuple of Candidate
        All fits, the one that simulates best first.
    best : Candidate
        That was taken.
    fit : float
        100 (1 − |y − ŷ|/|y − mean y|) of a simulation of pieces that it was not fitted to, from the
        torque alone.
    whole : Fit
        Of a simulation of the whole log.
    response : Response or None
        What the log shows without a model, but for the dry friction that was found; None where it
        was not asked.
    map : Inverse or None
        The inverse dynamics of the log, as if it were rigid.
    friction : str
        The word for its laws, ``"none"`` if it has none.
    tried : tuple of Tried
        What else was tried, and how it simulates.
    findings : tuple of Finding
    torque_unit : str
        As the log has it; empty where nobody said it.
    linear : bool
        Whether the axis goes straight, and its torque is a force.
    """

    axis: Axis
    sd: Array
    candidates: tuple[Candidate, ...]
    best: Candidate
    fit: float
    whole: Fit
    response: Response | None
    map: Inverse | None
    friction: str
    tried: tuple[Tried, ...]
    findings: tuple[Finding, ...]
    torque_unit: str = ""
    linear: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """The identified parameters, then the gains of what acts beside the torque."""
        return self.best.names

    @property
    def theta(self) -> Array:
        """Their estimates (p,)."""
        return self.best.fitted.z[: len(self.names)]

    @property
    def deviations(self) -> Array:
        """Their standard deviations (p,)."""
        return self.sd[: len(self.names)]

    @property
    def estimates(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation by name, with ``delay`` [s] and ``offset``.

        The offset is in the unit of the torque. The deviation of a delay is 0 if it was given, or
        came to the least that is possible.
        """
        z, sd = self.best.fitted.z.tolist(), self.sd.tolist()
        found = dict(zip(self.names, zip(z, sd, strict=True), strict=False))
        told = self.best.setup.delay is not None or z[-1] <= self.best.setup.earliest
        return found | {"delay": (z[-1], 0.0 if told else sd[-1]), "offset": (z[-2], sd[-2])}

    @property
    def warnings(self) -> list[str]:
        """What makes its numbers useless, in words."""
        return texts_of(self.findings, "problem")

    @property
    def residual(self) -> Array:
        """Y − ŷ (N,) of the simulation."""
        return self.best.fitted.residual

    @property
    def correlation(self) -> float:
        """Largest correlation of the white residual with its past."""
        return correlation(self.best.fitted.white[self.best.fitted.good])


def identify(
    record: Record,
    axis: Axis,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    given: Mapping[str, float] = MappingProxyType({}),
    delay: float | None = None,
    friction: str = "auto",
    gravity: str = "auto",
    highpass: float | None = None,
) -> Identification:
    """Identify the nominal values of an axis.

    Parameters
    ----------
    record : Record
    axis : Axis
        Its nominal values are where the search starts.
    free : sequence of str
        Parameters to identify; by default all but k_T and r, and those that a known axis has at 0.
    fix : sequence of str
        Parameters to leave at their nominal values.
    given : mapping of str to float
        Values of parameters of the law that `friction` brings: where they start, and stay if fixed.
    delay : float, optional
        Known delay of the torque [s]; it is identified too if not given.
    friction : {"auto", "none", "coulomb", "lugre", "static"}
        Law of dry friction of the motor; ``"auto"`` takes Coulomb's where held-out pieces of the
        record are simulated better with it. Laws that the axis has already are kept.
    gravity : {"auto", "none", "sine"}
        Whether a torque by sine and cosine of the measured angle acts besides.
    highpass : float, optional
        Corner [Hz] below which residuals do not count; that of the axis by default.

    Raises
    ------
    LogError
        If a name is unknown, or the record cannot determine such a model.
    """
    for option, value, known in (("friction", friction, FRICTION), ("gravity", gravity, GRAVITY)):
        if value not in known:
            raise LogError(f"--{option} {value}: it is one of {', '.join(known)}")
    corner = axis.highpass if highpass is None else highpass
    told = UNSEEN not in record.versions.get("torque_because", "")
    linear = record.versions.get("motion") == "linear" and gravity == "auto"
    falls = "none" if linear else gravity
    asked = Asked(friction, falls, tuple(free), tuple(fix), given, corner, told)
    check_given(axis.model, asked)
    _check_sizes({**axis.model.nominal, **given})
    log = log_of(record, replace(axis, beside={}))
    names = _free(axis, free, fix)
    if axis.known:
        check_rate(axis.model, log.period)
    if corner is not None and not LOWEST < corner * log.period < 0.5:
        raise LogError(
            f"--highpass {corner:g} Hz: give a corner below half the rate, {0.5 / log.period:g} "
            f"Hz, and not below {LOWEST / log.period:g} Hz"
        )
    setup = Setup(log, axis.model, names, delay=delay, highpass=corner)
    _check_delay(setup)
    starts = Starts(setup, known=axis.known)
    found = _found(starts, axis, asked, chosen(starts, asked), record)
    _check_ended(found.axis.model, log.period)
    return found


def _found(
    starts: Starts, axis: Axis, asked: Asked, taken: Chosen, record: Record
) -> Identification:
    candidates = candidates_of(taken.setup, taken.parts, taken.held)
    if not candidates or not np.isfinite(candidates[0].error):
        raise LogError(
            "no start could be simulated over the log: give nominal values of the right size, "
            "with --start NAME=VALUE"
        )
    best, deviations = answer(candidates)
    setup, fitted, log = best.setup, best.fitted, best.setup.log
    whole = fit_of(log.y, fitted.residual, setup.counted, fitted.colour)
    fit = 100 * (1 - best.error / whole.size)
    values, lag = dict(zip(best.names, fitted.z.tolist(), strict=False)), float(fitted.z[-1])
    found = replace(
        axis,
        model=setup.having({n: values[n] for n in setup.names}).model,
        known=True,
        delay=lag,
        whitening=tuple(fitted.colour.inverse.tolist()),
        noise=float(np.sqrt(fitted.square)),
        error=best.error,
        offset=float(fitted.z[-2]) if abs(fitted.z[-2]) > 3 * deviations[-2] else 0.0,
        beside={n: values[n] for n in setup.beside},
        highpass=setup.highpass,
        rate=1 / log.period,
        torque_is="smooth" if log.smooth and not is_smooth(record) else axis.torque_is,
        deviation=dict(zip(best.names, deviations.tolist(), strict=False)),
    )
    return Identification(
        found,
        deviations,
        tuple(candidates),
        best,
        fit,
        whole,
        response=starts.seen_by(setup, fitted),
        map=explain(log, lag, LINEAR),
        friction=_word(asked.friction, axis.model, bool(setup.model.laws)),
        tried=taken.tried,
        findings=tuple(
            judged(taken, best, deviations, candidates=candidates, fit=fit, asked=asked)
        ),
        torque_unit=record.versions.get("torque_unit", ""),
        linear=record.versions.get("motion") == "linear",
    )


def _word(friction: str, model: Model, law: bool) -> str:
    if model.laws:
        return "as told"
    return friction if friction in KINDS else "coulomb" if law else "none"


def _check_delay(setup: Setup) -> None:
    """Refuse a given delay that is none of those that are looked for."""
    delay, least, most = setup.delay, setup.earliest, setup.latest
    if delay is not None and not least <= delay <= most:
        raise LogError(
            f"--delay {delay:g}: the torque of this log acts {least:g} … {most:g} s after it is "
            "logged; shift its column by whole samples if it is further off"
        )


def _check_sizes(values: Mapping[str, float]) -> None:
    for name, value in values.items():
        if not (value == 0 or 1 / LARGEST < abs(value) < LARGEST):
            raise LogError(
                f"{name} = {value:g}: no axis has that, in SI units, and products of such numbers "
                f"overflow; give one below {LARGEST:g}"
            )


def _free(axis: Axis, free: Sequence[str], fix: Sequence[str]) -> tuple[str, ...]:
    known = axis.model.parameters
    wanted = [n for n in (*free, *fix) if n not in LAWFUL or n in known]
    axis.having(dict.fromkeys(wanted, 1.0))  # raises for unknown names
    there = [n for n in known if not axis.known or axis.model.nominal[n]]
    chosen = tuple(n for n in free if n in known) or tuple(n for n in there if n not in GIVEN)
    chosen = tuple(name for name in chosen if name not in fix)
    if not chosen:
        raise LogError("all parameters are fixed; leave one free, with --free NAME")
    return chosen


def check_rate(model: Model, period: float) -> None:
    """Refuse a rate that cannot show the fastest mode."""
    if 2 * (fastest := _fastest(model)) * period > 1:
        raise LogError(
            f"the log's rate of {1 / period:.4g} Hz is below twice the fastest mode of "
            f"{model.name}, {fastest:.4g} Hz: log faster, or use a model without it"
        )


def _check_ended(model: Model, period: float) -> None:
    """Refuse a fit that ended at a model of which the log can show nothing."""
    if 2 * (fastest := _fastest(model)) * period > 1:
        raise LogError(
            f"the fit went astray: it ended with a mode at {fastest:.4g} Hz, of which a log at "
            f"{1 / period:.4g} Hz shows nothing. Begin nearer, with --start NAME=VALUE, or use a "
            "model with fewer masses"
        )


def _fastest(model: Model) -> float:
    """Return the frequency of the fastest mode [Hz]."""
    linear = linear_part(model)
    every = linear.parametrize(linear.parameters)
    modes = np.linalg.eigvals(every.matrices(every.theta)[0])
    return float(np.max(abs(modes.imag))) / (2 * np.pi)
