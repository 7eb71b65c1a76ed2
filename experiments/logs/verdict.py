"""What speaks against an identification: whether its numbers can be used, and what to type next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.logs.changes import Change
from flexaxis.experiments.logs.findings import Finding
from flexaxis.experiments.logs.fit import Answer, Candidate, stuck
from flexaxis.experiments.logs.search import Search
from flexaxis.experiments.logs.signals import noise_of
from flexaxis.experiments.logs.validate import MATCHED

BLIND = 0.5  # relative standard deviation from which on a parameter counts as not seen
APART = 0.99  # negative correlation from which on two count as not told apart
EARLY = 3.0  # standard deviations beyond the least delay that is possible
HALF = 0.5  # samples: least delay of a measured torque, the mean over the sample before
NOISY = 1.2  # times the noise of the motion, that a simulation leaves of a coarse encoder
HIDDEN = 30.0  # % of a fit, below which noise of the sensor, which is not white, decides
MISSING = 0.07  # of the samples, from which on what acted in many gaps is too much
SMOOTHER = {"two_mass": "one_mass", "three_mass": "two_mass", "four_mass": "three_mass"}


def judged(
    search: Search, best: Candidate, taken: Answer, fit: float, changes: Sequence[Change]
) -> list[Finding]:
    """Return the findings on an identification, a sentence each.

    Parameters
    ----------
    search : Search
        With what was compared.
    best : Candidate
    taken : Answer
        The fit that is believed.
    fit : float
        Of a simulation of what was held out [%].
    changes : sequence of Change
        Of parameters within the log.
    """
    return [
        *_unlike(search, best, taken, fit),
        *_changes(taken, changes),
        *_unseen(search, taken),
        *_late(taken),
        *_gaps(taken),
        *_compared(search, best, taken),
    ]


def _unlike(search: Search, best: Candidate, taken: Answer, fit: float) -> Iterator[Finding]:
    log = taken.setup.log
    noise = max(noise_of(taken.fitted.residual[log.ok]), log.rounding)
    if fit < MATCHED and best.error > NOISY * noise:
        yield Finding(
            "problem",
            f"a simulation explains {fit:.0f} % of pieces that it was not fitted to: the model "
            "does not describe this motion (play, a brake or a wrong column would do that); try "
            "another --model, or --highpass HZ below the excitation, or begin nearer with --start "
            "NAME=VALUE",
        )
    elif fit < HIDDEN:
        yield Finding(
            "problem",
            f"steps of the sensor or noise hide the motion, of which {fit:.0f} % are explained: "
            f"bring the log to a lower rate, such as --resample {0.2 / log.period:.3g}, or excite "
            "more",
        )
    if not taken.fitted.converged:
        yield Finding(
            "problem",
            "the fit did not converge; use --start NAME=VALUE from these estimates, or fix with "
            "--fix NAME=VALUE what is known least",
        )
    dry = next((one for one in search.tried if one.name == "dry friction"), None)
    if search.friction == "none" and dry is not None and dry.taken:
        yield Finding(
            "problem",
            f"dry friction would lower the error of a simulation from {dry.before:.4g} to "
            f"{dry.after:.4g}, and a linear model takes it for viscous friction; use --friction "
            "auto",
        )


def _changes(taken: Answer, changes: Sequence[Change]) -> Iterator[Finding]:
    for one in changes[:1]:
        k = round(one.time / taken.setup.log.period)
        part = f"one part, with --rows 0:{k} or --rows {k}:"
        if one.kind == "drift":
            part = "a shorter part, with --rows A:B, as the value is a mean over the log"
        text = f"{one.text}: identify {part}, and follow it with flexaxis track"
        yield Finding("problem", text)


def _unseen(search: Search, taken: Answer) -> Iterator[Finding]:
    """Yield in one sentence what the log does not determine, and what to do about it."""
    setup, z, names = taken.setup, taken.fitted.z, taken.setup.names
    shapes = setup.model.law_parameters - {"f_c"}
    ends = [name for name in stuck(taken) if name not in shapes]
    wide = {
        name: sd / max(abs(value), 1e-300)
        for name, value, sd in zip(names, z, taken.deviations, strict=False)
        if sd >= BLIND * abs(value) and name not in shapes and name not in ends
    }
    unseen = [*ends, *wide]
    if not unseen:
        return
    grave = bool(ends) or 2 * len(unseen) > len(names)
    if len(unseen) > 2 and len(unseen) >= len(names) - 1:
        smaller = SMOOTHER.get(search.setup.model.name, "one_mass")
        text = (
            f"the log determines none of {', '.join(names)}: the excitation is too small or too "
            f"slow for this model; try --model {smaller}"
        )
        yield Finding("problem", text)
        return
    for name in unseen:
        known = "it is at the bound of the search" if name in ends else "it may be 0"
        if wide.get(name, 1.0) < 1:
            known = f"it is known to ±{100 * wide[name]:.0f} %"
        remedy = f"fix it with --fix {name}=VALUE, or excite what it acts on"
        if name == "f_c":
            remedy = "use --friction none, or a longer log with slow and fast motion"
        elif other := _summed(taken, name):
            remedy = f"only {name} + {other} is seen: give --fix {name}=0, and read {other} so"
        text = f"the log does not determine {name}: {known}; {remedy}"
        yield Finding("problem" if grave else "note", text)


def _summed(taken: Answer, name: str) -> str:
    """Return of which other parameter a log tells the sum with one only; empty if of none.

    There the one goes up as the other goes down, by as much, and their sum is sure.
    """
    names, covariance = taken.setup.names, taken.fitted.covariance
    i, z = names.index(name), taken.fitted.z
    with suppress(EstimatorError):
        taken.setup.having({name: 0.0})  # there is no axis without a mass
        for j, other in enumerate(names):
            var, both, its = covariance[i, i], covariance[i, j], covariance[j, j]
            if not var > 0 or not both < -APART * np.sqrt(var * its):
                continue
            sure = np.sqrt(max(its - both**2 / var, 0.0)) < BLIND * abs(z[i] + z[j])
            if sure and abs(both / var + 1) < 1 - APART:
                return other
    return ""


def _late(taken: Answer) -> Iterator[Finding]:
    """Yield what a delay at the end of what is possible means, and one beyond it."""
    setup, lag, period = taken.setup, float(taken.fitted.z[-1]), taken.setup.log.period
    if setup.delay is not None:
        return
    if lag >= max(setup.latest * (1 - 1e-9), EARLY * taken.deviations[-1]):
        yield Finding(
            "problem",
            f"the torque acts {1e3 * lag:.3g} ms late or more: the columns of torque and motion "
            "are shifted; shift one, or give --delay S",
        )
    least = HALF if setup.log.smooth else 0.0
    if lag < -least * period - EARLY * taken.deviations[-1]:
        yield Finding(
            "problem" if setup.log.smooth else "note",
            f"the torque acts {-lag / period:.2f} samples before it is logged, which is not "
            "possible: its column is late, or filtered; shift it by whole samples, or log the "
            "torque before its filter. The numbers here hold for the shifted column",
        )
    if "tau_y" in setup.names:
        tau = setup.values(taken.fitted)["tau_y"]
        yield Finding(
            "problem",
            f"the speed is behind a low-pass of about {1e3 * tau:.2g} ms, which inertias and "
            "springs follow by some per cent: log the angle, or the speed before its filter",
        )


def _gaps(taken: Answer) -> Iterator[Finding]:
    setup, ok = taken.setup, taken.setup.log.ok
    missing, gaps = float(1 - np.mean(ok)), np.count_nonzero(np.diff(ok.astype(int)) < 0)
    counted = float(np.mean(taken.fitted.good)) / max(1 - missing, 1e-9)
    # behind the longest gaps the state is estimated; in all others the torque is a line
    if (missing > MISSING and gaps > len(setup.begins)) or counted < HALF:
        yield Finding(
            "problem",
            f"{100 * missing:.0f} % of the samples are missing, in {gaps} gaps: what acted there "
            "is not known, and estimates are off; log without loss, or use a part with --rows A:B",
        )


def _compared(search: Search, best: Candidate, taken: Answer) -> Iterator[Finding]:
    """Yield what was compared, and what the rest of the error means."""
    corner = best.setup.highpass
    if corner is not None and search.setup.highpass is None:
        yield Finding(
            "note",
            "the motion drifts below the excitation in a way that the torque does not explain: "
            f"residuals below {corner:g} Hz were left out, as with --highpass {corner:g}",
        )
    told = "; ".join(
        f"{one.name} {'taken' if one.taken else 'not taken'} ({one.before:.4g} → {one.after:.4g})"
        for one in search.tried
    )
    if told:
        yield Finding("info", f"compared by the error of a simulation of held-out pieces: {told}")
    if best.lacks:
        yield Finding(
            "note",
            "more than noise is left: something acts that the model has not. Deviations hold the "
            "difference of two fits",
        )
