"""Tune an estimator, that is, find the setting at which it is as noisy as the reference.

The tuning parameter, or knob, is the option that trades speed for noise
(`flexaxis.estimators.knob`).
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flexaxis.estimators.knob import Knob
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.comparison.sweep import Run, Runs, Setting, knob_of, reference
from flexaxis.experiments.files import write_text
from flexaxis.experiments.running.estimators import with_options, written_options
from flexaxis.experiments.running.progress import LINE
from flexaxis.experiments.running.run import check_failures
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.files import read_toml, toml_text
from flexaxis.sim.scenario import Scenario

EXCESS = "excess"  # default measure of noise; the alternative is the std of one parameter
TOLERANCE = 0.01  # relative tolerance of the matched noise
ROUNDS = 12  # largest number of settings to try
DIGITS = 4  # significant digits of a setting, more than the tolerance requires


@dataclass(frozen=True)
class Tuned:
    """A setting at which an estimator is as noisy as the reference.

    Attributes
    ----------
    setting : str
        Estimator with its tuned options, written as for the option `--estimator`.
    knob : str
        Name of the tuned option, or names of several options.
    value : float
        Value of the option or, for several options, their position on a common path.
    match : str
        Measure of the noise: "excess", or the name of a parameter whose std is matched.
    ratio : float
        Noise divided by the noise of the reference. For the excess error, which is a square,
        `ratio` is the square root of this quotient.
    """

    setting: str
    knob: str
    value: float
    match: str
    ratio: float

    def turned(self, factor: float) -> str | None:
        """Return the estimator with its knob at `factor` × this setting, or None out of range."""
        name, options, knob = parts(self.setting)
        at = knob.at(knob.position(self.value) * factor)
        return None if at is None else with_options(name, options | at)


def parts(text: str) -> tuple[str, dict[str, Any], Knob]:
    """Return the name of an estimator, its options without the tuned options, and its knob.

    Raises
    ------
    FlexaxisError
        If the estimator has no knob.
    """
    options = written_options(text)
    name = text.partition("[")[0].strip() if options else text
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{text} has no tuning parameter, so its noise cannot be matched. In your own class, "
            'declare the tuning parameter, such as knob = "1-lam" for the option lam. A program '
            "has no options"
        )
    return name, {key: value for key, value in options.items() if key != knob.name}, knob


def tuning_scenario() -> Scenario:
    """Return the scenario for matching noise: the nominal axis without fault, with true θ(0)."""
    return find_scenario("paper_nominal-v1").override({"start": 1.0})


@dataclass(frozen=True)
class Trials:
    """Simulated runs on which the search tries settings of a tuning parameter.

    Attributes
    ----------
    seeds : sequence of int
        Seeds for tuning.
    run : callable
        ``run(scenarios, estimators, seeds)`` returns the rows of these cases, one per parameter.
    match : str
        Measure of the noise: "excess", or the name of a parameter whose std is matched.
    scenarios : sequence of Scenario
        Scenarios for the noise before the first fault. Without scenarios, the noise is measured on
        the nominal axis without a fault.
    """

    seeds: Sequence[int]
    run: Run
    match: str = EXCESS
    scenarios: Sequence[Scenario] = ()

    def noises(self, text: str) -> pd.Series:
        """Return logarithms of the std of each parameter and of the root of the excess error.

        The index of the result contains the parameters and "excess". The values are means over the
        scenarios. The result contains only parameters that are estimated in every scenario.
        """
        each = []
        for scenario in self.scenarios or [tuning_scenario()]:
            frame = self.run([scenario], [text], self.seeds)
            check_failures(frame)
            sides = {
                p: Setting.of(text, 1.0, frame, p, scenario) for p in frame["parameter"].unique()
            }
            logs = {p: side.log("std") for p, side in sides.items()}
            each.append(logs | {EXCESS: next(iter(sides.values())).log("excess")})
        noise = pd.DataFrame(each)
        return noise.where(noise > np.log(FLOOR)).mean(skipna=False).dropna()


def match_noise(text: str, trials: Trials) -> Tuned:
    """Tune an estimator until it is as noisy as `rpem-forgetting` with default options.

    The search uses secant steps for the logarithms. If a step leaves the range that contains the
    match, the search uses bisection. The search assumes that noise increases with the position of
    the knob, and tries at most `ROUNDS` settings within the range of the knob.

    Parameters
    ----------
    text : str
        Estimator with a knob, written as for the option `--estimator`. Other options keep their
        values.
    trials : Trials
        Simulated runs on which the search tries settings.

    Raises
    ------
    FlexaxisError
        If the estimator has no knob, or if no setting matches the noise.
    """
    (name, options, knob), target = parts(text), trials.noises(reference())
    if trials.match not in target:
        raise FlexaxisError(
            f"{trials.match!r} cannot be matched.{did_you_mean(trials.match, target.index)} "
            f"Choose from: {', '.join(target.index)}"
        )
    quiet, noisy, slope, before = -np.inf, np.inf, 0.5, None
    here = np.log(_rounded(knob.usual, knob))
    for _ in range(ROUNDS):
        position = _rounded(float(np.exp(here)), knob)
        here = np.log(position)
        tried = with_options(name, options | (knob.at(position) or {}))
        errors = (trials.noises(tried) - target).dropna()
        if trials.match not in errors:
            raise FlexaxisError(
                f"{tried} has no noise to match. Its estimates do not move, or it does not "
                f"estimate the parameters that are needed to match {trials.match!r}"
            )
        error = errors[trials.match]
        if abs(error) < TOLERANCE:
            value = round(knob.value(position), 12)
            return Tuned(tried, knob.name, value, trials.match, float(np.exp(error)))
        if before and abs(here - before[0]) > 1e-6:
            slope = float(np.clip((error - before[1]) / (here - before[0]), 0.1, 2.0))
        before = here, error
        quiet, noisy = (quiet, min(here, noisy)) if error > 0 else (max(here, quiet), noisy)
        if position == (knob.least if error > 0 else knob.most):
            break
        here += float(np.clip(-error / slope, -1.5, 1.5))
        if np.isfinite(noisy - quiet) and not quiet < here < noisy:
            here = (quiet + noisy) / 2
    least, most = sorted((knob.value(knob.least), knob.value(knob.most)))
    raise FlexaxisError(
        f"{name}: no setting of {knob.name} from {least:.4g} to {most:.4g} has the noise of "
        f"{REFERENCE}. The last setting tried is {tried}, with {np.exp(error):.3g} × this noise. "
        f'If a smaller {knob.name} is faster, write knob = "1/{knob.name}"'
    )


def equally_noisy(
    texts: Sequence[str], scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int]
) -> list[Tuned]:
    """Tune two estimators until both are as noisy as the reference.

    If the scenarios change only one of the parameters that both estimate, the function matches the
    std of this parameter. If they change several, the function matches the excess prediction error,
    which is a single number for all parameters.

    Parameters
    ----------
    texts : sequence of str
        Estimators, written as for the option `--estimator`. The function replaces the value of the
        tuning parameter. Other options keep their values.
    scenarios : sequence of Scenario
        Scenarios for the noise before the faults.
    run : callable
        ``run(scenarios, estimators, seeds)`` returns the rows of these cases, one per parameter.
    seeds : sequence of int
        Seeds for tuning.

    Raises
    ------
    FlexaxisError
        If one of the estimators has no tuning parameter, if the scenarios change no parameter that
        both estimate, or if no setting matches the noise.
    """
    for text in texts:
        parts(text)  # fail before any run if there is no knob
    first = Runs(run, seeds[:1])
    changing = [set[str].intersection(*({*first.changed(s, t)} for t in texts)) for s in scenarios]
    every = set[str]().union(*changing)
    if not every:
        raise FlexaxisError(
            "--match-std: no scenario has a fault in a parameter that both estimate, so there is "
            "no lag to compare. Choose a scenario with such a fault (`flexaxis list`)"
        )
    match = EXCESS if len(every) > 1 else every.pop()
    where = [s for s, names in zip(scenarios, changing, strict=True) if names]
    trials = Trials(seeds, run, match, where)
    return [match_noise(text, trials) for text in texts]


def _rounded(position: float, knob: Knob) -> float:
    return min(max(float(f"{position:.{DIGITS}g}"), knob.least), knob.most)


def save(path: Path, name: str, tuned: Tuned | None) -> None:
    """Write the tuned setting of an estimator to a file such as estimators/tuned.toml.

    Parameters
    ----------
    path : Path
        Path of the file.
    name : str
        Name of the estimator.
    tuned : Tuned or None
        New setting, or None to remove an old setting that no longer matches.
    """
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    tables = [table for table in known.get("tuned", []) if table["estimator"] != name]
    if tuned:
        at = tuning_scenario()
        about = {
            "ratio": round(tuned.ratio, 4), "command": LINE.get(), "model": at.preset,
            "identify": at.identify, "period": at.period, "noise": at.noise.speed,
        }  # fmt: skip
        tables.append({"estimator": name, **asdict(tuned), **about})
    order = [*REGISTRY]
    tables.sort(key=lambda table: [*order, table["estimator"]].index(table["estimator"]))
    text = "# Written by `flexaxis tune` (see docs/scores.md).\n" + toml_text({"tuned": tables})
    write_text(path, text)
