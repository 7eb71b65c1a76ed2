"""What is found of faults, beside what is found by chance: the share over their size.

Each fault has a twin without it, on the same streams. A find names what changed, or is one that the
twin does not show. Who has findings has a rate of false alarms, which the twins tell; who has none
gets a threshold on its estimates that the twins cross at a rate asked for.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Finds:
    """The finds of an estimator at one size of a fault, 1 for the twins: found by chance.

    Attributes
    ----------
    axis, base, parameter, estimator : str
        The swept size, the scenario, the parameter that changes, and who looks for it.
    size : float
    share : float
        Of the runs, found within the time asked for.
    share_interval : list of float
        Its 95 % interval, over seeds.
    runs : int
    threshold : float or None
        Change of the estimate within 1 s that is an alarm [% of nominal]; None for an estimator
        with findings of its own.
    alarms : int
        False ones, in the twins: of all parameters.
    hours : float
        In which they were counted.
    per_hour_interval : list of float
        What they allow, in an hour; of none the one-sided limit.
    """

    axis: str
    base: str
    parameter: str
    estimator: str
    size: float
    share: float
    share_interval: list[float]
    runs: int
    threshold: float | None
    alarms: int
    hours: float
    per_hour_interval: list[float]


def finds(results: Results, *, within: float = 1.0, per_hour: float = PER_HOUR) -> list[Finds]:
    """Return the finds of each estimator over the size of each fault that has twins.

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

    Raises
    ------
    ValueError
        If it cannot be said for that time.
    """
    if within not in WITHIN:
        raise ValueError(unknown("time", str(within), map(str, WITHIN)))
    found: list[Finds] = []
    for size in filter(SIZE.fullmatch, results.axes):
        table = _table(results, size, within)
        twins = table[table["size"] == 1.0]
        for (base, estimator), own in twins.groupby(["scenario", "setting"], sort=False):
            everyone = table[(table["scenario"] == base) & (table["setting"] == estimator)]
            found += _finds(everyone, own, size, per_hour)
    return found


def _table(results: Results, size: str, within: float) -> pd.DataFrame:
    """Return a line a row, with ``size``, ``point`` (all axes but the size), and what was seen."""
    others = [axis for axis in results.axes if axis != size]
    numbers = {
        "seed": "seed", "after": "find.after", "named": "find.named", "moved": f"moved.{within}",
        "calm": "moved.calm", "watched": "moved.watched", "alarms": "detection.alarms",
        "false": "detection.false_alarms", "exposure": "detection.calm",
    }  # fmt: skip
    stored = results.frame[results.frame["parameter"] != ""].reset_index(drop=True)
    found = stored[["scenario", "setting", "parameter"]].assign(
        **{name: stored[column] for name, column in numbers.items()}
    )
    axes = zip(*(stored[axis] for axis in others), strict=True)
    found["point"] = [json.dumps(values, default=str) for values in axes] if others else ""
    found["size"] = pd.to_numeric(stored[size])
    found["changing"] = list(_changing(results, size, stored))
    found["seen"] = found["after"] <= within
    return found[found["size"].notna()]


def _changing(results: Results, size: str, rows: pd.DataFrame) -> Iterator[str]:
    """Yield the physical parameter that the fault is in, of each row."""
    fault = size.rpartition(".")[0]
    number = int(SIZE.fullmatch(size)[1])  # type: ignore[index]
    written = {
        entry["definition"]["name"]: entry["definition"]["fault"][number]["parameter"]
        for entry in results.study["scenarios"]
        if len(entry["definition"].get("fault", ())) > number
    }
    axis = f"{fault}.parameter"
    swept = rows[axis] if axis in results.axes else [None] * len(rows)
    for base, other in zip(rows["scenario"], swept, strict=True):
        yield meant(other or written.get(base, ""))


def _finds(own: pd.DataFrame, twins: pd.DataFrame, axis: str, per_hour: float) -> Iterator[Finds]:
    """Yield the finds of one estimator on one scenario."""
    own = own[own["parameter"].map(lambda name: physical(name)[0]) == own["changing"]]
    shows = bool(twins["alarms"].notna().any())
    limits: dict[str, float] = {}
    if shows:  # the same in all rows of a case
        cases = twins.drop_duplicates(["seed", "point"])
        counts, seconds = cases["false"].fillna(0.0), float(cases["exposure"].sum())
    else:
        limits, over = _thresholds(twins, per_hour)
        cases, counts = twins, over.astype(float)
        seconds = float(twins.drop_duplicates(["seed", "point"])["watched"].sum())
    if own.empty or not seconds:
        return
    allowed = rate_interval(counts, seconds / HOUR, cases["seed"])
    hit = _shown(own) if shows else own["moved"].fillna(0.0) > own["parameter"].map(limits)
    for (parameter, value), mine in own.groupby(["parameter", "size"]):
        yes = hit[mine.index]
        yield Finds(
            axis=axis,
            base=str(mine["scenario"].iloc[0]),
            parameter=parameter,
            estimator=str(mine["setting"].iloc[0]),
            size=float(value),
            share=float(yes.mean()),
            share_interval=share_interval(yes, mine["seed"], mine["point"]),
            runs=len(mine),
            threshold=limits.get(parameter),
            alarms=int(counts.sum()),
            hours=seconds / HOUR,
            per_hour_interval=allowed,
        )


def _thresholds(twins: pd.DataFrame, per_hour: float) -> tuple[dict[str, float], pd.Series]:
    """Return the threshold of each parameter, and which rows of the twins have crossed theirs.

    All parameters share the alarms that are asked for.
    """
    share = per_hour / HOUR / twins["parameter"].nunique()
    found = {}
    for parameter, mine in twins.groupby("parameter"):
        peaks = np.sort(mine["calm"].fillna(np.inf))[::-1]
        found[str(parameter)] = float(
            peaks[min(len(peaks) - 1, int(share * mine["watched"].sum()))]
        )
    return found, twins["calm"] > twins["parameter"].map(found)


def _shown(own: pd.DataFrame) -> pd.Series:
    """Return which runs are finds: they name what changed, or their twin shows nothing.

    A name that the twin says as well is no evidence.
    """
    keys = ["seed", "parameter", "point"]
    twins = own[own["size"] == 1.0].set_index(keys)[["seen", "named"]]
    beside = own[keys].join(twins, on=keys)
    twin, same = beside["seen"].fillna(False).astype(bool), beside["named"] == 1
    evidence = ~twin | ((own["named"] == 1) & ~same) | (own["size"] == 1.0)
    return own["seen"] & evidence
