"""Run estimators at several settings of their tuning parameters, and compare them at equal noise.

A single setting of each estimator is not enough for a ranking, because an estimator that forgets
faster reacts faster but is noisier. Therefore each estimator runs at several settings, and the
module `noise_interpolation` interpolates the lag to the noise level of a reference estimator. For a
single fault, the noise level is the standard deviation of the changing parameter's estimate before
the fault. For all faults together, the noise level is the excess prediction error, which has no
unit. The code calls a tuning parameter a knob.
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
from flexaxis.experiments.comparison.noise_interpolation import Match, Noise, Setting, match
from flexaxis.experiments.comparison.ranking import MATCHED, NOISIER, QUIETER, REFERENCE, mark
from flexaxis.experiments.files import StudyError
from flexaxis.experiments.running.estimators import parse, with_options
from flexaxis.experiments.running.runner import check_failures
from flexaxis.experiments.scoring.intervals import mean_interval
from flexaxis.experiments.scoring.scores import finite
from flexaxis.experiments.scoring.summary import pool_rows
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]
Run = Callable[[Sequence[Scenario], Sequence[str], Sequence[int]], pd.DataFrame]
"""Function ``run(scenarios, estimators, seeds)`` that returns the scores of all runs as a table."""

FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)  # settings relative to the default; larger means faster
WIDER = (16.0, 64.0, 256.0, 1024.0)  # additional settings (or their inverses), if necessary
TURNS = (*FACTORS, *WIDER, *(1 / factor for factor in WIDER))
"""All settings that a sweep can try, as multiples of the default setting."""

ALARMS = "detection.false_alarms_per_1000_s"
NOISES: tuple[Noise, ...] = ("std", "excess")

Line = dict[str, float]  # ratio to the default for each setting of an estimator
Turn = Callable[[float], str | None]
"""Function that returns the estimator specification for a multiple of the default setting, or None
if the setting is out of range."""


def knob_of(name: str) -> Knob | None:
    """Return an estimator's tuning parameter; None if there is none, or if `name` has options.

    Raises
    ------
    EstimatorError
        If the estimator does not exist, or if its class declares an invalid tuning parameter.
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
    """Return the specification of an estimator at `factor` times its default setting.

    If the estimator has no tuning parameter, or if `name` already contains options, the function
    returns `name` unchanged. The function returns None if the new setting is out of range.

    Examples
    --------
    >>> with_knob("rpem-forgetting", 2.0)
    'rpem-forgetting[forgetting=0.99]'
    """
    knob = knob_of(name)
    if knob is None:
        return name
    options = knob.at(knob.usual * factor)
    return None if options is None else with_options(name, options)


def settings(estimators: Sequence[str], *, factors: Sequence[float] = FACTORS) -> dict[str, Line]:
    """Return the initial settings of each estimator in a sweep.

    An estimator without a tuning parameter has a single setting. Two estimators can have a setting
    in common.
    """
    lines: dict[str, Line] = {}
    for name in estimators:
        turned = {with_knob(name, factor): factor for factor in factors}
        lines[name] = {t: 1.0 if t == name else f for t, f in turned.items() if t is not None}
    return lines


def texts(lines: Mapping[str, Line]) -> list[str]:
    """Return the specifications of the reference and of all settings, without duplicates."""
    return list(dict.fromkeys([reference(), *(text for line in lines.values() for text in line)]))


def reference() -> str:
    """Return the specification of the reference estimator, which defines the noise level."""
    return str(with_knob(REFERENCE, 1.0))


@dataclass(frozen=True)
class Runs:
    """Cache of score tables for fixed seeds; each setting runs only once per scenario."""

    run: Run
    seeds: Sequence[int]
    known: dict[tuple[str, str], pd.DataFrame] = field(default_factory=dict, repr=False)

    def of(self, scenario: Scenario, text: str) -> pd.DataFrame:
        """Return the scores (one row per seed and parameter), or raise an error if a run fails."""
        key = scenario.hash, text
        if key not in self.known:
            frame = self.run([scenario], [text], self.seeds)
            check_failures(frame)
            self.known[key] = frame
        return self.known[key]

    def changed(self, scenario: Scenario, text: str) -> list[str]:
        """Return the names of the estimated parameters that change in a scenario."""
        frame = self.of(scenario, text)
        return list(frame.loc[frame["changed"].astype(bool), "parameter"].unique())

    def able(self, scenario: Scenario, text: str) -> bool:
        """Return whether an estimator with a given setting can run on a scenario."""
        try:
            return bool(len(self.of(scenario, text)))
        except (EstimatorError, StudyError):
            return False

    def matches(
        self, scenario: Scenario, base: str, line: Line, turn: Turn, further: Sequence[float], *,
        pairs: Iterable[tuple[str, Noise]], whole: bool = False,
    ) -> dict[tuple[str, Noise], Match | None]:  # fmt: skip
        """Match an estimator's noise to the noise of `base`, for each parameter and noise measure.

        If no setting in `line` is as noisy (or as quiet) as `base`, the method adds settings that
        are further from the default to `line`. If `whole` is true, the method ignores every seed
        for which a run diverges at any setting.
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
    """The results of a sweep over tuning parameters, in a form that JSON can represent.

    Attributes
    ----------
    points : list of dict
        Results at all settings, with one dict for each fault, estimator and setting. The keys are
        ``scenario, parameter, estimator, setting, factor``, the pooled scores ``lag, lag_interval,
        t10, std, std_interval, std_after, excess, diverged, seeds``, and the bounds ``lag_bound``
        and ``lag_bound_single``.
    matched : list of dict
        Results at equal standard deviation of the changing parameter, with one dict for each fault
        and estimator. The keys are ``scenario, parameter, estimator, how, nearest, ratio, lag,
        lag_interval, bound, over_bound, score, std_after, false_alarms_per_1000_s, leads`` and
        ``values``. The class `Match` defines the values of ``how``. For each seed, the entry
        ``values`` contains the score and the logarithm of the lag.
    at_excess : list of dict
        Results at equal excess error, with one dict for each fault and estimator. The dicts have
        the same keys as in `matched`, except ``leads``.
    """

    points: list[dict[str, Any]]
    matched: list[dict[str, Any]]
    at_excess: list[dict[str, Any]]


def sweep(
    scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], run: Run
) -> Sweep:
    """Run each estimator at several settings, and match its noise to the reference noise.

    If no setting is as noisy (or as quiet) as the reference, the sweep tries more settings. The
    additional settings differ from the default by a factor of up to 1024, but stay within the range
    of the tuning parameter.

    Parameters
    ----------
    scenarios : sequence of Scenario
        Scenarios with faults.
    estimators : sequence of str
        Estimators, in the format of the option `--estimator`.
    seeds : sequence of int
        Seeds of the runs, which are the same for all settings.
    run : callable
        Function ``run(scenarios, estimators, seeds)`` that returns the scores of all runs.

    Raises
    ------
    FlexaxisError
        If no scenario has a fault in an estimated parameter.
    """
    if not any(w.D > 0 for s in scenarios for w in windows(s, s.identify)):
        raise FlexaxisError(
            f"{', '.join(s.name for s in scenarios)}: no estimated parameter has a fault, so "
            "there is no lag to compare. Run `flexaxis list faults` to find a scenario with a "
            "fault in an estimated parameter"
        )
    run(scenarios, texts(settings(estimators)), seeds)  # one call, so that settings share records
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
    """Return the estimators that run without failure on all scenarios, at all initial settings."""
    lines = settings(estimators)
    frame = run(scenarios, texts(lines), seeds)
    failed = {*frame.loc[frame["error"].notna(), "estimator"]}
    return [name for name, line in lines.items() if not failed & {*line}]


_KEPT = (
    "scenario", "parameter", "lag", "lag_interval", "t10", "std", "std_interval", "std_after",
    "excess", "diverged", "seeds", "lag_bound", "lag_bound_single",
)  # fmt: skip


def _row(scenario: Scenario, estimator: str, parameter: str, matched: Match) -> dict[str, Any]:
    """Return the scores of an estimator at equal noise, including the values for each seed."""
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
        "std_after": after and round(after, 5),  # 0 if the estimator never moves
        "false_alarms_per_1000_s": rate,
        "values": {  # one value per seed, with six digits
            name: None if (x := values[name]) is None else [float(f"{v:.6g}") for v in x]
            for name in ("lag", "score")
        },
    }
