"""One estimator on one record, from file to file, in pieces: a record of any length will do."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.protocol import Estimator, run_estimator, theta_of
from flexaxis.experiments.building.away import there
from flexaxis.experiments.building.estimator_text import Spec, build
from flexaxis.experiments.building.guest import hosted
from flexaxis.experiments.scoring.parameter_names import physical, true_theta
from flexaxis.experiments.scoring.summary import Case
from flexaxis.experiments.storage.files import TRAJECTORIES, writing
from flexaxis.sim.errors import RecordError
from flexaxis.sim.record import Record, count_samples, record_pieces
from flexaxis.sim.scenario import Scenario, scenario_from

Array = NDArray[np.float64]
PIECE = 20_000  # samples in memory at a time


@dataclass(frozen=True)
class Estimated:
    """What is known when all samples are through.

    Attributes
    ----------
    last, truth : dict of str to float
        Last estimates by parameter, and their true values there, where the record knows them.
    samples : int
        Samples read.
    """

    last: dict[str, float]
    truth: dict[str, float]
    samples: int


def estimate(
    source: Path,
    spec: Spec,
    target: Path,
    *,
    scenario: Scenario | None = None,
    covariance: bool = True,
    advance: Callable[[int], None] | None = None,
) -> Estimated:
    """Run an estimator on a record file and write the estimates to another, at once or not at all.

    The file has `time` (time), `theta` (time, estimate), the names as coordinate `estimate`, and
    `covariance` (time, estimate, estimate) where the estimator claims one.

    Parameters
    ----------
    source, target : Path
        NetCDF-4 files.
    spec : Spec
        The estimator, as from `flexaxis.experiments.building.estimator_text.parse`.
    scenario : Scenario, optional
        What the estimator is told; the record's own by default.
    covariance : bool
        Whether to write it; without it, an estimator's fast `run` can be used.
    advance : callable, optional
        Called with the number of samples done since the last call.

    Raises
    ------
    EstimatorError, RecordError, OutputError
        If the record cannot be used, lacks what the estimator reads, or the target cannot be
        written. Nothing is left of a target that is not complete.
    """
    pieces = record_pieces(source, samples=PIECE)
    first = next(pieces)
    estimator = build(spec, scenario or _own_scenario(first, source))
    if getattr(first, estimator.output, None) is None:
        raise EstimatorError(f"{spec.text} reads {estimator.output!r}, which {source} lacks")
    claims = covariance and hasattr(estimator, "covariance")
    names, samples = tuple(estimator.names), 0
    claimed: Literal["covariance"] | None = "covariance" if claims else None
    with estimates_file(target, names, count_samples(source), claimed=claimed) as file:
        file.attrs.update(estimator=spec.text, options=json.dumps(dict(spec.options)))
        file.attrs["record_hash"] = first.hash
        for piece in chain([first], pieces):
            where: dict[str, Any] = {"first": samples, "period": piece.period, "refusing": True}
            with hosted(spec.text, f"on {source}", **where):
                theta, sure, _ = run_on(estimator, piece, claims=claims)
            span = slice(samples, samples + len(theta))
            file["time"][span], file["theta"][span] = piece.time, theta
            if sure is not None:
                file["covariance"][span] = sure
            samples = span.stop
            if advance:
                advance(len(theta))
    last = dict(zip(names, theta[-1].tolist(), strict=True))
    return Estimated(last, true_values(names, piece, -1), samples)


def true_values(names: Sequence[str], record: Record, at: Any) -> dict[str, Any]:
    """Return the true values of those parameters that a record knows, at some of its samples."""
    known = [name for name in names if physical(name)[0] in record.parameter_names]
    if record.true_parameters is None or not known:
        return {}
    values = true_theta(known, record.true_parameters[at], record.parameter_names)
    return dict(zip(known, values.T, strict=True))


def run_on(
    estimator: Estimator, piece: Record, *, claims: bool = True
) -> tuple[Array, Array | None, NDArray[np.bool_]]:
    """Run an estimator on a record or a piece of one, going on from where it is.

    Parameters
    ----------
    estimator : Estimator
    piece : Record
    claims : bool
        Whether to ask for the claimed covariance and alarms after every sample, if it has them;
        if not, or if it has none, its fast `run` is used.

    Returns
    -------
    theta : ndarray (n, p)
    covariance : ndarray (n, p, p) or None
    alarms : ndarray (n,) of bool
    """
    y = getattr(piece, estimator.output)
    return there(_run_on, estimator, piece.torque, y, piece.valid, claims)


def _run_on(
    estimator: Estimator, u: Array, y: Array, valid: NDArray[np.bool_] | None, claims: bool
) -> tuple[Array, Array | None, NDArray[np.bool_]]:
    n, p = len(y), len(estimator.names)
    alarms = np.zeros(n, bool)
    sure = claims and hasattr(estimator, "covariance")
    if not sure and not (claims and hasattr(estimator, "alarm")):
        return run_estimator(estimator, u, y, valid), None, alarms
    theta, claimed = np.empty((n, p)), np.empty((n, p, p))
    present = np.ones(n, bool) if valid is None else valid
    for k in range(n):
        try:
            given = estimator.step(u[k], y[k] if present[k] else None)
            theta[k] = theta_of(given, estimator.names, estimator)
        except BaseException as error:
            error.at_sample = k  # type: ignore[attr-defined]  # for whoever says where it was
            raise
        if sure:
            claimed[k] = estimator.covariance  # type: ignore[attr-defined]
        alarms[k] = getattr(estimator, "alarm", False)
    return theta, claimed if sure else None, alarms


@contextmanager
def estimates_file(
    path: Path,
    names: Sequence[str],
    samples: int,
    *,
    claimed: Literal["covariance", "deviation"] | None = None,
) -> Iterator[Any]:
    """Give a file of estimates to be filled: time, theta, names, and what the estimator claims.

    Raises
    ------
    OutputError
        If it cannot be written; it gets its name when it is complete.
    """
    from flexaxis.sim.storage.netcdf import add, declare, new_netcdf

    shape = {"time": samples, "estimate": len(names)}
    with writing(path), new_netcdf(path) as file:
        declare(file, "time", {"time": samples}, float, units="s")
        add(file, "estimate", ("estimate",), names)
        declare(file, "theta", shape, float, long_name="estimates, SI units")
        if claimed == "covariance":  # each dimension of a variable must be another one
            shape["estimate_2"] = len(names)
        if claimed:
            declare(file, claimed, shape, float, long_name=f"{claimed} that the estimator claims")
        yield file


def keep_all(folder: Path, kept: Iterable[tuple[Mapping[str, Any], Case]]) -> None:
    """Write estimates to FOLDER/trajectories/CASE.nc, in the form of `flexaxis estimate`.

    Parameters
    ----------
    folder : Path
    kept : iterable of (mapping, Case)
        Cases, each with a row.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    for row, case in kept:
        assert case.theta is not None
        target, samples = folder / TRAJECTORIES / f"{row['case']}.nc", len(case.theta)
        with writing(target):
            target.parent.mkdir(exist_ok=True)
        with estimates_file(target, case.names, samples) as file:
            file["time"][:] = np.arange(samples) * (row["seconds"] / samples)
            file["theta"][:] = case.theta
            file.attrs.update(estimator=case.estimator, record_hash=row["hash"], seed=row["seed"])


def _own_scenario(record: Record, source: Path) -> Scenario:
    if not record.scenario:
        raise RecordError(
            f"{source} does not say its scenario, so the nominal values and the parameters to "
            "identify are unknown: name one with --scenario"
        )
    return scenario_from(record.scenario, source=f"{source}, attribute scenario")
