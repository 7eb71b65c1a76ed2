"""What each estimator is worth at the one setting that it was run at, seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.comparison.matching import Setting, plain
from flexaxis.experiments.comparison.sweep import listed
from flexaxis.experiments.results.groups import Groups


def as_set(groups: Groups, pooled: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """
    Return what each estimator is worth at the one setting it was run at, seed by seed.

    Parameters
    ----------
    groups : Groups
        Of the rows of a run, by scenario (base) and estimator (method).
    pooled : sequence of mapping
        What `groups.pooled` gives.

    Returns
    -------
    list of dict
        One for each fault and estimator with a lag and a standard deviation in every run:
        ``scenario, parameter, estimator, lag, std, diverged,
        seeds`` and ``values`` of lag and std: their logarithms, as the jackknife's values, by
        all the seeds of the fault; None where the estimator has none.
    """
    found = []
    seeds = _seeds(groups)
    for group, row in enumerate(pooled):
        columns = groups.columns(group)
        rows = pd.DataFrame({name: columns[name] for name in _OF_NOISE})
        setting = Setting(row["method"], 1.0, rows)
        values = {name: listed(plain(setting, name)) for name in ("lag", "std")}
        if not row["changed"] or None in (row["lag"], row["std"], *values.values()):
            continue
        every = seeds[_fault(row)]
        place = np.searchsorted(every, columns["seed"])
        placed = {name: _placed(each or (), place, len(every)) for name, each in values.items()}
        own = {"scenario": row["base"], "estimator": row["method"], "values": placed}
        found.append(own | {name: row[name] for name in _POOLED})
    return found


_OF_NOISE = ("lag", "std", "bias", "lost_before")
_POOLED = ("parameter", "seeds", "lag", "lag_interval", "std", "std_interval", "diverged")


def _fault(key: Mapping[str, Any]) -> tuple[str, str]:
    return key["base"], key["parameter"]


def _seeds(groups: Groups) -> dict[tuple[str, str], NDArray[np.float64]]:
    """Return the seeds on which anyone ran, by fault: an estimator may have failed on some."""
    found: dict[tuple[str, str], list[NDArray[np.float64]]] = {}
    for group, key in enumerate(groups.keys):
        found.setdefault(_fault(key), []).append(groups.columns(group)["seed"])
    return {fault: np.unique(np.concatenate(each)) for fault, each in found.items()}


def _placed(values: Sequence[float], place: NDArray[np.intp], size: int) -> list[float | None]:
    found: list[float | None] = [None] * size
    for number, value in zip(place, values, strict=True):
        found[number] = value
    return found
