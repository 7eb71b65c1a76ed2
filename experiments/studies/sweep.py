"""
Run estimators over their own knobs, and compare them at equal noise.

One setting of a knob ranks nothing: whoever forgets faster is faster and noisier. So each estimator
is swept over its knob, and compared where its standard deviation is that of a reference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.comparison.matching import (
    NOISIER,
    QUIETER,
    Match,
    Noise,
    Setting,
    match,
)
from flexaxis.experiments.comparison.ranking import REFERENCE, mark
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.scoring.intervals import FLOOR, mean_interval
from flexaxis.experiments.scoring.pooling import mean
from flexaxis.experiments.scoring.summary import columns_of, pool_group
from flexaxis.experiments.scoring.windows import windows
from flexaxis.experiments.studies.bench import Bench, Runs
from flexaxis.experiments.studies.knobs import with_knob
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the default setting, in what the knob gives of speed
WIDER = (16.0, 64.0, 256.0, 1024.0)  # and its inverse, where these do not reach the reference
TURNS = (*FACTORS, *WIDER, *(1 / factor for factor in WIDER))
"""All turns that a sweep may take."""


Line = dict[str, float]  # settings of one estimator, with the turn of its knob


def settings(estimators: Sequence[str], *, factors: Sequence[float] = FACTORS) -> dict[str, Line]:
    """Return the settings that a first sweep runs of each estimator.

    One without a knob has one setting. Two estimators may share a setting, which is run once.
    """
    found: dict[str, Line] = {}
    for name in estimators:
        turned = {with_knob(name, factor): factor for factor in factors}
        found[name] = {t: 1.0 if t == name else f for t, f in turned.items() if t is not None}
    return found


def texts(lines: Mapping[str, Line]) -> list[str]:
    """Return all settings of a first sweep, each once, and the reference."""
    return list(dict.fromkeys([reference(), *(text for line in lines.values() for text in line)]))


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
        changes: ``how`` (see `comparison.matching.Match`), ``settings, nearest, ratio, lag,
        lag_interval, bound, over_bound, over_single, std_after, false_alarms_per_1000_s, leads``,
        and ``values`` seed by seed (ln of lag and std after; false alarms).
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
    bench: Bench,
    *,
    factors: Sequence[float] = FACTORS,
) -> Sweep:
    """
    Run every estimator at several settings of its knob, and match them to the reference.

    Where these settings are all quieter than the reference, or all noisier, the knob is turned
    further, up to 1024 times, as far as the estimator allows.

    Parameters
    ----------
    scenarios : sequence of Scenario
    estimators : sequence of str
    seeds : sequence of int
    bench : Bench
        Where the cases are run.
    factors : sequence of float
        Of the knob, over its default, in the first sweep.

    Raises
    ------
    FlexaxisError
        If no scenario has a fault in a parameter that it asks to be estimated.
    """
    if not any(w.D > 0 for s in scenarios for w in windows(s, s.identify)):
        raise FlexaxisError(
            f"{', '.join(s.name for s in scenarios)}: no fault in an estimated parameter, so there "
            "is no lag to compare; name a scenario with one (`flexaxis list`)"
        )
    runs = _Runs(scenarios, seeds, settings(estimators, factors=factors), bench)
    runs.run(scenarios, texts(settings(estimators, factors=factors)))
    for factor in WIDER:
        for scenario in scenarios:
            _widen(runs, scenario, factor)
    return _matched(runs)


def again(
    scenarios: Sequence[Scenario],
    lines: Mapping[str, Mapping[str, Line]],
    seeds: Sequence[int],
    bench: Bench,
) -> list[dict[str, Any]]:
    """Return the `at_excess` that `sweep` found, from the settings it ran; no knob is turned.

    Parameters
    ----------
    scenarios, seeds, bench
        As for `sweep`.
    lines : mapping
        Settings by scenario and estimator, with the turns of their knobs.
    """
    runs = _Runs(scenarios, seeds, {}, bench)
    for scenario in scenarios:
        own = {name: dict(line) for name, line in lines.get(scenario.name, {}).items()}
        runs.lines[scenario.name] = own
        runs.run([scenario], texts(own))
    return _equal(runs)["excess"]


def able(
    scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], bench: Bench
) -> list[str]:
    """Return the estimators that run on all that a first sweep asks of them."""
    lines = settings(estimators)
    with suppress(EstimatorError, StudyError):  # all at once, for they share the records
        bench.runs(scenarios, texts(lines), seeds)
    found = []
    for name, line in lines.items():
        with suppress(EstimatorError, StudyError):
            bench.runs(scenarios, list(line), seeds)
            found.append(name)
    return found


class _Runs:
    """The runs of a sweep: by scenario and setting, and which settings are whose."""

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        seeds: Sequence[int],
        lines: Mapping[str, Line],
        bench: Bench,
    ) -> None:
        self.scenarios, self._seeds, self._bench = scenarios, seeds, bench
        self.lines = {s.name: {name: dict(line) for name, line in lines.items()} for s in scenarios}
        self._runs: dict[tuple[str, str], Runs] = {}

    def run(self, scenarios: Sequence[Scenario], wanted: Sequence[str]) -> None:
        """Run some settings on some scenarios; a setting that was run there is not run again."""
        self._runs |= self._bench.runs(scenarios, wanted, self._seeds)

    def of(self, scenario: Scenario, text: str) -> Runs:
        """Return the rows of a setting, a list a seed."""
        return self._runs[scenario.hash, text]

    def faults(self, scenario: Scenario, name: str) -> list[str]:
        """Return the parameters of an estimator that change."""
        text = next(iter(self.lines[scenario.name][name]))
        return [row["parameter"] for row in self.of(scenario, text)[0] if row["changed"]]

    def match(self, scenario: Scenario, name: str, parameter: str, noise: Noise) -> Match | None:
        """Return an estimator at the noise of the reference; None where that has no such row."""
        line = self.lines[scenario.name][name]
        given, *own = (
            Setting.of(text, factor, self.of(scenario, text), parameter, scenario)
            for text, factor in [(reference(), 1.0), *line.items()]
        )
        return match(given, own, noise)


def _widen(runs: _Runs, scenario: Scenario, factor: float) -> None:
    """Turn the knobs further of those that do not reach the reference yet, as far as they go."""
    for name, line in runs.lines[scenario.name].items():
        how = set()
        for parameter in runs.faults(scenario, name):
            for noise in NOISES:
                found = runs.match(scenario, name, parameter, noise)
                how |= {found.how} if found else set()
        for side, turn in ((QUIETER, factor), (NOISIER, 1 / factor)):
            text = with_knob(name, turn) if side in how else None
            if text is not None and text != name:
                try:
                    runs.run([scenario], [text])
                except (EstimatorError, StudyError):  # so far the knob does not turn
                    continue
                line[text] = turn


def _matched(runs: _Runs) -> Sweep:
    points: list[dict[str, Any]] = []
    for scenario in runs.scenarios:
        for name, line in runs.lines[scenario.name].items():
            for text, factor in line.items():
                extra = {"estimator": name, "setting": text, "factor": factor}
                pooled = pool_group(runs.of(scenario, text), scenario)
                points += [{k: r[k] for k in _KEPT} | extra for r in pooled if r["changed"]]
    at = _equal(runs)
    return Sweep(points, mark(at["std"]), at["excess"])


def _equal(runs: _Runs) -> dict[str, list[dict[str, Any]]]:
    """Return what is said of each estimator at each fault, by what is equal."""
    at: dict[str, list[dict[str, Any]]] = {noise: [] for noise in NOISES}
    for scenario in runs.scenarios:
        for name in runs.lines[scenario.name]:
            for parameter in runs.faults(scenario, name):
                for noise in NOISES:
                    found = runs.match(scenario, name, parameter, noise)
                    if found is not None:
                        at[noise].append(_row(scenario, name, parameter, found))
    return at


NOISES: tuple[Noise, ...] = ("std", "excess")
_KEPT = (
    "scenario", "parameter", "lag", "lag_interval", "t10", "std", "std_interval", "std_after",
    "excess", "diverged", "seeds", "lag_bound", "lag_bound_single",
)  # fmt: skip


def _row(scenario: Scenario, estimator: str, parameter: str, found: Match) -> dict[str, Any]:
    """Return what is said of an estimator at equal noise, with the values it rests on."""
    lag, after, score = (found.at(name) for name in ("lag", "std_after", "score"))
    columns = columns_of(found.nearest.rows)
    bounds = {key: mean(columns, key)[key] for key in ("lag_bound", "lag_bound_single")}
    middle = None if lag is None else float(np.exp(lag.mean()))
    within = None if lag is None else mean_interval(lag)
    false = found.false_alarms()
    return {
        "scenario": scenario.name,
        "parameter": parameter,
        "estimator": estimator,
        "how": found.how,
        "settings": list(found.settings),
        "nearest": found.nearest.text,
        "ratio": found.ratio,
        "lag": middle,
        "lag_interval": within and [float(np.exp(end)) for end in within],
        "bound": bounds["lag_bound"],
        "bound_single": bounds["lag_bound_single"],
        "over_bound": _over(middle, bounds["lag_bound"]),
        "over_single": _over(middle, bounds["lag_bound_single"]),
        "score": None if score is None else float(score.mean()),
        "std_after": None if after is None else _exp(after.mean()),
        "false_alarms_per_1000_s": None if false is None else _rate(found.nearest.rows),
        "values": {
            "lag": listed(lag),
            "std_after": listed(after),
            "score": listed(score),
            "false_alarms": listed(false),
        },
    }


def listed(values: Any) -> list[float] | None:
    """Return values for JSON, with six digits."""
    return None if values is None else [float(f"{value:.6g}") for value in values]


def _rate(rows: Sequence[Mapping[str, Any]]) -> float:
    """Return the false alarms in 1000 s at the setting nearest to the match."""
    return float(np.mean([row["detection"]["false_alarms_per_1000_s"] for row in rows]))


def _exp(value: float) -> float:
    """Return a score from its logarithm; on the floor it is none."""
    return 0.0 if value <= np.log(FLOOR) + 1e-9 else float(np.exp(value))


def _over(value: float | None, limit: float | None) -> float | None:
    return value / limit if value and limit else None
