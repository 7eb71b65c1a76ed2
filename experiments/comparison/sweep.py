"""Run estimators over their knobs, and compare them at equal noise.

One setting of a knob ranks nothing: an estimator that forgets faster is faster and noisier. So each
estimator is swept over its knob, and compared where its noise is that of a reference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.comparison.matching import (
    MATCHED,
    NOISIER,
    QUIETER,
    Match,
    Noise,
    Run,
    Setting,
    match,
)
from flexaxis.experiments.comparison.ranking import REFERENCE, mark
from flexaxis.experiments.comparison.tune import with_knob
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running.run import check_failures
from flexaxis.experiments.scoring.intervals import FLOOR, mean_interval
from flexaxis.experiments.scoring.pooling import mean
from flexaxis.experiments.scoring.summary import columns_of, pool_rows
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the default setting, in what the knob gives of speed
WIDER = (16.0, 64.0, 256.0, 1024.0)  # and its inverse, where these do not reach the reference
TURNS = (*FACTORS, *WIDER, *(1 / factor for factor in WIDER))
"""All turns that a sweep may take."""

NOISES: tuple[Noise, ...] = ("std", "excess")
Line = dict[str, float]  # settings of one estimator, with the turn of its knob
Turn = Callable[[float], str | None]
"""From a turn of the knob to the estimator's text, None where it does not turn so far."""


def settings(estimators: Sequence[str], *, factors: Sequence[float] = FACTORS) -> dict[str, Line]:
    """Return the settings that a first sweep runs of each estimator.

    One without a knob has one setting. Two estimators may share a setting, which is run once.
    """
    lines: dict[str, Line] = {}
    for name in estimators:
        turned = {with_knob(name, factor): factor for factor in factors}
        lines[name] = {t: 1.0 if t == name else f for t, f in turned.items() if t is not None}
    return lines


def texts(lines: Mapping[str, Line]) -> list[str]:
    """Return all settings of a first sweep, each once, and the reference."""
    return list(dict.fromkeys([reference(), *(text for line in lines.values() for text in line)]))


def reference() -> str:
    """Return the setting that others are compared with at equal noise."""
    return str(with_knob(REFERENCE, 1.0))


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


@dataclass(frozen=True)
class Runs:
    """Rows of some seeds by scenario and setting, each run once."""

    run: Run
    seeds: Sequence[int]
    known: dict[tuple[str, str], pd.DataFrame] = field(default_factory=dict, repr=False)

    def of(self, scenario: Scenario, text: str) -> pd.DataFrame:
        """Return the rows of a setting, one a seed and parameter; raise if a case failed."""
        key = scenario.hash, text
        if key not in self.known:
            frame = self.run([scenario], [text], self.seeds)
            check_failures(frame)
            self.known[key] = frame
        return self.known[key]

    def changed(self, scenario: Scenario, text: str) -> list[str]:
        """Return the parameters that an estimator estimates and that change."""
        frame = self.of(scenario, text)
        return list(frame.loc[frame["changed"].astype(bool), "parameter"].unique())

    def matches(
        self,
        scenario: Scenario,
        base: str,
        line: Line,
        turn: Turn,
        further: Sequence[float],
        *,
        wanted: Iterable[tuple[str, Noise]],
        whole: bool = False,
    ) -> dict[tuple[str, Noise], Match | None]:
        """Return an estimator at the noise of a base, by parameter and kind of noise.

        Where its settings are all quieter than the base, or all noisier, its knob is turned
        further, as far as it goes; these settings are added to its line. If `whole`, seeds on
        which any setting lost a run are left out.
        """
        found: dict[tuple[str, Noise], Match | None] = dict.fromkeys(wanted)
        for factor in (1.0, *further):
            hows = {m.how for m in found.values() if m}
            for how, value in ((QUIETER, factor), (NOISIER, 1 / factor)):
                text = turn(value) if how in hows else None
                if text is not None and text not in line and self.able(scenario, text):
                    line[text] = value
            if factor != 1 and hows <= {MATCHED}:
                break
            frames = {text: self.of(scenario, text) for text in (base, *line)}
            every = pd.concat(frames.values())
            lost = {*every.loc[every["diverged"].astype(bool), "seed"]} if whole else ()
            kept = {text: frame[~frame["seed"].isin(lost)] for text, frame in frames.items()}
            for parameter, noise in found if kept[base]["seed"].nunique() > 1 else ():
                beside, *own = (
                    Setting.of(text, turned, kept[text], parameter, scenario)
                    for text, turned in [(base, 1.0), *line.items()]
                )
                found[parameter, noise] = match(beside, own, noise)
        return found

    def able(self, scenario: Scenario, text: str) -> bool:
        """Return whether a setting runs on a scenario."""
        try:
            return bool(len(self.of(scenario, text)))
        except (EstimatorError, StudyError):
            return False


def sweep(
    scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], run: Run
) -> Sweep:
    """Run every estimator at several settings of its knob, and match them to the reference.

    Where these settings are all quieter than the reference, or all noisier, the knob is turned
    further, up to 1024 times, as far as the estimator allows.

    Parameters
    ----------
    scenarios : sequence of Scenario
    estimators : sequence of str
    seeds : sequence of int
    run : callable
        ``run(scenarios, estimators, seeds)``: rows of these cases, one a parameter.

    Raises
    ------
    FlexaxisError
        If no scenario has a fault in a parameter that it asks to be estimated.
    """
    if not any(w.D > 0 for s in scenarios for w in windows(s, s.identify)):
        raise FlexaxisError(
            f"{', '.join(s.name for s in scenarios)}: no fault in an estimated parameter, so there "
            "is no lag to compare. Name a scenario with one (`flexaxis list`)"
        )
    run(scenarios, texts(settings(estimators)), seeds)  # all at once, because they share records
    runs, points = Runs(run, seeds), []
    at: dict[str, list[dict[str, Any]]] = {noise: [] for noise in NOISES}
    for scenario, name in product(scenarios, estimators):
        (line,) = settings([name]).values()
        faults = runs.changed(scenario, next(iter(line)))
        found = runs.matches(
            scenario, reference(), line, partial(with_knob, name), WIDER,
            wanted=product(faults, NOISES),
        )  # fmt: skip
        for text, factor in line.items():
            extra = {"estimator": name, "setting": text, "factor": factor}
            pooled = pool_rows(runs.of(scenario, text), scenario)
            points += [{k: r[k] for k in _KEPT} | extra for r in pooled if r["changed"]]
        for (parameter, noise), matched in found.items():
            if matched is not None:
                at[noise].append(_row(scenario, name, parameter, matched))
    return Sweep(points, mark(at["std"]), at["excess"])


def able(
    scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], run: Run
) -> list[str]:
    """Return the estimators that run on all that a first sweep asks of them."""
    lines = settings(estimators)
    frame = run(scenarios, texts(lines), seeds)
    failed = {*frame.loc[frame["error"].notna(), "estimator"]}
    return [name for name, line in lines.items() if not failed & {*line}]


_KEPT = (
    "scenario", "parameter", "lag", "lag_interval", "t10", "std", "std_interval", "std_after",
    "excess", "diverged", "seeds", "lag_bound", "lag_bound_single",
)  # fmt: skip


def _row(scenario: Scenario, estimator: str, parameter: str, found: Match) -> dict[str, Any]:
    """Return what is known of an estimator at equal noise, with the values it rests on."""
    lag, after, score = (found.at(name) for name in ("lag", "std_after", "score"))
    columns, false = columns_of(found.nearest.rows), found.false_alarms()
    bounds = {key: mean(columns, key)[key] for key in ("lag_bound", "lag_bound_single")}
    middle = None if lag is None else float(np.exp(lag.mean()))
    within = None if lag is None else mean_interval(lag)
    rate = columns["detection.false_alarms_per_1000_s"]
    return {
        "scenario": scenario.name,
        "parameter": parameter,
        "estimator": estimator,
        "how": found.how,
        "nearest": found.nearest.text,
        "settings": [side.text for side in found.sides],
        "ratio": found.ratio,
        "lag": middle,
        "lag_interval": within and [float(np.exp(end)) for end in within],
        "bound": bounds["lag_bound"],
        "bound_single": bounds["lag_bound_single"],
        "over_bound": _over(middle, bounds["lag_bound"]),
        "over_single": _over(middle, bounds["lag_bound_single"]),
        "score": None if score is None else float(score.mean()),
        "std_after": None if after is None else _exp(after.mean()),
        "false_alarms_per_1000_s": None if false is None else float(rate.mean()),
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


def _exp(value: float) -> float:
    """Return a score from its logarithm; the floor stands for zero."""
    return 0.0 if value <= np.log(FLOOR) + 1e-9 else float(np.exp(value))


def _over(value: float | None, limit: float | None) -> float | None:
    return value / limit if value and limit else None
