"""Tune an estimator: find where its noise is that of the reference.

Its tuning parameter, the knob, is the way through its options that buys speed with noise
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
from flexaxis.estimators.tuned import Tuning
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

EXCESS = "excess"  # what is matched unless the std of one parameter is
TOLERANCE = 0.01  # of the matched noise
ROUNDS = 12  # settings that a match may take
DIGITS = 4  # of a setting: more than the tolerance can tell apart


@dataclass(frozen=True)
class Tuned:
    """A setting at which an estimator is as noisy as the reference.

    Attributes
    ----------
    setting : str
        The estimator with its knob, as for `--estimator`.
    knob : str
        The option that is turned, or the options.
    value : float
        Of the option; of several the position on their path.
    match : str
        What is matched: "excess", or the parameter whose std is.
    ratio : float
        Noise over that of the reference: of the excess error the root, so that it is a ratio of
        deviations.
    """

    setting: str
    knob: str
    value: float
    match: str
    ratio: float

    def turned(self, factor: float) -> str | None:
        """Return the estimator with its knob turned about this setting, None if out of range."""
        name, options, knob = parts(self.setting)
        at = knob.at(knob.position(self.value) * factor)
        return None if at is None else with_options(name, options | at)


def parts(text: str) -> tuple[str, dict[str, Any], Knob]:
    """Return the name of an estimator, its options without those of the knob, and the knob.

    Raises
    ------
    FlexaxisError
        If it has no knob.
    """
    options = written_options(text)
    name = text.partition("[")[0].strip() if options else text
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{text} has no knob to turn, so its noise cannot be matched. An estimator of your own "
            'names the option in its class, such as knob = "1-lam" for λ turned in 1−λ; a program '
            "takes no options"
        )
    return name, {key: value for key, value in options.items() if key not in knob.names}, knob


def tuning_scenario() -> Scenario:
    """Return where the noise is matched: the nominal axis without a fault, started at the truth."""
    return find_scenario("paper_nominal-v1").override({"start": 1.0})


@dataclass(frozen=True)
class Trials:
    """Where settings are tried.

    Attributes
    ----------
    seeds : sequence of int
        Those for tuning.
    run : callable
        ``run(scenarios, estimators, seeds)``: rows of these cases, one a parameter.
    match : str
        What is to be matched: "excess", or the parameter whose std is.
    scenarios : sequence of Scenario
        Where the noise is taken, before the first fault: the nominal axis, without one, if empty.
    """

    seeds: Sequence[int]
    run: Run
    match: str = EXCESS
    scenarios: Sequence[Scenario] = ()

    def noises(self, text: str) -> pd.Series:
        """Return ln of the std by parameter, and of the root of the excess error as "excess".

        Of several scenarios it is the mean, of what all of them have.
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
    """Turn the knob until the noise is that of `rpem-forgetting` at its default.

    Secant steps in the logarithms, halving once the match lies between two settings; noise grows
    with every knob's position. At most `ROUNDS` settings, within the range of the knob.

    Parameters
    ----------
    text : str
        An estimator with a knob; other options stay as they are.
    trials : Trials

    Raises
    ------
    FlexaxisError
        If the estimator has no knob, or no setting is found.
    """
    (name, options, knob), target = parts(text), trials.noises(reference())
    if trials.match not in target:
        raise FlexaxisError(
            f"{trials.match!r} cannot be matched.{did_you_mean(trials.match, target.index)} "
            f"There are: {', '.join(target.index)}"
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
                f"{tried}: it has no noise to match: it does not move, or does not estimate what "
                f"the {'excess error' if trials.match == EXCESS else trials.match} takes"
            )
        error = errors[trials.match]
        if abs(error) < TOLERANCE:
            value = round(knob.value(position), 12)
            return Tuned(tried, knob.label, value, trials.match, float(np.exp(error)))
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
        f"{name}: no setting of its knob has the noise of {REFERENCE}. The last one tried "
        f"within {knob.label} from {least:.4g} to {most:.4g} is {tried}, with {np.exp(error):.3g} "
        f'times that noise. If it is quicker with less of it, write knob = "1/{knob.label}"'
    )


def equally_noisy(
    texts: Sequence[str], scenarios: Sequence[Scenario], run: Run, seeds: Sequence[int]
) -> list[Tuned]:
    """Turn the tuning parameters of two estimators until both are as noisy as the reference.

    Where one parameter alone changes in these scenarios, the std of that parameter is equal; where
    several do, the excess prediction error, which is one number for all.

    Parameters
    ----------
    texts : sequence of str
        As for `--estimator`; a tuning parameter that is set in them is turned, other options
        stay.
    scenarios : sequence of Scenario
        Noise is taken before their faults.
    run : callable
    seeds : sequence of int
        For tuning.

    Raises
    ------
    FlexaxisError
        If one of them has no tuning parameter, nothing changes that both estimate, or no setting
        reaches the noise.
    """
    for text in texts:
        parts(text)  # without a knob nothing need be run
    first = Runs(run, seeds[:1])
    changing = [set[str].intersection(*({*first.changed(s, t)} for t in texts)) for s in scenarios]
    every = set[str]().union(*changing)
    if not every:
        raise FlexaxisError(
            "--match-std: no scenario has a fault in a parameter that both estimate, so there is "
            "no lag to compare. Name one that has (`flexaxis list`)"
        )
    match = EXCESS if len(every) > 1 else every.pop()
    where = [s for s, names in zip(scenarios, changing, strict=True) if names]
    trials = Trials(seeds, run, match, where)
    return [match_noise(text, trials) for text in texts]


def _rounded(position: float, knob: Knob) -> float:
    return min(max(float(f"{position:.{DIGITS}g}"), knob.least), knob.most)


def save(path: Path, name: str, tuned: Tuned | None) -> None:
    """Write a setting to a file like estimators/tuned.toml, in place of the one it had.

    Parameters
    ----------
    path : Path
    name : str
        The estimator.
    tuned : Tuned or None
        None removes the setting: what was found before is no match any more.
    """
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    tables = [table for table in known.get("tuned", []) if table["estimator"] != name]
    if tuned:
        at, ratio = tuning_scenario(), round(tuned.ratio, 4)
        about = Tuning(
            estimator=name, knob=tuned.knob, value=tuned.value, setting=tuned.setting,
            match=tuned.match, ratio=ratio, command=LINE.get(), model=at.preset,
            identify=at.identify, period=at.period, noise=at.noise.speed,
        )  # fmt: skip
        tables.append(asdict(about))
    order = [*REGISTRY]
    tables.sort(key=lambda table: [*order, table["estimator"]].index(table["estimator"]))
    text = "# Written by `flexaxis tune`; docs/scores.md explains.\n" + toml_text({"tuned": tables})
    write_text(path, text)
