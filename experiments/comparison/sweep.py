"""Turn the tuning parameters (knobs) of estimators, and compare these at equal noise.

One setting of a knob ranks nothing: an estimator that forgets faster is faster and noisier. So each
estimator runs at several settings, and its lag is interpolated, linearly in the logarithms, between
the two settings on either side of the noise of a reference. For one fault the noise is the standard
deviation of the parameter that changes; for all faults together it is the excess prediction error,
which has no units. Where no setting is as quiet as the reference (or as noisy), the nearest one
gives a bound on one side.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.knob import Knob, make_knob
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.comparison.matching import Match, Noise, Setting, match
from flexaxis.experiments.comparison.ranking import MATCHED, NOISIER, QUIETER, REFERENCE, mark
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running.estimators import parse, with_options
from flexaxis.experiments.running.run import check_failures
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.scores import finite
from flexaxis.experiments.scoring.summary import pool_rows
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Run = Callable[[Sequence[Scenario], Sequence[str], Sequence[int]], pd.DataFrame]
"""``run(scenarios, estimators, seeds)``: the rows of these cases, as `Runner.rows` returns them."""

FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # of the default setting, in what the knob gives of speed
WIDER = (16.0, 64.0, 256.0, 1024.0)  # and its inverse, where these do not reach the reference
TURNS = (*FACTORS, *WIDER, *(1 / factor for factor in WIDER))
"""All turns that a sweep may take."""

ALARMS = "detection.false_alarms_per_1000_s"
NOISES: tuple[Noise, ...] = ("std", "excess")

Line = dict[str, float]  # settings of one estimator, with the turn of its knob
Turn = Callable[[float], str | None]
"""From a turn of the knob to the estimator's text, None where it does not turn so far."""


def knob_of(name: str) -> Knob | None:
    """Return the knob of an estimator, None where it has none, or options already.

    Raises
    ------
    EstimatorError
        If there is no such estimator, or its class declares a knob that cannot be turned.
    """
    spec = parse(name)
    if spec.options:
        return None
    if name in REGISTRY:
        return REGISTRY[name].turning
    declared = getattr(spec.make, "knob", None)
    if declared is None:
        return None
    options = list(inspect.signature(spec.make).parameters.values())[2:]
    try:
        return make_knob(declared, {option.name: option.default for option in options})
    except EstimatorError as error:
        raise EstimatorError(f"{name}: {error}") from None


def with_knob(name: str, factor: float) -> str | None:
    """Return an estimator with its knob turned: "rpem-forgetting[forgetting=0.99]".

    One without a knob, or with options already, stays as it is. None where the knob does not turn
    so far.

    Examples
    --------
    >>> with_knob("rpem-forgetting", 2.0)
    'rpem-forgetting[forgetting=0.99]'
    """
    knob = knob_of(name)
    if knob is None:
        return name
    options = knob.turned(factor)
    return None if options is None else with_options(name, options)


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

    def able(self, scenario: Scenario, text: str) -> bool:
        """Return whether a setting runs on a scenario."""
        try:
            return bool(len(self.of(scenario, text)))
        except (EstimatorError, StudyError):
            return False

    def matches(
        self, scenario: Scenario, base: str, line: Line, turn: Turn, further: Sequence[float], *,
        pairs: Iterable[tuple[str, Noise]], whole: bool = False,
    ) -> dict[tuple[str, Noise], Match | None]:  # fmt: skip
        """Return an estimator at the noise of a base, by parameter and kind of noise.

        Where its settings are all quieter than the base, or all noisier, its knob is turned
        further, as far as it goes; these settings are added to its line. If `whole`, seeds on
        which any setting lost a run are left out.
        """
        matches: dict[tuple[str, Noise], Match | None] = dict.fromkeys(pairs)
        for factor in (1.0, *further):
            hows = {m.how for m in matches.values() if m}
            for how, value in ((QUIETER, factor), (NOISIER, 1 / factor)):
                text = turn(value) if how in hows else None
                if text is not None and self.able(scenario, text):
                    line.setdefault(text, value)
            if factor != 1 and hows <= {MATCHED}:
                break
            frames = {text: self.of(scenario, text) for text in (base, *line)}
            every = pd.concat(frames.values())
            lost = every.loc[every["diverged"].astype(bool), "seed"] if whole else []
            kept = {text: frame[~frame["seed"].isin(lost)] for text, frame in frames.items()}
            for parameter, noise in matches if len(kept[base]) else ():
                beside, *own = (
                    Setting.of(text, turned, kept[text], parameter, scenario)
                    for text, turned in [(base, 1.0), *line.items()]
                )
                matches[parameter, noise] = match(beside, own, noise)
        return matches


@dataclass(frozen=True)
class Sweep:
    """The results of a sweep over tuning parameters; all values are JSON.

    Attributes
    ----------
    points : list of dict
        One for each fault, estimator and setting: ``scenario, parameter, estimator, setting,
        factor``, pooled ``lag, lag_interval, t10, std, std_interval, std_after, excess, diverged,
        seeds``, ``lag_bound`` and ``lag_bound_single``.
    matched : list of dict
        One for each fault and estimator, at the std of the reference in the parameter that
        changes: ``how`` (see `Match`), ``nearest, ratio, lag, lag_interval, bound, over_bound,
        std_after, false_alarms_per_1000_s, leads``, and ``values`` of ln lag seed by seed.
    at_excess : list of dict
        The same at the excess error of the reference, with ``score`` and its values.
    """

    points: list[dict[str, Any]]
    matched: list[dict[str, Any]]
    at_excess: list[dict[str, Any]]


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
        matches = runs.matches(
            scenario, reference(), line, partial(with_knob, name), WIDER,
            pairs=product(faults, NOISES),
        )  # fmt: skip
        for text, factor in line.items():
            extra = {"estimator": name, "setting": text, "factor": factor}
            pooled = pool_rows(runs.of(scenario, text), scenario)
            points += [{k: r[k] for k in _KEPT} | extra for r in pooled if r["changed"]]
        for (parameter, noise), matched in matches.items():
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


def _row(scenario: Scenario, estimator: str, parameter: str, matched: Match) -> dict[str, Any]:
    """Return the scores of an estimator at equal noise, with the values of each seed."""
    values = {name: matched.at(name) for name in ("lag", "std_after", "score")}
    lag, after, score = (None if x is None else float(x.mean()) for x in values.values())
    within = None if lag is None else mean_interval(values["lag"])  # type: ignore[arg-type]
    lag, after = (None if x is None else float(np.exp(x)) for x in (lag, after))
    rows = matched.nearest.rows.reindex(columns=["lag_bound", ALARMS])
    bound, rate = map(finite, rows.astype(float).mean())
    return {
        "scenario": scenario.name,
        "parameter": parameter,
        "estimator": estimator,
        "how": matched.how,
        "nearest": matched.nearest.text,
        "ratio": matched.ratio,
        "lag": lag,
        "lag_interval": within and np.exp(within).tolist(),
        "bound": bound,
        "over_bound": lag / bound if lag and bound else None,
        "score": score,
        "std_after": after and round(after, 5),  # 0 where it does not move
        "false_alarms_per_1000_s": rate,
        "values": {  # six digits, by seed
            name: None if (x := values[name]) is None else [float(f"{v:.6g}") for v in x]
            for name in ("lag", "score")
        },
    }
