"""The tuning parameter of an estimator: turn it, and find where noise is that of the reference.

It is the way through the options of an estimator that buys speed with noise
(`flexaxis.estimators.knob`).
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.knob import Knob, make_knob
from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import Tuning
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.comparison.matching import Run, Setting
from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.files import write_text
from flexaxis.experiments.running.estimators import parse
from flexaxis.experiments.running.run import check_failures
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.files import read_toml, toml_text
from flexaxis.sim.scenario import Scenario

EXCESS = "excess"  # what is matched unless the std of one parameter is
TOLERANCE = 0.01  # of the matched noise
ROUNDS = 12  # settings that a match may take
DIGITS = 4  # of a setting: more than the tolerance can tell apart


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
    return None if options is None else setting(name, options)


def setting(name: str, options: Mapping[str, Any]) -> str:
    """Return an estimator with options, as for `--estimator`.

    Examples
    --------
    >>> setting("mine.py:Mine", {"robust": True, "gain": 0.1})
    'mine.py:Mine[robust=true,gain=0.1]'
    """

    def written(value: Any) -> str:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return f"{value:.12g}" if number else json.dumps(value)

    return f"{name}[{','.join(f'{key}={written(value)}' for key, value in options.items())}]"


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
    ratios : dict of str to float
        Ratio of the std of each parameter.
    """

    setting: str
    knob: str
    value: float
    match: str
    ratio: float
    ratios: dict[str, float]


def tuning_scenario() -> Scenario:
    """Return where the noise is matched: the nominal axis without a fault, started at the truth."""
    return find_scenario("paper_nominal-v1").override({"start": 1.0})


@dataclass(frozen=True)
class Trials:
    """Where settings are tried, and how noisy they were.

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
    known: dict[tuple[str, str], dict[str, float]] = field(default_factory=dict, repr=False)

    def noises(self, text: str) -> dict[str, float]:
        """Return the std by parameter, and the root of the excess error as "excess".

        Of several scenarios it is the geometric mean, of what each of them has.
        """
        each = [self._noises(s, text) for s in self.scenarios or [tuning_scenario()]]
        if len(each) == 1:
            return each[0]
        common = [key for key in each[0] if all(key in noise for noise in each)]
        return {k: float(np.exp(np.mean([np.log(noise[k]) for noise in each]))) for k in common}

    def _noises(self, scenario: Scenario, text: str) -> dict[str, float]:
        if (scenario.hash, text) not in self.known:
            frame = self.run([scenario], [text], self.seeds)
            check_failures(frame)
            sides = {
                p: Setting.of(text, 1.0, frame, p, scenario) for p in frame["parameter"].unique()
            }
            noise = {p: side.noise("std") for p, side in sides.items()}
            noise[EXCESS] = next(iter(sides.values())).noise("excess")
            self.known[scenario.hash, text] = {p: value for p, value in noise.items() if value > 0}
        return self.known[scenario.hash, text]

    def apart(self, text: str, usual: str) -> frozenset[str]:
        """Return the scenarios without such a noise, or farther off to the side on which all are.

        None where it is tried on one alone.
        """
        each = {}
        for scenario in self.scenarios:
            own, wanted = (self._noises(scenario, s).get(self.match) for s in (text, usual))
            each[scenario.name] = np.log(own / wanted) if own and wanted else np.nan
        lacking = {name for name, error in each.items() if np.isnan(error)}
        middle = np.nanmean([*each.values()]) if len(lacking) < len(each) else 0.0
        return frozenset(lacking or (name for name, error in each.items() if error * middle > 0))


class NoMatchError(FlexaxisError):
    """No setting of a knob is as noisy as the reference.

    Parameters
    ----------
    text : str
    scenarios : frozenset of str
        Scenarios that prevent a match: without them the others may have one.
    """

    def __init__(self, text: str, scenarios: frozenset[str]) -> None:
        super().__init__(text)
        self.scenarios = scenarios


def match_noise(name: str, trials: Trials, options: Mapping[str, Any] | None = None) -> Tuned:
    """Turn the knob until the noise is that of `rpem-forgetting` at its default.

    Secant steps in the logarithms, halving once the match lies between two settings; noise grows
    with every knob's position. At most `ROUNDS` settings, within the range of the knob.

    Parameters
    ----------
    name : str
        An estimator with a knob.
    trials : Trials
    options : mapping, optional
        Other options of the estimator, as they are to be.

    Raises
    ------
    FlexaxisError
        If the estimator has no knob, or no setting is found; this is a `NoMatchError`.
    """
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(
            f"{name} has no knob to turn. An estimator of your own names the option in its class, "
            'such as knob = "1-lam" for λ turned in 1−λ; a program takes no options'
        )
    usual = str(with_knob(REFERENCE, 1.0))
    wanted = trials.noises(usual)
    if trials.match not in wanted:
        raise FlexaxisError(
            f"{trials.match!r} cannot be matched.{did_you_mean(trials.match, wanted)} "
            f"There are: {', '.join(wanted)}"
        )
    quiet, noisy, slope, before = -np.inf, np.inf, 0.5, None
    here = np.log(_rounded(knob.usual, knob))
    for _ in range(ROUNDS):
        position = _rounded(float(np.exp(here)), knob)
        here = np.log(position)
        text = setting(name, {**(options or {}), **(knob.at(position) or {})})
        own = trials.noises(text)
        if trials.match not in own:
            raise NoMatchError(
                f"{text}: it has no noise to match: it does not move, or does not estimate what "
                f"the {'excess error' if trials.match == EXCESS else trials.match} takes",
                trials.apart(text, usual),
            )
        ratios = {p: own[p] / wanted[p] for p in wanted if p in own}
        error = float(np.log(ratios[trials.match]))
        if abs(error) < TOLERANCE:
            ratio = ratios.pop(EXCESS, 1.0) if trials.match == EXCESS else ratios[trials.match]
            return Tuned(
                text, knob.label, round(knob.value(position), 12), trials.match, ratio, ratios
            )
        if before and abs(here - before[0]) > 1e-6:
            slope = float(np.clip((error - before[1]) / (here - before[0]), 0.1, 2.0))
        before = here, error
        quiet, noisy = (quiet, min(here, noisy)) if error > 0 else (max(here, quiet), noisy)
        if (here <= np.log(knob.least) and error > 0) or (here >= np.log(knob.most) and error < 0):
            break
        here += float(np.clip(-error / slope, -1.5, 1.5))
        if np.isfinite(noisy - quiet) and not quiet < here < noisy:
            here = (quiet + noisy) / 2
    least, most = sorted((knob.value(knob.least), knob.value(knob.most)))
    raise NoMatchError(
        f"{name}: no setting of its knob has the noise of {REFERENCE}. The last one tried "
        f"within {knob.label} from {least:.4g} to {most:.4g} is {text}, with {np.exp(error):.3g} "
        f'times that noise. If it is quicker with less of it, write knob = "1/{knob.label}"',
        trials.apart(text, usual),
    )


def _rounded(position: float, knob: Knob) -> float:
    return min(max(float(f"{position:.{DIGITS}g}"), knob.least), knob.most)


def save(path: Path, name: str, found: Tuned | None, *, command: str = "") -> None:
    """Write a setting to a file like estimators/tuned.toml, in place of the one it had.

    Parameters
    ----------
    path : Path
    name : str
        The estimator.
    found : Tuned or None
        None removes the setting: what was found before is no match any more.
    command : str
        The line that finds it again.
    """
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    tables = [table for table in known.get("tuned", []) if table["estimator"] != name]
    if found:
        at, ratio = tuning_scenario(), round(found.ratio, 4)
        about = Tuning(
            estimator=name, knob=found.knob, value=found.value, setting=found.setting,
            match=found.match, ratio=ratio, command=command, model=at.preset,
            identify=at.identify, period=at.period, noise=at.noise.speed,
        )  # fmt: skip
        tables.append(asdict(about))
    rank = {name: place for place, name in enumerate(REGISTRY)}
    tables.sort(key=lambda table: rank.get(table["estimator"], len(rank)))
    text = "# Written by `flexaxis tune`; docs/scores.md explains.\n" + toml_text({"tuned": tables})
    write_text(path, text)
