"""What each estimator is worth at the one setting that it was run at, seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.comparison.matching import Setting, plain
from flexaxis.experiments.results.groups import Groups
from flexaxis.experiments.scoring.pooling import count, deviation, geometric
from flexaxis.experiments.studies.sweep import listed


def as_set(groups: Groups) -> list[dict[str, Any]]:
    """
    Return what each estimator is worth at the one setting it was run at, seed by seed.

    Parameters
    ----------
    groups : Groups
        Of the rows of a run, by scenario (base) and estimator (method).

    Returns
    -------
    list of dict
        One for each fault and estimator: ``scenario, parameter, estimator, lag, std, diverged,
        seeds`` and ``values`` of lag and std: their logarithms, as the jackknife's values, by
        all the seeds of the fault; None where the estimator has none.
    """
    found = []
    seeds = _seeds(groups)
    for group, key in enumerate(groups.keys):
        if not key["changed"]:
            continue
        columns = {name: groups.columns(group)[name] for name in _AS_SET}
        there = ~np.isnan(columns["lag"]) & ~np.isnan(columns["std"])
        place = np.searchsorted(seeds[_fault(key)], groups.columns(group)["seed"][there])
        columns = {name: values[there] for name, values in columns.items()}
        rows = [
            dict(zip(columns, line, strict=True)) for line in zip(*columns.values(), strict=True)
        ]
        if not rows:
            continue
        setting = Setting(key["method"], 1.0, rows)
        values = {name: plain(setting, name) for name in ("lag", "std")}
        found.append(
            {
                "scenario": key["base"],
                "parameter": key["parameter"],
                "estimator": key["method"],
                "seeds": len(rows),
                **geometric(columns, "lag"),
                **deviation("bias", "lost_before")(columns, "std"),
                **count(columns, "diverged"),
                "values": {
                    name: each and _placed(each, place, len(seeds[_fault(key)]))
                    for name, each in ((name, listed(each)) for name, each in values.items())
                },
            }
        )
    return found


_AS_SET = ("lag", "std", "bias", "lost_before", "diverged", "seed", "point")


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
