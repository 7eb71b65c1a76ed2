"""Tune an estimator: find the setting at which it is as noisy as the reference estimator.

The tuning parameter (knob) is the option that sets the trade-off between speed and noise
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
from flexaxis.experiments.running.runner import check_failures
from flexaxis.experiments.scoring.intervals import FLOOR
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.text_files import read_toml, toml_text

EXCESS = "excess"  # default measure of noise; the alternative is the std of one parameter
TOLERANCE = 0.01  # relative tolerance of the matched noise
ROUNDS = 12  # largest number of settings to try
DIGITS = 4  # significant digits of a setting, more than the tolerance requires


@dataclass(frozen=True)
class Tuned:
    """A setting at which an estimator is as noisy as the reference estimator.

    Attributes
    ----------
    setting : str
        Estimator with its tuned options, in the format of the option `--estimator`.
    knob : str
        Name of the tuned option, or names of several options that are tuned together.
    value : float
        Value of the tuned option. If several options are tuned together, `value` is the number from
        which all of them are computed.
    match : str
        Noise measure: "excess" for the excess error, or the name of a parameter whose standard
        deviation is matched.
    ratio : float
        Estimator noise divided by the reference noise. If the excess error is matched, `ratio` is
        the square root of the ratio of the two excess errors, because they are quadratic in the
        parameter errors.
    """

    setting: str
    knob: str
    value: float
    match: str
    ratio: float

    def turned(self, factor: float) -> str | None:
        """Return the estimator at `factor` times its setting, or None if this is out of range."""
        name, options, knob = parts(self.setting)
        at = knob.at(knob.position(self.value) * factor)
        return None if at is None else with_options(name, options | at)


def parts(text: str) -> tuple[str, dict[str, Any], Knob]:
    """Return an estimator's name, its options except the tuned options, and its tuning parameter.

    Raises
    ------
    FlexaxisError
        If the estimator has no tuning parameter.
    """
    options = written_options(text)
    name = text.partition("[")[0].strip() if options else text
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{text} has no tuning parameter, so its noise cannot be matched. To declare a "
            'tuning parameter in a class, add a line such as knob = "1-lam" for the option lam. A '
            "program (pipe:) cannot have a tuning parameter, because it has no options"
        )
    return name, {key: value for key, value in options.items() if key != knob.name}, knob


def tuning_scenario() -> Scenario:
    """Return the scenario for tuning: a nominal axis without faults, where θ(0) is the true θ."""
    return find_scenario("paper_nominal-v1").override({"start": 1.0})


@dataclass(frozen=True)
class Trials:
    """Simulated runs that measure the noise of an estimator at a setting.

    Attributes
    ----------
    seeds : sequence of int
        Seeds for tuning.
    run : callable
        Function ``run(scenarios, estimators, seeds)`` that returns the score rows of all runs.
    match : str
        Noise measure: "excess" for the excess error, or the name of a parameter whose standard
        deviation is matched.
    scenarios : sequence of Scenario
        Scenarios in which the noise is measured before the first fault. If `scenarios` is empty,
        the noise is measured on the nominal axis without a fault.
    """

    seeds: Sequence[int]
    run: Run
    match: str = EXCESS
    scenarios: Sequence[Scenario] = ()

    def noises(self, text: str) -> pd.Series:
        """Return the logarithms of all standard deviations and of the square-rooted excess error.

        The index of the returned series contains the parameter names and "excess". The logarithms
        are averaged over the scenarios. The series contains only parameters that are estimated in
        every scenario.
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

    The search applies the secant method to the logarithms of the setting and of the noise. If a
    secant step leaves the interval that contains the solution, the search uses bisection. The
    search assumes that a faster setting makes the estimator noisier. The search tries at most
    `ROUNDS` settings within the range of the tuning parameter.

    Parameters
    ----------
    text : str
        Estimator with a tuning parameter, in the format of the option `--estimator`. The search
        does not change the other options of the estimator.
    trials : Trials
        Simulated runs that measure the noise at a setting.

    Raises
    ------
    FlexaxisError
        If the estimator has no tuning parameter, or if no setting matches the noise.
    """
    (name, options, knob), target = parts(text), trials.noises(reference())
    if trials.match not in target:
        raise FlexaxisError(
            f"the noise of {trials.match!r} cannot be "
            f"matched.{did_you_mean(trials.match, target.index)} Set match to one of: "
            f"{', '.join(target.index)}"
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
                f"{tried} has no noise to match. Either the estimates are constant, or the "
                "estimator does not estimate all parameters that are needed to match "
                f"{trials.match!r}"
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
        f"{name}: no value of {knob.name} from {least:.4g} to {most:.4g} makes the estimator "
        f"as noisy as {REFERENCE}. The last attempt, {tried}, gives {np.exp(error):.3g} times the "
        f"reference noise. If a smaller {knob.name} makes the estimator faster, "
        f'declare knob = "1/{knob.name}" in its class'
    )


def equally_noisy(
    texts: Sequence[str], scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int]
) -> list[Tuned]:
    """Tune two estimators until each of them is as noisy as the reference estimator.

    If the scenarios change only one parameter that both estimators estimate, the function matches
    the standard deviation of this parameter. If the scenarios change several parameters that both
    estimators estimate, the function matches the excess prediction error, which is a single number
    for all parameters.

    Parameters
    ----------
    texts : sequence of str
        Estimators, in the format of the option `--estimator`. The function replaces the value of
        the tuning parameter, and keeps the values of all other options.
    scenarios : sequence of Scenario
        Scenarios in which the noise is measured before the first fault.
    run : callable
        Function ``run(scenarios, estimators, seeds)`` that returns the score rows of all runs.
    seeds : sequence of int
        Seeds for tuning.

    Raises
    ------
    FlexaxisError
        If one of the estimators has no tuning parameter, if the scenarios change no parameter that
        both estimators estimate, or if no setting matches the noise.
    """
    for text in texts:
        parts(text)  # fail before any run if there is no knob
    first = Runs(run, seeds[:1])
    changing = [set[str].intersection(*({*first.changed(s, t)} for t in texts)) for s in scenarios]
    every = set[str]().union(*changing)
    if not every:
        raise FlexaxisError(
            "--match-std: no scenario has a fault in a parameter that both estimators estimate, "
            "so there is no lag to compare. Run `flexaxis list faults` to find a scenario with "
            "such a fault"
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
        New setting, or None to remove an old setting that no longer matches the reference noise.
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
