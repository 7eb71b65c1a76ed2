"""Identify the parameters of an axis from one log, or compare them across many logs.

If the simulation error of the best model is only noise, the model is adequate. The final fit of an
adequate model minimises whitened prediction errors, because the resulting estimates have the
smallest variance. If the simulation error is larger than the noise, a noise model would hide the
deficiencies of the axis model. In this case, the final fit minimises the simulation error.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.estimators.models.model import Model
from flexaxis.estimators.offline.prediction_error import ROUNDS
from flexaxis.estimators.offline.structure import matrices
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import FEWEST, Explained, clause, explain
from flexaxis.experiments.logs.findings import Finding, LogError, texts_of
from flexaxis.experiments.logs.fit import Fit, Setup
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.read import open_log
from flexaxis.experiments.logs.search import FRICTION, LAWFUL, Search
from flexaxis.experiments.logs.signals import log_of
from flexaxis.experiments.logs.verdict import correlation, judged
from flexaxis.experiments.running.progress import progress
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.record import Record

GIVEN = ("k_T", "r")  # torque scale and gear ratio, which no log of a single axis determines
KINDS = ("auto", "none", *FRICTION)
GRAVITY = ("auto", "none", "sine")
MOST = 500_000  # maximum number of samples in a fit
SUFFIXES = (".csv", ".tsv", ".txt", ".log", ".dat", ".mat", ".h5", ".hdf5", ".nc")
MADE = ("-imported", "-track", "-estimates")  # endings of the names of files that flexaxis wrote
SEEN = 0.1  # maximum relative standard deviation of a parameter that is estimated by default
SURE = 3.0  # minimum effect of a covariate that is reported, in standard deviations
SMALLEST = 1e-3  # minimum relative change, and relative effect of a covariate, that is reported


@dataclass(frozen=True)
class Identification:
    """The result of identifying an axis from a record.

    Attributes
    ----------
    axis : Axis
        Identified axis, with nominal values, laws, delay, offset, whitening filter and noise.
    answer : Fit
        Fit of the model to the whole log.
    estimates : DataFrame
        Table with one column for each parameter, one for each gain of an additional torque, and
        the columns ``delay`` [s] and ``offset`` (in the torque unit). The rows are ``value`` and
        ``sd`` (standard deviation). If the delay was given, its ``sd`` is 0.
    fit : float
        Fit of a simulation ŷ to the held-out pieces of the output y,
        100 (1 − |y − ŷ|/|y − mean y|) [%].
    friction : str
        Identified law of dry friction: ``"coulomb"``, ``"stribeck"`` or ``"none"``. If the axis
        file contains laws, the value is ``"as stated"``.
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
        nominal values are known, the default also excludes parameters with a nominal value of 0.
    fix : sequence of str
        Names of the parameters that keep their nominal values.
    levels : mapping of str to float
        Values of the friction-law parameters. Parameters in `fix` keep these values. For all
        other parameters, the values are initial values of the fit.
    delay : float, optional
        Known delay of the torque [s]. By default, the delay is identified.
    friction : {"auto", "none", "coulomb", "stribeck"}
        Law of dry friction of the motor. ``"auto"`` adds a law if it improves the simulation of
        held-out pieces of the record. Laws in the axis file are kept.
    gravity : {"auto", "none", "sine"}
        Gravity torque, which depends on the sine and cosine of the measured angle. ``"auto"`` adds
        this torque if it improves the simulation of held-out pieces.

    Raises
    ------
    LogError
        If a parameter name is unknown, or if no parameters can be identified from the record.
    """
    for option, value, kinds in (("friction", friction, KINDS), ("gravity", gravity, GRAVITY)):
        if value not in kinds:
            raise LogError(f"--{option} {value} is not one of {', '.join(kinds)}")
    law = FRICTION.get("coulomb" if friction == "auto" else friction)
    known = law.names if law and not axis.model.laws else ()
    for name in levels:
        if name not in known:
            hint = did_you_mean(name, (*axis.model.parameters, *known))
            raise LogError(
                f"neither the model {axis.model.name} nor --friction {friction} has a parameter "
                f"{name}.{hint}"
            )
    names = free_names(axis, free, fix)
    log = log_of(record, axis.model_copy(update={"beside": {}}))
    setup = Setup(log, axis.model, names, delay or 0.0, delay is not None).part(MOST)
    early, late = -4 * log.period, setup.latest
    if not early <= setup.delay <= late:
        raise LogError(
            f"--delay {delay:g} is not allowed. The delay of the torque must be between {early:g} "
            f"s and {late:g} s. For any other delay, shift the torque column by whole samples"
        )
    if gravity == "auto" and record.versions.get("motion") == "linear":
        gravity = "none"
    search = Search(setup, axis.known, friction, gravity, levels, fix)
    return _result(search, axis, record)


def _result(search: Search, axis: Axis, record: Record) -> Identification:
    best = search.result()
    rounds = 0 if best.lacks else ROUNDS
    chosen = Fit(best.setup, best.setup.solve(best.fitted.z, rounds=rounds))
    setup, fitted, found = chosen.setup, chosen.fitted, chosen.found
    _check_rate(found.model, setup.log.period)
    known = chosen.estimates.drop(columns=["delay", "offset"])
    offset, sd = chosen.estimates["offset"]
    results = {
        "model": found.model,
        "known": True,
        "delay": found.delay,
        "whitening": tuple(fitted.inverse.tolist()),
        "noise": float(np.sqrt(fitted.square)),
        "error": best.error,
        "offset": float(offset) if abs(offset) > 3 * sd else 0.0,
        "beside": known.loc["value", [*setup.beside]].to_dict(),
        "rate": 1 / setup.log.period,
        "deviation": known.loc["sd"].to_dict(),
    }
    friction = "as stated" if axis.model.laws else "none"
    if setup.model.laws and not axis.model.laws:
        friction = "stribeck" if "f_s" in setup.model.parameters else "coulomb"
    fit, units = 100 * (1 - best.error / chosen.size), units_of(record, found.model.nominal)
    texts = (
        f"units: {units}",
        f"law of dry friction: {friction}",
        f"a simulation explains {chosen.percent:.1f} % of the whole log",
        "the largest autocorrelation of the whitened residuals is "
        f"{correlation(fitted.white[fitted.good]):.3f}",
    )
    findings = judged(search, best, chosen, fit, record) + [Finding("info", text) for text in texts]
    results["problems"] = texts_of(findings, "problem")
    return Identification(
        axis.model_copy(update=results), chosen, chosen.estimates, fit, friction, findings, units
    )


def units_of(record: Record, nominal: Mapping[str, float]) -> str:
    """Return the units of the parameters, which depend on the unit of k_T."""
    unit, k_T = record.versions.get("torque_unit", ""), nominal.get("k_T")
    if unit not in {"", "1", "A", "V"} and k_T in {None, 1.0}:  # torque in N m or N
        return "SI"
    one = f"1 {unit}" if unit not in {"", "1"} else "1"
    newton = "N" if record.versions.get("motion") == "linear" else "N m"
    text = f"SI, if a logged torque of {one} equals {k_T or 1.0:g} {newton}"
    return f"{text}; give the true k_T with --fix k_T=VALUE" if k_T == 1 else text


def free_names(axis: Axis, free: Sequence[str], fix: Sequence[str]) -> tuple[str, ...]:
    """Return the parameters to identify: `free`, or by default all that a log can determine."""
    known = axis.model.parameters
    named = sorted({*free, *fix} - {*LAWFUL})
    axis.having(dict.fromkeys(named, 1.0))  # raises an error for unknown names
    usual = [n for n in known if n not in GIVEN and (not axis.known or axis.model.nominal[n])]
    chosen = [name for name in ([n for n in free if n in known] or usual) if name not in fix]
    if not chosen:
        raise LogError(
            "all parameters are fixed. Use --free NAME to select a parameter that --fix does not "
            "name"
        )
    return tuple(chosen)


def _check_rate(model: Model, period: float) -> None:
    """Raise a LogError if the sampling rate is too low for the fastest mode of the model."""
    fastest = max(abs(np.linalg.eigvals(matrices(model)[0]).imag)) / (2 * np.pi)
    if 2 * fastest * period > 1:
        raise LogError(
            f"a log at {1 / period:.4g} Hz cannot show a mode at {fastest:.4g} Hz. Increase the "
            "sampling rate, give better initial values with --start NAME=VALUE, or use a model "
            "with fewer masses"
        )


@dataclass(frozen=True)
class Many:
    """Parameter estimates from many logs of an axis, and findings on changes between the logs.

    Attributes
    ----------
    table : DataFrame
        Table with one row for each log. Each parameter has the columns ``name`` and ``name_sd``,
        and each covariate has one column.
    explained : dict of str to Explained
        Effects of the covariates on each parameter, and the change of each parameter.
    findings : list of Finding
        One finding for each parameter, and one for each log that could not be used.
    """

    table: pd.DataFrame
    explained: dict[str, Explained]
    findings: list[Finding]

    @property
    def status(self) -> int:
        """Exit status: 1 if a parameter changed or a log could not be used, else 0."""
        return int(any(one.kind in {"note", "problem"} for one in self.findings))


def find_logs(folder: Path) -> list[Path]:
    """Return the paths of the logs in a folder, sorted by name (log_9 before log_10).

    Files that flexaxis wrote into the folder are skipped.

    Raises
    ------
    LogError
        If the folder contains no log.
    """
    logs = [
        path
        for path in folder.glob("[!.]*")
        if path.suffix.lower() in SUFFIXES and not path.stem.endswith(MADE)
    ]
    if not logs:
        raise LogError(
            f"{folder} contains no log, that is, no file whose name ends in {', '.join(SUFFIXES)}"
        )
    return sorted(logs, key=lambda path: [t.zfill(20) for t in re.split(r"(\d+)", path.name)])


def identify_many(
    logs: Sequence[Path],
    axis: Axis,
    tables: Mapping[str, Any],
    *,
    covariates: Sequence[str] = (),
    free: Sequence[str] = (),
    false_alarms: float = 0.01,
) -> Many:
    """Estimate the parameters of an axis from each log, and find changes between the logs.

    Parameters
    ----------
    logs : sequence of Path
        Paths of the logs, in chronological order.
    axis : Axis
        Identified axis. If its standard deviations are unknown, the axis is first identified from
        the first log.
    tables : mapping
        Options for reading a log, as for `importing.import_log`.
    covariates : sequence of str
        Names of log columns, such as a temperature, that may explain differences between the
        estimates. The value of a covariate for one log is the mean of the column.
    free : sequence of str
        Parameters to estimate. By default, these are all parameters whose standard deviation in the
        axis file is less than 10 % of the nominal value.
    false_alarms : float
        Maximum probability of a false alarm, that is, of reporting a change although no parameter
        changed.
    """
    rows, findings = dict[str, Any](), list[Finding]()
    with progress("Identifying", len(logs)) as advance:
        for path in logs:
            try:
                record = import_log(path, **tables).record
                if not (axis.known and (free or axis.deviation)):
                    axis = identify(record, axis).axis
                known, nominal = axis.deviation, axis.model.nominal
                free = free or [n for n in nominal if known.get(n, np.inf) < SEEN * abs(nominal[n])]
                if not free:
                    raise LogError(
                        "no parameter in the axis file is known to within 10 %. Name the "
                        "parameters to estimate with --free NAME"
                    )
                setup = Setup(log_of(record, axis), axis.model, tuple(free), axis.delay)
                found = Fit(setup, setup.solve(rounds=ROUNDS)).estimates[[*free]]
                parts = [found.loc["value"], found.loc["sd"].add_suffix("_sd")]
                if covariates:
                    columns = open_log(path, tables.get("header")).read(covariates)
                    parts += [pd.DataFrame(columns).mean()]
                rows[path.name] = pd.concat(parts)
            except FlexaxisError as error:
                findings.append(Finding("problem", f"{path.name} is left out: {error}"))
            advance(1)
    if not rows:
        raise LogError("; ".join(one.text for one in findings))
    table = pd.DataFrame(rows).T
    beside = table[list(covariates)].to_numpy(float)
    explained = {
        name: explain(table[name].to_numpy(), table[f"{name}_sd"].to_numpy(), beside,
                      false_alarms=false_alarms / len(free))
        for name in free
    }  # fmt: skip
    sentences = [_sentence(name, one, table, covariates) for name, one in explained.items()]
    return Many(table, explained, [*sorted(sentences, key=lambda f: f.kind == "ok"), *findings])


def _sentence(name: str, one: Explained, table: pd.DataFrame, covariates: Sequence[str]) -> Finding:
    """Return the finding on the change of one parameter between the logs."""
    level = abs(one.level)
    changed = one.kind != "constant" and abs(one.size) > SMALLEST
    few = len(table) < FEWEST
    text = f"{name} = {one.level:.4g}, {'too few logs to detect a change' if few else 'no change'}"
    if changed:
        text = clause(name, one, one.size, *table.index[[one.begin, one.end]])
        text += f" (probability that noise alone causes this change: {one.chance:.1g})"
    for column, slope, sd in zip(covariates, one.slopes, one.slope_deviations, strict=True):
        if abs(slope) > max(SURE * sd, SMALLEST * level / np.ptp(table[column])):
            size = f"{100 * slope / level:+.2g} ± {100 * sd / level:.1g} %"
            text += f"; covariate effect: {size} per unit of {column}"
    return Finding("note" if changed else "info" if few else "ok", text)
