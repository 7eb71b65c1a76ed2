"""Estimate the parameters of one axis from many logs, with effects of covariates and changes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.estimators.offline.prediction_error import ROUNDS
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.changes import Explained, clause, explain
from flexaxis.experiments.logs.findings import Finding, LogError
from flexaxis.experiments.logs.fit import Fit
from flexaxis.experiments.logs.identify import free_names, identify
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.read import open_log
from flexaxis.experiments.logs.setup import Setup
from flexaxis.experiments.logs.signals import log_of
from flexaxis.sim.errors import FlexaxisError

SUFFIXES = (".csv", ".tsv", ".txt", ".log", ".dat", ".mat", ".h5", ".hdf5", ".nc")
MADE = ("-imported", "-track", "-estimates")  # endings of the names of files that flexaxis wrote
SEEN = 0.1  # maximum relative standard deviation of a parameter that is estimated by default
SURE = 3.0  # minimum effect of a covariate that is reported, in standard deviations
SMALLEST = 1e-3  # minimum relative change, and relative effect of a covariate, that is reported


@dataclass(frozen=True)
class Many:
    """The estimates from many logs, and the findings on these estimates.

    Attributes
    ----------
    table : DataFrame
        One row for each log. The columns are ``name`` and ``name_sd`` for each parameter, and one
        column for each covariate.
    explained : dict of str to Explained
        Effects of the covariates on each parameter, and the change of this parameter.
    findings : list of Finding
        One finding for each parameter, and one for each log that could not be used.
    """

    table: pd.DataFrame
    explained: dict[str, Explained]
    findings: list[Finding]

    @property
    def status(self) -> int:
        """Exit status: 1 if a parameter changed or a log could not be used, else 0."""
        return int(any(one.kind != "ok" for one in self.findings))


def find_logs(folder: Path) -> list[Path]:
    """Return the logs of a folder, sorted by name and by the value of numbers in the name.

    Files that flexaxis wrote into the folder are skipped.

    Raises
    ------
    LogError
        If the folder contains no log.
    """
    logs = [
        path
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES and path.name[0] != "." and not path.stem.endswith(MADE)
    ]
    if not logs:
        raise LogError(f"{folder}: contains no log. Names of logs end in {', '.join(SUFFIXES)}")
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
        Paths of the logs, in order of time.
    axis : Axis
        Identified axis. An axis without standard deviations is identified from the first log.
    tables : mapping
        Options for reading a log, which are those of `importing.import_log`.
    covariates : sequence of str
        Names of columns of the logs. A covariate is the mean of such a column in each log.
    free : sequence of str
        Parameters to estimate. By default, these are all parameters whose standard deviation in the
        axis file is less than 10 % of the value.
    false_alarms : float
        Maximum probability that a change is reported although no parameter changed.
    """
    rows, findings = dict[str, dict[str, float]](), list[Finding]()
    for path in logs:
        try:
            record = import_log(path, **tables).record
            if not (axis.known and (free or axis.deviation)):
                axis = identify(record, axis).axis
            known, nominal = axis.deviation, axis.model.nominal
            free = free or [n for n in nominal if known.get(n, np.inf) < SEEN * abs(nominal[n])]
            names = free_names(axis, free, ())
            setup = Setup(log_of(record, axis), axis.model, names, delay=axis.delay)
            fit = Fit(setup, setup.solve(rounds=ROUNDS))
            row = dict(zip(names, fit.fitted.z.tolist(), strict=False))
            sds = fit.deviations.tolist()
            row |= {f"{name}_sd": sd for name, sd in zip(names, sds, strict=False)}
            if covariates:
                columns = open_log(path, tables.get("header")).read(covariates)
                row |= {name: float(np.nanmean(column)) for name, column in columns.items()}
            rows[path.name] = row
        except FlexaxisError as error:
            findings.append(Finding("problem", f"{path.name} is left out: {error}"))
    table = pd.DataFrame.from_dict(rows, orient="index")
    if not (rows and free):
        texts = "; ".join(one.text for one in findings)
        raise LogError(texts or "no parameter is known to within 10 %. Give --free NAME")
    beside = table[list(covariates)].to_numpy(float)
    explained = {
        name: explain(table[name].to_numpy(), table[f"{name}_sd"].to_numpy(), beside,
                      false_alarms=false_alarms / len(free))
        for name in free
    }  # fmt: skip
    sentences = [_sentence(name, one, table, covariates) for name, one in explained.items()]
    return Many(table, explained, [*sorted(sentences, key=lambda f: f.kind == "ok"), *findings])


def _sentence(name: str, one: Explained, table: pd.DataFrame, covariates: Sequence[str]) -> Finding:
    """Return the finding on one parameter."""
    level, ends = abs(one.level), table.index[[one.begin, one.end]]
    changed = one.kind != "constant" and abs(one.size) > SMALLEST
    text = f"{name} = {one.level:.4g}, no change"
    if changed:
        text = clause(name, one, one.size, *ends)
        text += f" (probability that noise alone causes this: {one.chance:.1g})"
    for column, slope, sd in zip(covariates, one.slopes, one.slope_deviations, strict=True):
        if abs(slope) > max(SURE * sd, SMALLEST * level / float(np.ptp(table[column]))):
            size = f"{100 * slope / level:+.2g} ± {100 * sd / level:.1g} %"
            text += f"; {size} for each unit of {column}"
    return Finding("note" if changed else "ok", text)
