"""What speaks against an identification, and what is to be known of it: a sentence a judgement."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.descent import CONVERGED
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.identification.candidates import WHITENED, Candidate
from flexaxis.experiments.logs.identification.friction import Asked
from flexaxis.experiments.logs.identification.laws import Chosen, Tried
from flexaxis.experiments.logs.identification.validate import MATCHED

Array = NDArray[np.float64]

BLIND = 0.5  # relative standard deviation from which on a parameter counts as not seen
LEVEL = "f_c"  # of dry friction: what a law is about, where its other parameters are its shape
APART = 0.99  # negative correlation from which on two count as not told apart
EARLY = 3.0  # standard deviations beyond the least delay that there can be
HALF = 0.5  # samples: least delay of a measured torque, the mean over the sample before


def judged(
    chosen: Chosen,
    best: Candidate,
    deviations: Array,
    *,
    candidates: Sequence[Candidate],
    fit: float,
    asked: Asked,
) -> list[Finding]:
    """Return the findings on an identification.

    Parameters
    ----------
    chosen : Chosen
    best : Candidate
        That was taken.
    deviations : ndarray (q,)
        Of the unknowns.
    candidates : sequence of Candidate
    fit : float
        Of a simulation of what was held out [%].
    asked : Asked
    """
    return [
        *_unlike(fit),
        *_blind(best, deviations),
        *_bounds(best),
        *_restless(best),
        *_late(best, deviations),
        *_drifts(best, asked),
        *_laws(chosen.tried, asked),
        *_differing(best, candidates, deviations),
    ]


def _unlike(fit: float) -> Iterator[Finding]:
    if fit < MATCHED:
        yield Finding(
            "problem",
            f"a simulation explains {fit:.0f} % of pieces that it was not fitted to: the model "
            "does not describe this motion; try another --model, --friction or --highpass HZ below "
            "the excitation, or begin nearer with --start NAME=VALUE",
        )


def _blind(best: Candidate, deviations: Array) -> Iterator[Finding]:
    names = best.setup.names
    shapes = best.setup.model.law_parameters - {LEVEL}
    unseen = [
        (name, value, sd)
        for name, value, sd in zip(names, best.fitted.z, deviations, strict=False)
        if sd >= BLIND * abs(value) and name not in shapes
    ]
    most, said = 2 * len(unseen) > len(names), set[str]()
    for name, value, sd in unseen:
        if name in said:
            continue
        known = f"known to ±{100 * sd / abs(value):.0f} %" if sd < abs(value) else "it may be 0"
        if name == LEVEL:
            text = (
                f"dry friction f_c = {value:.3g} ± {sd:.2g} cannot be told from none: use "
                "--friction none, or a longer log with slow and fast motion"
            )
        else:
            other = _summed(best, name)
            said.add(other)
            remedy = f"fix it with --fix {name}=VALUE, or excite what it acts on"
            if other:
                remedy = _only(best, name, other)
            text = f"the excitation cannot see {name}: {known}; {remedy}"
        yield Finding("problem" if most or not value else "note", text)


def _bounds(best: Candidate) -> Iterator[Finding]:
    stuck = best.stuck
    shapes = [n for n in stuck if n in best.setup.model.law_parameters and n != LEVEL]
    if LEVEL in stuck:
        yield Finding(
            "problem",
            f"{LEVEL}: at the bound of what dry friction may be; the log does not determine it: "
            "use --friction none, or a longer log with slow and fast motion",
        )
    linear = [name for name in stuck if name not in (*shapes, LEVEL)]
    sums = {name: other for name in linear if (other := _summed(best, name))}
    for name, other in sums.items():
        text = f"{name}: at the bound of the search; {_only(best, name, other)}"
        yield Finding("problem", text)
    linear = [name for name in linear if name not in sums]
    if linear:
        yield Finding(
            "problem",
            f"{', '.join(linear)}: at the bound of the search; the log does not determine it, so "
            f"fix it with --fix {linear[0]}=VALUE, or start elsewhere with --start "
            f"{linear[0]}=VALUE",
        )
    if shapes:
        yield Finding(
            "note",
            f"{', '.join(shapes)}: at the limit of the law, which is a simpler law; the value "
            "means no more than that",
        )


def _summed(best: Candidate, name: str) -> str:
    """Return of which other parameter a log tells the sum with one only; empty if of none.

    Where the fit ended the one goes up as the other goes down, by as much, and their sum is sure.
    """
    names, covariance = best.setup.names, best.fitted.covariance
    i, z = names.index(name), best.fitted.z
    for j, other in enumerate(names):
        var, both, its = covariance[i, i], covariance[i, j], covariance[j, j]
        if other in best.stuck or not var > 0 or not both < -APART * np.sqrt(var * its):
            continue
        sure = np.sqrt(max(its - both**2 / var, 0.0)) < BLIND * abs(z[i] + z[j])
        if sure and abs(both / var + 1) < 1 - APART and _may_vanish(best, name):
            return other
    return ""


def _only(best: Candidate, name: str, other: str) -> str:
    """Return in words that a log tells the sum of two only, and what to type."""
    values = best.setup.values(best.fitted)
    return (
        f"the log does not tell it from {other}, but their sum, {name} + {other} = "
        f"{values[name] + values[other]:.3g}: give --fix {name}=0, and read {other} as the sum"
    )


def _may_vanish(best: Candidate, name: str) -> bool:
    """Return whether there is such a model without a parameter, as there is none without a mass."""
    with suppress(EstimatorError):
        return bool(best.setup.having({name: 0.0}))
    return False


def _restless(best: Candidate) -> Iterator[Finding]:
    if not best.fitted.converged:
        yield Finding(
            "problem",
            "the fit did not converge: its last step still moved estimates by more than "
            f"{CONVERGED:g} standard deviations; use --start NAME=VALUE from these estimates, or "
            "fix with --fix NAME=VALUE what is known least",
        )


def _late(best: Candidate, deviations: Array) -> Iterator[Finding]:
    """Yield what a delay at the end of what is possible means, and one beyond it."""
    setup, lag = best.setup, float(best.fitted.z[-1])
    period = setup.log.period
    if setup.delay is not None:
        return
    if lag >= setup.latest * (1 - 1e-9):
        yield Finding(
            "problem",
            f"the torque acts {1e3 * lag:.3g} ms late or more: the columns of torque and motion "
            "are shifted; look at `flexaxis import`, or give --delay S",
        )
    if setup.log.smooth and lag < -HALF * period - EARLY * deviations[-1]:
        yield Finding(
            "problem",
            f"the torque acts {-lag / period:.2f} samples before it is logged, which is not "
            "possible: its column is shifted against the motion, or filtered (a measured current "
            "is); shift it (by a sample, if it is held), or log the torque before its filter; "
            "inertias are off as well",
        )
    if lag <= setup.earliest:
        yield Finding(
            "ok",
            "the delay is the least that a held torque can have; that is no estimate, and has no "
            "deviation",
        )


def _drifts(best: Candidate, asked: Asked) -> Iterator[Finding]:
    corner = best.setup.highpass
    if corner is not None and asked.highpass is None:
        yield Finding(
            "note",
            "the motion drifts below the excitation in a way that the torque does not explain: "
            f"residuals below {corner:g} Hz were left out, as with --highpass {corner:g}; friction "
            "that acts there only is not seen",
        )


def _laws(tried: Sequence[Tried], asked: Asked) -> Iterator[Finding]:
    """Yield what was compared, each in one sentence, with the numbers that decided."""
    for each in tried:
        change = 100 * (each.after / each.before - 1)
        text = (
            f"{each.name}: the error of a simulation of held-out pieces goes from "
            f"{each.before:.4g} to {each.after:.4g} ({change:+.3g} %)"
        )
        if asked.friction == "none" and each.taken and "dry" in each.name:
            yield Finding("problem", f"{text}, and a linear model takes it for viscous friction; "
                          "use --friction auto")  # fmt: skip
        else:
            yield Finding("ok", f"{text}: {'taken' if each.taken else 'not taken'}")


def _differing(
    best: Candidate, candidates: Sequence[Candidate], deviations: Array
) -> Iterator[Finding]:
    """Yield in one sentence which fits there are, and what their difference means."""
    errors = "; ".join(f"{candidate.name} {candidate.error:.4g}" for candidate in candidates)
    text = f"errors of a simulation of held-out pieces: {errors}. Taken: {best.name}"
    if best.lacks:
        text += ", as more than noise is left: something acts that the model has not, and "
        text += (
            "white errors end at a bound of the search"
            if best.name == WHITENED
            else "whitened errors, which take it for noise, are not believed"
        )
        text += "; look at the friction map"
    wide = deviations > 1.1 * best.deviations
    wider = [name for name, is_wide in zip(best.names, wide, strict=False) if is_wide]
    if wider:
        text += f". Deviations of {', '.join(wider)} were widened to what the fits differ by"
    yield Finding("note" if best.lacks or wider else "ok", text)
