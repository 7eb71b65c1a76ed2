"""
Run estimators over their own knobs, and compare them at equal noise.

One setting of a knob ranks nothing: whoever forgets faster is faster and noisier. So each estimator
is swept over its knob, and compared where its standard deviation is that of a reference.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments import harness
from flexaxis.experiments.cache import RecordCache
from flexaxis.experiments.knobs import with_knob
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.intervals import FLOOR, mean_interval
from flexaxis.experiments.scoring.matching import (
    NOISIER,
    QUIETER,
    Match,
    Noise,
    Setting,
    match,
    plain,
)
from flexaxis.experiments.scoring.pooling import pool_group, pool_rows
from flexaxis.experiments.scoring.pools import mean
from flexaxis.experiments.scoring.ranking import REFERENCE, mark
from flexaxis.sim.scenario import Scenario

FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the default setting, in what the knob gives of speed
WIDER = (16.0, 64.0, 256.0, 1024.0)  # and its inverse, where these do not reach the reference


def settings(
    estimators: Sequence[str], *, factors: Sequence[float] = FACTORS
) -> dict[str, tuple[str, float]]:
    """Return the settings of a first sweep, each with its estimator and the turn of its knob.

    One without a knob has one setting; the reference is among them.
    """
    found: dict[str, tuple[str, float]] = {}
    for name in estimators:
        for factor in factors:
            text = with_knob(name, factor)
            if text is not None:
                found.setdefault(text, (name, 1.0 if text == name else factor))
    return found | {reference(): (REFERENCE, 1.0)}


def reference() -> str:
    """Return the setting that others are compared with at equal noise."""
    text = with_knob(REFERENCE, 1.0)
    assert text is not None  # it has a knob, whose default is allowed
    return text


@dataclass(frozen=True)
class Sweep:
    """What a sweep over the knobs found; all of it is JSON.

    Attributes
    ----------
    points : list of dict
        One for each fault, estimator and setting: ``scenario, parameter, estimator, setting,
        factor``, pooled ``lag, lag_interval, t10, std, std_interval, std_after, excess, diverged,
        seeds``, ``lag_bound`` and ``lag_bound_single``.
    matched : list of dict
        One for each fault and estimator, at the std of the reference in the parameter that
        changes: ``how`` (see `scoring.matching.Match`), ``settings, ratio, lag, lag_interval,
        bound, over_bound, over_single, std_after, false_alarms_per_1000_s, leads``, and
        ``values`` seed by seed (ln of lag and std after; false alarms).
    at_excess : list of dict
        The same at the excess error of the reference, with ``score``.
    """

    points: list[dict[str, Any]]
    matched: list[dict[str, Any]]
    at_excess: list[dict[str, Any]]


def sweep(
    scenarios: Sequence[Scenario],
    estimators: Sequence[str],
    seeds: Sequence[int],
    *,
    factors: Sequence[float] = FACTORS,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[harness.Done], None] | None = None,
) -> Sweep:
    """
    Run every estimator at several settings of its knob, and match them to the reference.

    Where these settings are all quieter than the reference, or all noisier, the knob is turned
    further, up to 1024 times, as far as the estimator allows.
    """
    held: dict[str, dict[str, Held]] = {scenario.name: {} for scenario in scenarios}

    def run(where: Sequence[Scenario], texts: Mapping[str, tuple[str, float]]) -> None:
        for done in harness.run(where, list(texts), seeds, jobs=jobs, store=store):
            for case in done.cases:
                name, factor = texts[case.estimator]
                group = held[case.scenario].setdefault(case.estimator, Held(name, factor, []))
                group.cases.append(replace(case, curve=_NOTHING, relative={}))
            if advance:
                advance(done)

    run(scenarios, settings(estimators, factors=factors))
    for factor in WIDER:
        for scenario in scenarios:
            more = _further(scenario, held[scenario.name], estimators, factor)
            try:
                run([scenario], more)
            except EstimatorError:  # so far the knob does not turn
                for text in more:
                    held[scenario.name].pop(text, None)
    return _matched(scenarios, held, estimators)


@dataclass(frozen=True)
class Held:
    """The cases of one setting on one scenario, in the order of the seeds."""

    estimator: str
    factor: float
    cases: list[harness.Case]


_NOTHING = np.empty((0, 0), np.float32)


def _further(
    scenario: Scenario, held: Mapping[str, Held], estimators: Sequence[str], factor: float
) -> dict[str, tuple[str, float]]:
    """Return settings beyond those run, for estimators that do not reach the reference yet."""
    more: dict[str, tuple[str, float]] = {}
    for name in estimators:
        faults = _faults(held, name)
        how = {
            found.how
            for parameter in faults
            for noise in ("std", "excess")
            if (found := _match(scenario, held, name, parameter, noise)) is not None  # type: ignore[arg-type]
        }
        for side, turn in ((QUIETER, factor), (NOISIER, 1 / factor)):
            text = with_knob(name, turn) if side in how else None
            if text is not None and text != name:
                more[text] = (name, turn)
    return more


def _faults(held: Mapping[str, Held], estimator: str) -> list[str]:
    """Return the parameters of an estimator that change."""
    mine = next(group for group in held.values() if group.estimator == estimator)
    return [row["parameter"] for row in mine.cases[0].rows if row["changed"]]


def _match(
    scenario: Scenario, held: Mapping[str, Held], estimator: str, parameter: str, noise: Noise
) -> Match | None:
    mine = [g for g in held.values() if g.estimator == estimator]
    own = [_setting(scenario, group, parameter) for group in mine]
    return match(_setting(scenario, held[reference()], parameter), own, noise)


def as_set(cases: Sequence[harness.Case]) -> list[dict[str, Any]]:
    """
    Return what each estimator is worth at the one setting it was run at, seed by seed.

    Returns
    -------
    list of dict
        One for each fault and estimator: ``scenario, parameter, estimator, lag, std, diverged,
        seeds`` and ``values`` of lag and std: their logarithms, as the jackknife's values.
    """
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for case in cases:
        for row in case.rows:
            if row["changed"] and row["lag"] is not None and row["std"] is not None:
                key = row["scenario"], row["parameter"], row["estimator"]
                groups.setdefault(key, []).append(row)
    found = []
    for (scenario, parameter, estimator), rows in groups.items():
        setting = Setting(estimator, 1.0, rows)
        values = {name: plain(setting, name) for name in ("lag", "std")}
        found.append(
            {
                "scenario": scenario,
                "parameter": parameter,
                "estimator": estimator,
                "seeds": len(rows),
                **{key: pool_rows(rows, period=1.0)[key] for key in ("lag", "std", "diverged")},
                "values": {name: _listed(each) for name, each in values.items()},
            }
        )
    return found


def _setting(scenario: Scenario, group: Held, parameter: str) -> Setting:
    cases = group.cases
    biases = [{row["parameter"]: row["bias"] or 0.0 for row in case.rows} for case in cases]
    return Setting(
        text=cases[0].estimator,
        factor=group.factor,
        rows=[next(r for r in case.rows if r["parameter"] == parameter) for case in cases],
        biases=np.array([[each.get(n, 0.0) for n in scenario.identify] for each in biases]),
        information=information(scenario),
    )


def _matched(
    scenarios: Sequence[Scenario],
    held: Mapping[str, Mapping[str, Held]],
    estimators: Sequence[str],
) -> Sweep:
    points: list[dict[str, Any]] = []
    at_std: list[dict[str, Any]] = []
    at_excess: list[dict[str, Any]] = []
    for scenario in scenarios:
        mine = held[scenario.name]
        for group in mine.values():
            if group.estimator in estimators:
                points += _points(scenario, group)
        for name in estimators:
            for parameter in _faults(mine, name):
                for noise, into in (("std", at_std), ("excess", at_excess)):
                    found = _match(scenario, mine, name, parameter, noise)  # type: ignore[arg-type]
                    if found is not None:
                        bounds = next(g for g in mine.values() if g.estimator == name)
                        into.append(_row(scenario, name, parameter, found, bounds))
    return Sweep(points, mark(at_std), at_excess)


def _points(scenario: Scenario, group: Held) -> list[dict[str, Any]]:
    return [
        {key: row[key] for key in _KEPT}
        | {"estimator": group.estimator, "setting": row["estimator"], "factor": group.factor}
        for row in pool_group(group.cases, scenario)
        if row["changed"]
    ]


_KEPT = (
    "scenario", "parameter", "lag", "lag_interval", "t10", "std", "std_interval", "std_after",
    "excess", "diverged", "seeds", "lag_bound", "lag_bound_single",
)  # fmt: skip


def _row(
    scenario: Scenario, estimator: str, parameter: str, found: Match, group: Held
) -> dict[str, Any]:
    """Return what is said of an estimator at equal noise, with the values it rests on."""
    lag, after, score = (found.at(name) for name in ("lag", "std_after", "score"))
    rows = [next(r for r in case.rows if r["parameter"] == parameter) for case in group.cases]
    bounds = {key: mean(rows, key)[key] for key in ("lag_bound", "lag_bound_single")}
    middle = None if lag is None else float(np.exp(lag.mean()))
    within = None if lag is None else mean_interval(lag)
    false = found.false_alarms()
    return {
        "scenario": scenario.name,
        "parameter": parameter,
        "estimator": estimator,
        "how": found.how,
        "settings": list(found.settings),
        "ratio": found.ratio,
        "lag": middle,
        "lag_interval": within and [float(np.exp(end)) for end in within],
        "bound": bounds["lag_bound"],
        "bound_single": bounds["lag_bound_single"],
        "over_bound": _over(middle, bounds["lag_bound"]),
        "over_single": _over(middle, bounds["lag_bound_single"]),
        "score": None if score is None else float(score.mean()),
        "std_after": None if after is None else _exp(after.mean()),
        "false_alarms_per_1000_s": None
        if false is None
        else 1000 * float(np.mean(false)) / scenario.duration,
        "values": {
            "lag": _listed(lag),
            "std_after": _listed(after),
            "score": _listed(score),
            "false_alarms": _listed(false),
        },
    }


def _listed(values: Any) -> list[float] | None:
    return None if values is None else [float(f"{value:.6g}") for value in values]


def _exp(value: float) -> float:
    """Return a score from its logarithm; on the floor it is none."""
    return 0.0 if value <= np.log(FLOOR) + 1e-9 else float(np.exp(value))


def _over(value: float | None, limit: float | None) -> float | None:
    return value / limit if value and limit else None
