"""Write the tables of docs/control.md: `python docs/control_suite.py`, or names of some of them.

`worth` is of results/control, which is run if it is not there, ten minutes; `order` runs the
estimators at some settings of their knobs besides, on the records of the same seeds, some minutes.
"""

import sys
import warnings
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import pandas as pd
from making import table, write
from scipy.stats import spearmanr
from suite_rows import HOME, SEEDS, WHO, changed, said

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.experiments.comparison.matching import Setting, match
from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.comparison.sweep import FACTORS
from flexaxis.experiments.comparison.tune import with_knob
from flexaxis.experiments.running.case import track_of
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.score_table import rows as scores
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate


def worth() -> str:
    """Return what each estimator recovers, beside what a fault costs and the told one recovers."""
    rows = []
    for name in find_suite("control").scenarios:
        first = changed("control", name, "glr")
        assert first is not None
        errors = first["tracking"]
        cost = f"{1000 * errors['without_fault']:.3g} → {1000 * errors['frozen']:.3g}"
        cells = [_recovered(changed("control", name, who)) for who in WHO["control"]]
        rows.append([f"`{name}`", cost, _percent(first, "recovered_told"), *cells])
    heads = ["scenario", "error without → with the fault [mrad]", "told the truth"]
    heads += [f"`{who}`" for who in WHO["control"]]
    return table(heads, rows) + said("control", "control_suite")


def _percent(row: Mapping[str, Any], key: str) -> str:
    if row[key] is None:
        return "–"
    within = row.get(f"{key}_interval")
    return f"{row[key]:.0f}" + (f" ± {(within[1] - within[0]) / 2:.2g}" if within else "")


def _recovered(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "–"
    acts = row["tracking"]["limited"]
    lag = "" if row["lag"] is None else f"; {row['lag']:.2g} s"
    return _percent(row, "recovered") + lag + (f"; limits {acts:.0f}" if acts >= 0.5 else "")


TURNS = (1 / 16, *FACTORS, 16.0)  # of the knob, over its default


def at_equal_noise(name: str, given: Mapping[str, Any] | None) -> dict[str, tuple[float, str]]:
    """Return the lag [s] of each estimator whose std before the fault is that of the reference.

    `given` is the row of the reference. With a lag stands "quieter" or "noisier" for one that is so
    at all settings of its knob, by its nearest one. None is among them that has no lag in some run,
    or no knob, as one with options.
    """
    scenario = find_scenario(name)
    records = simulate(scenario, range(1000, 1000 + SEEDS))
    lines = {
        who: [_at(who, turn, scenario, records, given["parameter"]) for turn in TURNS]
        for who in WHO["control"]
        if given and with_knob(who, 2.0) not in {who, None}
    }
    found = {}
    for who, line in lines.items():
        zero = next(s for s in lines[REFERENCE] if s and s.factor == 1.0)
        met = match(zero, [s for s in line if s], "std")
        lags = met.at("lag") if met else None
        if met and lags is not None:
            found[who] = float(np.exp(np.mean(lags))), met.how.replace("matched", "")
    return found


def _at(
    who: str, turn: float, scenario: Scenario, records: list[Record], parameter: str
) -> Setting | None:
    """Return an estimator with its knob turned, None where it cannot be, or does not know it."""
    text, runs = with_knob(who, turn), []
    if text is None:
        return None
    for record in records:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # one that is lost may overflow
            estimator = build(parse(text), scenario)
            theta = run_estimator(estimator, record.torque, getattr(record, estimator.output))
        track = track_of(scenario, record, tuple(estimator.names), theta, None, None, None)
        runs.append(scores(track))
    if parameter not in {row["parameter"] for row in runs[0]}:
        return None
    return Setting.of(
        text, turn, pd.json_normalize([row for run in runs for row in run]), parameter, scenario
    )


def order() -> str:
    """Return whether the ranking by lag is that by what is recovered."""
    rows, found = [], []
    names = find_suite("control").scenarios
    rankings = {name: {w: changed("control", name, w) for w in WHO["control"]} for name in names}
    given = [rankings[name][REFERENCE] for name in names]
    with ProcessPoolExecutor() as pool:
        at_equal = dict(zip(names, pool.map(at_equal_noise, names, given), strict=True))
    for name, each in rankings.items():
        worth = {w: r["recovered"] for w, r in each.items() if r and r["recovered"] is not None}
        plain = {w: (r["lag"], "") for w, r in each.items() if r and r["lag"] is not None}
        cells, agree = [], []
        for lags in (plain, at_equal[name]):
            ranked = sorted(lags.keys() & worth, key=lambda w: lags[w][0])
            cells.append(", ".join(f"{w} {lags[w][0]:.2g} {lags[w][1]}".rstrip() for w in ranked))
            agree.append(_correlation([lags[w][0] for w in ranked], [worth[w] for w in ranked]))
        by_worth = ", ".join(sorted(worth, key=lambda w: -worth[w]))
        rows.append([f"`{name}`", *cells, by_worth, *(f"{x:+.2f}" for x in agree)])
        found.append(agree)
    rows.append(["mean", "", "", "", *(f"{x:+.2f}" for x in np.nanmean(found, axis=0))])
    heads = ["scenario", "the least lag first [s]", "the same at equal noise",
             "the most recovered first", "rank correlation", "at equal noise"]  # fmt: skip
    return table(heads, rows).replace("+nan", "–") + said("control", "control_suite")


def _correlation(lags: list[float], worths: list[float]) -> float:
    """Return the rank correlation of speed and worth, NaN of fewer than three."""
    return spearmanr(lags, -np.array(worths)).statistic if len(lags) > 2 else np.nan


TABLES: Mapping[str, Callable[[], str]] = {"worth": worth, "order": order}


if __name__ == "__main__":
    write(HOME / "control.md", TABLES, sys.argv[1:])
