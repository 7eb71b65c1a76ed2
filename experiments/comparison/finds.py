"""What is found of faults, beside what is found by chance: the share over their size.

Each fault has a twin without it, on the same streams. A find names what changed, or is one that the
twin does not show. Who has findings has a rate of false alarms, which the twins tell; who has none
gets a threshold on its estimates that the twins cross at a rate asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.study import SIZE
from flexaxis.experiments.scoring.detection import WITHIN
from flexaxis.experiments.scoring.intervals import rate_interval, share_interval
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.sim.errors import unknown
from flexaxis.sim.parameters import meant

PER_HOUR = 10.0  # false alarms of who gets a threshold: one in 18 runs of 20 s
HOUR = 3600.0  # s


def finds(results: Results, *, within: float = 1.0, per_hour: float = PER_HOUR) -> pd.DataFrame:
    """Return what each estimator finds over the size of each fault that has twins.

    What else is swept is pooled, with a seed as the unit of chance.

    Parameters
    ----------
    results : Results
        Of a study in which the size of a fault is swept, 1 among its values.
    within : float
        Seconds after the fault, one of `WITHIN`.
    per_hour : float
        False alarms in an hour, over all estimates, for who has no findings; in less time than it
        takes for one the twins have none.

    Returns
    -------
    DataFrame
        A row for each ``axis`` (the swept size), ``base`` (the scenario), ``parameter``,
        ``estimator`` and ``size``; size 1 is the twins. ``share`` of ``runs`` with a find and its
        ``share_interval`` over seeds (95 %); ``threshold``, the change of the estimate within 1 s
        that is an alarm [% of nominal], None for who has findings; ``alarms``, false ones in the
        twins, of all parameters, in ``hours``; ``per_hour_interval``, the rate that they allow.

    Raises
    ------
    ValueError
        If it is not known for that time.
    """
    if within not in WITHIN:
        raise ValueError(unknown("time", str(within), map(str, WITHIN)))
    lines: list[dict[str, Any]] = []
    for size in filter(SIZE.fullmatch, results.axes):
        for _, own in _table(results, size).groupby(["scenario", "setting"], sort=False):
            lines += _finds(own, size, within, per_hour)
    return pd.DataFrame(lines)


def _table(results: Results, size: str) -> pd.DataFrame:
    """Return the rows with ``size``, ``point`` (of all other axes), and what is ``changing``."""
    rows = results.frame[results.frame["parameter"] != ""]
    others = [axis for axis in results.axes if axis != size]
    fault, _, number = size.rpartition("]")[0].partition("[")
    definitions = [entry["definition"] for entry in results.study["scenarios"]]
    written = {d["name"]: d["fault"][int(number)]["parameter"]
               for d in definitions if len(d.get("fault", ())) > int(number)}  # fmt: skip
    swept = rows.get(f"{fault}[{number}].parameter", pd.Series(None, rows.index, dtype=object))
    return rows.assign(
        size=pd.to_numeric(rows[size]),
        point=rows.groupby(others, dropna=False).ngroup() if others else 0,
        changing=swept.fillna(rows["scenario"].map(written)).fillna("").map(meant),
    ).dropna(subset="size")


def _finds(
    own: pd.DataFrame, axis: str, within: float, per_hour: float
) -> Iterator[dict[str, Any]]:
    """Yield the finds of one estimator on one scenario."""
    twins = own[own["size"] == 1.0]
    cases = twins.drop_duplicates(["seed", "point"])  # counts are the same in all rows of a case
    limits: dict[str, float] = {}
    if twins["detection.alarms"].notna().any():
        hits, counted = _shown(own, within), cases
        alarms, watched = cases["detection.false_alarms"].fillna(0.0), cases["detection.calm"]
    else:
        limits, counted, watched = _thresholds(twins, per_hour), twins, cases["moved.watched"]
        alarms = (twins["moved.calm"] > twins["parameter"].map(limits)).astype(float)
        hits = own[f"moved.{within}"].fillna(0.0) > own["parameter"].map(limits)
    hours = watched.sum() / HOUR
    if not hours:
        return
    allowed = rate_interval(alarms, hours, counted["seed"])
    own = own[own["parameter"].map(lambda name: physical(name)[0]) == own["changing"]]
    for (base, who, parameter, size), part in own.groupby(
        ["scenario", "setting", "parameter", "size"]
    ):
        yes = hits[part.index]
        yield {
            "axis": axis, "base": base, "parameter": parameter, "estimator": who, "size": size,
            "share": yes.mean(), "runs": len(part), "threshold": limits.get(parameter),
            "share_interval": share_interval(yes, part["seed"], part["point"]),
            "alarms": int(alarms.sum()), "hours": hours, "per_hour_interval": allowed,
        }  # fmt: skip


def _thresholds(twins: pd.DataFrame, per_hour: float) -> dict[str, float]:
    """Return the threshold of each parameter; all share the alarms that are asked for."""
    share = per_hour / HOUR / twins["parameter"].nunique()
    limits = {}
    for parameter, own in twins.groupby("parameter"):
        peaks = np.sort(own["moved.calm"].fillna(np.inf))[::-1]
        allowed = int(share * own["moved.watched"].sum())
        limits[str(parameter)] = float(peaks[min(len(peaks) - 1, allowed)])
    return limits


def _shown(own: pd.DataFrame, within: float) -> pd.Series:
    """Return which runs are finds: they name what changed, or their twin shows nothing.

    A name that the twin says as well is no evidence.
    """
    keys = ["seed", "parameter", "point"]
    own = own.assign(seen=own["find.after"] <= within, named=own["find.named"] == 1)
    twins = own[own["size"] == 1.0].set_index(keys)[["seen", "named"]]
    beside = own[keys].join(twins, on=keys).fillna({"seen": False, "named": False}).astype(
        {"seen": bool, "named": bool})  # fmt: skip
    new = ~beside["seen"] | (own["named"] & ~beside["named"]) | (own["size"] == 1.0)
    return own["seen"] & new
