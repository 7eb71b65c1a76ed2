"""Judged runs of one estimator on one scenario, pooled into a row of a table."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acceptance.friction import Judged
from flexaxis.experiments.scoring.pools import scatter


@dataclass(frozen=True)
class Row:
    """
    Many runs pooled; None is what is not defined.

    Attributes
    ----------
    bias, std : dict of str to float
        Mean error, and deviation about it over time and runs [% of nominal].
    error : dict of str to float
        Standard error of the bias over runs [% of nominal].
    lag, t10 : float or None
        Mean [s], and median [s].
    efficiency : dict of str to float
        Mean lag over that on the bound, by what is unknown there.
    found, named, renamed : float or None
        Shares of the faults [%]; names of those found.
    covered : float or None
        Share of the stated intervals that hold the truth [%].
    false : float
        Alarms outside the windows of faults in 2000 s.
    alarms : float
        Per minute, over the same time.
    further : float
        Alarms in the windows of faults beyond one for each, a run.
    cost : float
        Median [µs a sample].
    lost, runs : int
    """

    bias: dict[str, float]
    std: dict[str, float]
    error: dict[str, float]
    lag: float | None
    t10: float | None
    efficiency: dict[str, float]
    found: float | None
    named: float | None
    renamed: float | None
    covered: float | None
    false: float
    alarms: float
    further: float
    cost: float
    lost: int
    runs: int


def pooled(runs: Sequence[Judged]) -> Row:
    """Runs of one estimator on one scenario as one row."""
    names = list(runs[0].bias)
    gone = np.array([run.lost for run in runs])
    bias = {n: np.array([run.bias[n] for run in runs]) for n in names}
    std = {n: np.array([run.std[n] for run in runs]) for n in names}
    pairs = [pair for run in runs for pair in zip(run.faults, run.found, strict=True)]
    met = [(fault, found) for fault, found in pairs if found is not None]
    lags = column(runs, "lag")
    settled = [np.inf if run.t10 is None else run.t10 for run in runs if run.lag is not None]
    rate = sum(run.false for run in runs) / max(sum(run.calm for run in runs), 1e-9)
    return Row(
        bias={n: float(bias[n].mean()) for n in names},
        std={n: scatter(std[n], bias[n], gone) for n in names},
        error={n: float(bias[n].std(ddof=1) / np.sqrt(len(runs))) for n in names},
        lag=mean(lags),
        t10=float(np.median(settled)) if settled else None,
        efficiency={
            known: np.mean(lags) / np.mean([run.bounds[known] for run in runs])
            for known in runs[0].bounds
        },
        found=share([found is not None for _, found in pairs]),
        named=share([found.named == (fault,) for fault, found in met]),
        renamed=share([found.renamed == (fault,) for fault, found in met]),
        covered=share([found.covered for _, found in met if found.covered is not None]),
        false=2000 * rate,
        alarms=60 * rate,
        further=float(np.mean([max(run.alarms - run.false - len(run.faults), 0) for run in runs])),
        cost=float(np.median([run.cost for run in runs])),
        lost=int(gone.sum()),
        runs=len(runs),
    )


def column(runs: Sequence[Judged], name: str) -> list[float]:
    return [value for run in runs if (value := getattr(run, name)) is not None]


def mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def share(values: Sequence[bool]) -> float | None:
    return 100 * float(np.mean(values)) if values else None
