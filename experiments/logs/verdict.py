"""Decide whether the estimates from a log can be used, and validate an axis on another log."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import changes_in
from flexaxis.experiments.logs.findings import Finding, Kind, LogError
from flexaxis.experiments.logs.fit import Fit, Setup
from flexaxis.experiments.logs.search import Search
from flexaxis.experiments.logs.signals import Array, gaps_of, log_of
from flexaxis.sim.record import Record

POOR = 10.0  # maximum difference between the expected and the actual fit of the same axis [%]
MATCHED = 50.0  # minimum fit of a correct model [%]
LAGS = 20  # number of lags of the autocorrelation of a residual
BLIND = 0.5  # relative standard deviation above which a log does not determine a parameter
EARLY = 3.0  # significant difference of a delay from its bound, in standard deviations
HALF = 0.5  # time by which a measured torque may act early [samples], if it is a mean value
FILTERED = 0.5  # delay above which a speed may be low-pass filtered [samples]
NOISY = 1.2  # ratio of simulation error to noise above which the model is considered wrong
HIDDEN = 30.0  # fit [%] below which sensor steps or noise hide the motion
MISSING = 0.07  # maximum fraction of the samples that may be missing in many gaps
HELD = 0.02  # maximum difference between the delay of a held torque and half a sample [samples]


def judged(search: Search, best: Fit, chosen: Fit, fit: float, record: Record) -> list[Finding]:
    """Return the findings on an identification.

    Parameters
    ----------
    search : Search
        Model search, which compares the model with and without each additional effect.
    best : Fit
        Best fit of the search, computed without the held-out pieces of the log.
    chosen : Fit
        Fit of the best model to the whole log.
    fit : float
        Fit [%] between the held-out pieces and a simulation with the model of `best`.
    record : Record
        Record of the log.
    """
    setup, fitted, log = chosen.setup, chosen.fitted, chosen.setup.log
    wrong = fit < MATCHED and best.error > NOISY * chosen.noise
    missing, gaps = float(1 - np.mean(log.ok)), len(gaps_of(log.ok))
    lag, sd, period, free = fitted.z[-1], chosen.deviations[-1], log.period, not setup.timed
    rubs = search.friction == "none" and search.tried.get("dry friction", [False])[0]
    stated = record.versions.get("torque_because") == "as stated"
    compared = "; ".join(
        f"{name} {'added' if taken else 'not added'} ({before:.4g} → {after:.4g})"
        for name, (taken, before, after) in search.tried.items()
    )
    rows: list[tuple[Kind, bool, str]] = [
        ("problem", wrong,
         f"a simulation explains only {fit:.0f} % of the held-out pieces, so the model does not "
         "describe this motion. Possible reasons are backlash, a brake or a wrong column. Try "
         "another --model, or give better initial values with --start NAME=VALUE"),
        ("problem", fit < HIDDEN and not wrong,
         f"a simulation explains only {fit:.0f} % of the held-out pieces, because sensor steps or "
         "noise hide the motion. Reduce the sampling rate, for example with --resample "
         f"{0.2 / period:.3g}, or use a stronger excitation"),
        ("problem", not fitted.converged,
         "the fit did not converge. Repeat the fit from these estimates with --start NAME=VALUE, "
         "or fix the least certain parameter with --fix NAME=VALUE"),
        ("problem", rubs,
         "dry friction improves the simulation, but --friction none excludes it. The estimate of "
         "viscous friction is therefore wrong. Use --friction auto"),
        # after the longest gaps the state is estimated; in all other gaps the torque is a line
        ("problem", missing > MISSING and gaps > len(setup.begins),
         f"{100 * missing:.0f} % of the samples are missing, in {gaps} gaps. The torque in these "
         "gaps is unknown, so the estimates are wrong. Record a log without missing samples, or "
         "select a part with --rows A:B. If only the time stamps are rounded, give --rate HZ"),
        *_changed(chosen),
        _unseen(chosen),
        ("problem", free and lag >= max(setup.latest, EARLY * sd),
         f"the torque acts at least {1e3 * lag:.3g} ms after it is logged, so the torque and "
         "motion columns are not synchronous. Shift one of the columns, or give the delay with "
         "--delay S"),
        ("problem" if log.smooth else "note",
         free and lag < -HALF * log.smooth * period - EARLY * sd,
         f"the torque acts {-lag / period:.2f} samples before it is logged, which is impossible. "
         "The torque column is late or filtered. The estimates are valid for a shifted column. "
         "Shift it by whole samples, or log the torque before its filter"),
        ("problem",
         free and log.output == "speed" and best.lacks and lag > FILTERED * period,
         f"the speed is low-pass filtered with a lag of about {1e3 * lag:.1g} ms, or has another "
         "lag that a pure delay does not explain. Inertias and stiffnesses are therefore wrong by "
         "a few per cent. Instead, log the angle, or log the speed before its filter"),
        ("problem", log.smooth and not stated and abs(lag / period - 0.5) < HELD,
         "the torque acts half a sample late, as a command held between samples does, but flexaxis "
         "assumes that the torque is a measured current. Give --torque-is held if the torque is a "
         "command, or --torque-is smooth if it is a measured current"),
        ("note", best.lacks,
         "the simulation error exceeds the noise, so the model lacks an effect of the axis"),
        ("info", bool(compared),
         "tested effects (simulation error of held-out pieces [rad/s] without → with the effect): "
         f"{compared}"),
        ("info", len(log.y) < len(record.time),
         f"the fit uses {len(log.y)} of {len(record.time)} samples: those with the largest torque"),
    ]  # fmt: skip
    return [Finding(kind, text) for kind, holds, text in rows if holds]


def _changed(chosen: Fit) -> Iterator[tuple[Kind, bool, str]]:
    """Yield a finding on the most significant change within the log, with a remedy."""
    fitted, good, period = chosen.fitted, chosen.fitted.good, chosen.setup.log.period
    size = chosen.estimates.loc["value"].to_numpy().copy()
    size[-2:] = period, 1.0
    J = (fitted.gradient[chosen.rows] * size[:, None])[:, good].T
    time: Any = period * np.flatnonzero(good)
    for one in changes_in(time, fitted.white[good], J, [*chosen.estimates][:-2])[0][:1]:
        k = round(one.time / period)
        part = f"one part of the log with --rows 0:{k} or --rows {k}:"
        if one.kind == "drift":
            part = "a shorter part of the log with --rows A:B to avoid averaging over the drift"
        remedy = f"Identify the axis from {part}, and track the change with flexaxis track"
        yield "problem", True, f"{one.text}. {remedy}"


def _unseen(chosen: Fit) -> tuple[Kind, bool, str]:
    """Return a finding on the parameters that the log does not determine, with a remedy."""
    setup, texts, ends = chosen.setup, list[str](), list[bool]()
    own = [name for name in setup.names if name not in setup.model.law_parameters - {"f_c"}]
    for name, (value, sd) in chosen.estimates[own].items():
        end = value in setup.box[name]
        if end or sd >= BLIND * abs(value):
            ends.append(end)
            texts.append(f"{name} ({value:.3g} ± {sd:.2g}{', a bound of the search' * end})")
    text = (
        f"the log does not determine {', '.join(texts)}. Fix a parameter with --fix NAME=VALUE, "
        "use a longer log with slow and fast motion, or use a model with fewer parameters, for "
        "example with --friction none or --model one_mass"
    )
    return "problem" if any(ends) or 2 * len(ends) > len(setup.names) else "note", bool(ends), text


def unlike(fit: Fit, usual: float | None) -> str:
    """Return a message if a log does not match an identified axis, else an empty string.

    The log matches the axis if the simulation error or the fit is near the expected value. The fit
    alone is not enough: with less motion, the same absolute error means a worse fit.

    Parameters
    ----------
    fit : Fit
        Simulation of the log with the identified axis.
    usual : float or None
        Expected simulation error [rad/s], or None if the expected error is unknown.
    """
    least = MATCHED if usual is None else 100 * (1 - usual / fit.size) - POOR
    if fit.percent > 0 and (fit.percent >= least or fit.left <= (usual or 0.0)):
        return ""
    return (
        f"a simulation from the torque explains only {fit.percent:.1f} % of the log, but at least "
        f"{least:.1f} % is expected. Either the axis or the motion differs from that of the "
        "identification, or the torque or the angle has another unit or sign. Compare the units "
        "and scales with those of the identification log, or identify the axis again"
    )


def correlation(white: Array) -> float:
    """Return the autocorrelation of largest magnitude, up to lag `LAGS`, of a residual (N,)."""
    e = white - white.mean()
    past = [e[:-lag] @ e[lag:] / (e @ e) for lag in range(1, LAGS + 1)]
    return float(max(past, key=abs))


def validate(record: Record, axis: Axis) -> Fit:
    """Simulate a record with an identified axis, and fit only the initial states to the record.

    Parameters
    ----------
    record : Record
        Record that was not used to identify the axis.
    axis : Axis
        Identified axis.

    Raises
    ------
    LogError
        If the sampling rate differs from that of the identification, or if the simulation fails.
    """
    axis.check_rate(record.period)
    setup = Setup(log_of(record, axis), axis.model, axis.model.parameters[:1], axis.delay)
    problem = setup.problem()
    problem.held[-2] = True  # the offset is known
    fit = Fit(setup, setup.begun(problem, axis.offset))
    if not np.isfinite(fit.left):
        raise LogError(
            "this log cannot be simulated with this axis. Check that the log is from this axis"
        )
    return fit
