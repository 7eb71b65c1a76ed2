"""What each estimator is worth at the one setting that it was run at, seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison.sweep import Setting, listed
from flexaxis.experiments.running.results import Results


def as_set(results: Results, pooled: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """
    Return what each estimator is worth at the one setting it was run at, seed by seed.

    Parameters
    ----------
    results : Results
        Of a run.
    pooled : sequence of mapping
        Its rows pooled by scenario and estimator.

    Returns
    -------
    list of dict
        One for each fault and estimator with a lag and a standard deviation in every run:
        ``scenario, parameter, estimator, lag, std, diverged,
        seeds`` and ``values`` of lag and std: their logarithms, as the jackknife's values, by
        all the seeds of the fault; None where the estimator has none.
    """
    found = []
    parts = [*results.groups("scenario", "estimator", "parameter", "changed")]
    seeds: dict[tuple[str, str], NDArray[np.float64]] = {}
    for key, part in parts:  # the seeds on which any estimator ran
        known = seeds.get(_fault(key), np.empty(0))
        seeds[_fault(key)] = np.union1d(known, part["seed"].to_numpy(float))
    for (_, columns), row in zip(parts, pooled, strict=True):
        setting = Setting(row["estimator"], 1.0, columns)
        values = {name: listed(setting.at(name)) for name in ("lag", "std")}
        if not row["changed"] or None in (row["lag"], row["std"], *values.values()):
            continue
        every = seeds[_fault(row)]
        place = np.searchsorted(every, columns["seed"])
        placed = {name: _placed(each or (), place, len(every)) for name, each in values.items()}
        own = {"scenario": row["scenario"], "estimator": row["estimator"], "values": placed}
        found.append(own | {name: row[name] for name in _POOLED})
    return found


_POOLED = ("parameter", "seeds", "lag", "lag_interval", "std", "std_interval", "diverged")


def _fault(key: Mapping[str, Any]) -> tuple[str, str]:
    return key["scenario"], key["parameter"]


def _placed(values: Sequence[float], place: NDArray[np.intp], size: int) -> list[float | None]:
    found: list[float | None] = [None] * size
    for number, value in zip(place, values, strict=True):
        found[number] = value
    return found
