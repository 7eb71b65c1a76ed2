"""Nominal values of an axis from its log: a frequency response, then a prediction-error fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.colour import HIGHEST_ORDER, noise_model, settled
from flexaxis.estimators.offline.prediction_error import Fitted, discretisation
from flexaxis.experiments.logs.attempt import Attempt, log_of
from flexaxis.experiments.logs.axis_file import Axis, is_smooth
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.fits import Fits, fits
from flexaxis.experiments.logs.friction import names_of
from flexaxis.experiments.logs.late import at_its_least, check_delay
from flexaxis.experiments.logs.laws import Tried, able, best_of_laws, check_given
from flexaxis.experiments.logs.pieces import spread
from flexaxis.experiments.logs.prepare import highpass_filter
from flexaxis.experiments.logs.spectrum import Response
from flexaxis.experiments.logs.starts import Starts
from flexaxis.experiments.logs.verdict import Verdict, judge
from flexaxis.sim.record import Record

__all__ = ["HIGHEST_ORDER", "Identification", "identify", "noise_model", "settled"]

Array = NDArray[np.float64]

GIVEN = ("k_T", "r")  # scale of the torque and gear ratio: no log of one axis determines them
LARGEST = 1e30  # of a parameter in SI units, and its reciprocal: powers of it can be computed with
FRICTION = ("auto", "none", "coulomb", "lugre", "static")


@dataclass(frozen=True)
class Identification:
    """What was identified from a record, and how far it can be trusted.

    Attributes
    ----------
    axis : Axis
        With the new nominal values, laws, delay, offset, whitening filter and noise.
    names : tuple of str
        The identified parameters.
    theta : ndarray (p,)
        Estimates.
    noise_deviations, spread : ndarray (p,)
        Standard deviations for white residuals, and from the spread over pieces of the record.
    discretisation : ndarray (p,)
        What the steps that laws are solved in may make estimates off.
    delay, delay_deviation : float
        By which the torque acts late [s]; the deviation is zero if it was given, or came to
        the least that is possible.
    offset, offset_deviation : float
        What acts besides the logged torque, in its unit.
    fits : Fits
        How well simulation and prediction do on this log.
    fitted : Fitted
    response : Response or None
        What the log shows without a model, but for the dry friction that was found; None where it
        was not asked.
    output : str
        What was fitted, ``"speed"`` or ``"increment"``.
    friction : str
        The word for its laws, ``"none"`` if it has none.
    tried : tuple of Tried
        What else was tried, and what it predicted.
    verdict : Verdict
    """

    axis: Axis
    names: tuple[str, ...]
    theta: Array
    noise_deviations: Array
    spread: Array
    discretisation: Array
    delay: float
    delay_deviation: float
    offset: float
    offset_deviation: float
    fits: Fits
    fitted: Fitted
    response: Response | None
    output: str
    friction: str
    tried: tuple[Tried, ...]
    verdict: Verdict

    @property
    def deviations(self) -> Array:
        """Standard deviations (p,): the larger of both, with the discretisation of laws."""
        return np.hypot(np.maximum(self.noise_deviations, self.spread), self.discretisation)

    @property
    def residual(self) -> Array:
        """Y − ŷ (N,) of the simulation."""
        return self.fitted.residual

    @property
    def fit(self) -> float:
        """100 (1 − |y − ŷ|/|y − mean y|): how well a simulation from the torque alone does."""
        return self.fits.simulation

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the result, in words."""
        return self.verdict.warnings

    @property
    def remarks(self) -> tuple[str, ...]:
        """What was found or done besides, in words."""
        return self.verdict.remarks


def identify(
    record: Record,
    axis: Axis,
    *,
    free: Sequence[str] = (),
    fix: Sequence[str] = (),
    given: Mapping[str, float] = MappingProxyType({}),
    delay: float | None = None,
    whiten: bool = True,
    friction: str = "auto",
    highpass: float | None = None,
    tell: Callable[[], None] = lambda: None,
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
        ``"auto"`` takes one of the laws that have them.
    delay : float, optional
        Known delay of the torque [s]; it is identified too if not given.
    whiten : bool
        Whether to model the noise; without, this is plain output error.
    friction : {"auto", "none", "coulomb", "lugre", "static"}
        Law of dry friction of the motor; ``"auto"`` takes the simplest that predicts held-out
        pieces of the record as well as any. Laws that the axis has already are kept.
    highpass : float, optional
        Corner [Hz] below which residuals do not count; that of the axis by default.
    tell : callable, optional
        Told after each simulation.

    Raises
    ------
    LogError
        If a name is unknown, or the record cannot determine such a model.
    """
    if friction not in FRICTION:
        raise LogError(f"--friction {friction}: it is one of {', '.join(FRICTION)}")
    check_given(axis.model, friction, given)
    _check_sizes({**axis.model.nominal, **given})
    log = log_of(record, axis)
    own = names_of(axis.model)
    names = _free(axis, free, fix)
    if axis.known:
        check_rate(axis.model, log.period)
    corner = axis.highpass if highpass is None else highpass
    if corner is not None:
        highpass_filter(corner, log.period)  # refuses what is none
    attempt = Attempt(
        log,
        axis.model,
        names,
        delay=delay,
        whiten=whiten,
        highpass=corner,
        tell=tell,
    )
    check_delay(attempt)
    whole = "highpass" not in record.versions  # a filter of residuals leaves the motion as it is
    if not whole and friction not in {"auto", "none"}:
        raise LogError(
            f"--friction {friction} needs the motion as it was, and slow motion was filtered away: "
            "leave --highpass out at the import; identify --highpass filters residuals alone"
        )
    starts = Starts(attempt, known=axis.known, whole=whole)
    attempt, fitted, tried, word = best_of_laws(starts, friction, free, fix, given)
    blind = friction == "auto" and not own and not whole and able(attempt.model)
    found = _found(
        axis,
        record,
        attempt,
        fitted,
        tried=tried,
        word=word,
        seen=starts.seen_by(attempt, fitted),
        blind=blind,
    )
    _check_ended(found.axis.model, log.period)
    return found


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


LAWFUL = ("f_c", "f_s", "v_s", "sigma_0", "sigma_1", "alpha", "beta")  # may come by --friction


def check_rate(model: Model, period: float) -> None:
    """Refuse a rate that cannot show the fastest mode."""
    fastest = _fastest(model)
    if 2 * fastest * period > 1:
        raise LogError(
            f"the log's rate of {1 / period:.4g} Hz is below twice the fastest mode of "
            f"{model.name}, {fastest:.4g} Hz: log faster, or use a model without it"
        )


def _check_ended(model: Model, period: float) -> None:
    """Refuse a fit that ended at a model of which the log can show nothing."""
    fastest = _fastest(model)
    if 2 * fastest * period > 1:
        raise LogError(
            f"the fit went astray: it ended with a mode at {fastest:.4g} Hz, of which a log at "
            f"{1 / period:.4g} Hz shows nothing. Begin nearer, with --start NAME=VALUE, or use a "
            "model with fewer masses"
        )


def _fastest(model: Model) -> float:
    """Return the frequency of the fastest mode [Hz]."""
    linear = replace(model, laws=())
    every = linear.parametrize(linear.parameters)
    modes = np.linalg.eigvals(every.matrices(every.theta)[0])
    return float(np.max(abs(modes.imag))) / (2 * np.pi)


def _found(
    axis: Axis,
    record: Record,
    attempt: Attempt,
    fitted: Fitted,
    *,
    word: str,
    tried: tuple[Tried, ...] = (),
    seen: Response | None = None,
    blind: bool = False,
) -> Identification:
    log, p = attempt.log, len(attempt.names)
    noise, pieces = fitted.deviations, spread(fitted)
    steps = discretisation(attempt.problem(), fitted)
    honest = np.hypot(np.maximum(noise, pieces), steps)
    model = attempt.having(attempt.values(fitted)).model
    found = replace(
        axis,
        model=model,
        known=True,
        delay=float(fitted.z[-1]),
        whitening=tuple(fitted.colour.inverse.tolist()),
        noise=float(np.sqrt(fitted.square)),
        offset=float(fitted.z[-2]) if abs(fitted.z[-2]) > 3 * honest[-2] else 0.0,
        highpass=attempt.highpass,
        rate=1 / log.period,
        torque_is="smooth" if log.smooth else None,
        deviation=dict(zip(attempt.names, honest[:p].tolist(), strict=True)),
    )
    return Identification(
        axis=found,
        names=attempt.names,
        theta=fitted.z[:p],
        noise_deviations=noise[:p],
        spread=pieces[:p],
        discretisation=steps[:p],
        delay=float(fitted.z[-1]),
        delay_deviation=0.0 if at_its_least(attempt, fitted) else float(honest[-1]),
        offset=float(fitted.z[-2]),
        offset_deviation=float(honest[-2]),
        fits=fits(log.y, fitted),
        fitted=fitted,
        response=seen,
        output=log.output,
        friction=word,
        tried=tried,
        verdict=judge(
            attempt,
            fitted,
            np.maximum(noise, pieces),  # what the log shows, not how laws are solved
            seen=seen,
            tried=tried,
            word=word,
            smooth=is_smooth(record),
            blind=blind,
        ),
    )
