"""Find the setting of an estimator's knob at which it is as noisy as the reference; keep it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.knob import Knob
from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import Tuning
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.files import write_text
from flexaxis.experiments.running.user_code import PIPE
from flexaxis.experiments.scoring.summary import pool_group
from flexaxis.experiments.studies.bench import Bench
from flexaxis.experiments.studies.knobs import knob_of, setting
from flexaxis.experiments.studies.sweep import reference
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.storage.reading import read_toml
from flexaxis.sim.storage.toml_text import toml_text

EXCESS = "excess"  # what is matched unless the std of one parameter is
TOLERANCE = 0.01  # of the matched noise
ROUNDS = 12  # settings that a match may take
DIGITS = 4  # of a setting: more than the tolerance can tell apart


@dataclass(frozen=True)
class Tuned:
    """A setting found.

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
    bench : Bench
        Where the cases are run.
    match : str
        What is to be matched: "excess", or the parameter whose std is.
    scenarios : sequence of Scenario
        Where the noise is taken, before the first fault: the nominal axis, without one, if empty.
    """

    seeds: Sequence[int]
    bench: Bench
    match: str = EXCESS
    scenarios: Sequence[Scenario] = ()
    _known: dict[str, dict[str, float]] = field(default_factory=dict, repr=False)

    def noises(self, setting: str) -> dict[str, float]:
        """Return the std by parameter, and the root of the excess error as "excess".

        Of several scenarios the geometric mean, of what each of them has.
        """
        if setting not in self._known:
            each = [self._noises(s, setting) for s in self.scenarios or [tuning_scenario()]]
            common = [key for key in each[0] if all(key in found for found in each)]
            self._known[setting] = {key: _middle([found[key] for found in each]) for key in common}
        return self._known[setting]

    def _noises(self, scenario: Scenario, setting: str) -> dict[str, float]:
        rows = self._rows(scenario, setting)
        found = {row["parameter"]: row["std"] for row in rows if row["std"]}
        if rows[0]["excess"]:
            found[EXCESS] = float(np.sqrt(rows[0]["excess"]))
        return found

    def apart(self, setting: str) -> frozenset[str]:
        """Return the scenarios without such a noise, or farther off to the side on which all are.

        None where it is tried on one alone.
        """
        each = {}
        for scenario in self.scenarios:
            own, wanted = (self._noises(scenario, s) for s in (setting, reference()))
            known = self.match in own and self.match in wanted
            each[scenario.name] = np.log(own[self.match] / wanted[self.match]) if known else np.nan
        lacking = {name for name, error in each.items() if np.isnan(error)}
        middle = np.mean([error for error in each.values() if not np.isnan(error)] or [0.0])
        aside = {name for name, error in each.items() if error * middle > 0}
        return frozenset(lacking or aside)

    def _rows(self, scenario: Scenario, setting: str) -> list[dict[str, Any]]:
        runs = self.bench.runs([scenario], [setting], self.seeds)[scenario.hash, setting]
        return pool_group(runs, scenario)


class NoMatchError(FlexaxisError):
    """No setting of a knob is as noisy as the reference.

    Parameters
    ----------
    text : str
    scenarios : frozenset of str
        Those that stand in the way: as noisy as the others they are not, where these have gone.
    """

    def __init__(self, text: str, scenarios: frozenset[str]) -> None:
        super().__init__(text)
        self.scenarios = scenarios


def match_noise(name: str, trials: Trials, options: Mapping[str, Any] | None = None) -> Tuned:
    """
    Turn the knob until the noise is that of `rpem-forgetting` at its default, where it is tried.

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
    knob = _knob(name)
    wanted = trials.noises(reference())
    if trials.match not in wanted:
        raise FlexaxisError(
            f"{trials.match!r} cannot be matched.{did_you_mean(trials.match, wanted)} "
            f"There are: {', '.join(wanted)}"
        )
    search, tried = _Search(knob), ""
    while (at := search.position) is not None:
        tried = setting(name, {**(options or {}), **(knob.at(at) or {})})
        own = trials.noises(tried)
        if trials.match not in own:
            raise NoMatchError(
                f"{tried}: its {_in_words(trials.match)} cannot be matched to that of {REFERENCE}: "
                "it has none, for it does not move or does not estimate what that takes",
                trials.apart(tried),
            )
        ratios = {p: own[p] / wanted[p] for p in wanted if p in own}
        ratio = ratios.pop(EXCESS, 1.0) if trials.match == EXCESS else ratios[trials.match]
        search.take(float(np.log(ratio)))
        if abs(search.error) < TOLERANCE:
            value = round(knob.value(at), 12)
            return Tuned(tried, knob.label, value, trials.match, ratio, ratios)
    raise NoMatchError(
        f"{name}: no setting of its knob has the noise of {REFERENCE}; of {search.rounds} within "
        f"{_range(knob)} last tried {tried}, with {np.exp(search.error):.3g} times that noise"
        + _hint(name, knob),
        trials.apart(tried),
    )


class _Search:
    """Where to turn a knob next: its range, what was learnt of it, and how often it was turned."""

    def __init__(self, knob: Knob) -> None:
        self._knob, self.rounds, self.error = knob, 0, 0.0
        self.position: float | None = self._rounded(knob.usual)
        self._slope, self._before = 0.5, (0.0, 0.0)
        self._quiet: float | None = None  # logarithms of positions on either side of the match
        self._noisy: float | None = None

    def take(self, error: float) -> None:
        """Learn the logarithm of the noise over that wanted, and choose where to turn to."""
        assert self.position is not None
        here, (before, then) = float(np.log(self.position)), self._before
        if self.rounds and abs(here - before) > 1e-6:
            self._slope = float(np.clip((error - then) / (here - before), 0.1, 2.0))
        self.rounds, self.error, self._before = self.rounds + 1, error, (here, error)
        if error > 0:
            self._noisy = here if self._noisy is None else min(here, self._noisy)
        else:
            self._quiet = here if self._quiet is None else max(here, self._quiet)
        low, high = np.log(self._knob.least), np.log(self._knob.most)
        if self.rounds == ROUNDS or (here <= low and error > 0) or (here >= high and error < 0):
            self.position = None
            return
        there = here + float(np.clip(-error / self._slope, -1.5, 1.5))
        if self._quiet is not None and self._noisy is not None:
            inside = self._quiet < there < self._noisy
            there = there if inside else (self._quiet + self._noisy) / 2
        self.position = self._rounded(float(np.exp(there)))

    def _rounded(self, position: float) -> float:
        short = float(f"{position:.{DIGITS}g}")
        return min(max(short, self._knob.least), self._knob.most)


def _range(knob: Knob) -> str:
    first, last = sorted((knob.value(knob.least), knob.value(knob.most)))
    return f"{knob.label} from {first:.4g} to {last:.4g}"


def _hint(name: str, knob: Knob) -> str:
    """Return how to say that an option of one's own is turned otherwise than was taken."""
    if name in REGISTRY or knob.transform != "":
        return ""
    return f'; if it is quicker with less of it, write knob = "1/{knob.label}"'


def _knob(name: str) -> Knob:
    knob = knob_of(name)
    if knob is None:
        raise FlexaxisError(f"{name} has no knob to turn{_how_to_have_one(name)}")
    return knob


def _in_words(match: str) -> str:
    return "excess prediction error" if match == EXCESS else f"std of {match}"


def _middle(values: Sequence[float]) -> float:
    """Return the geometric mean; one value as it is."""
    return values[0] if len(values) == 1 else float(np.exp(np.mean(np.log(values))))


def _how_to_have_one(name: str) -> str:
    if name in REGISTRY:
        return ""
    if name.startswith(PIPE):
        return ": a program takes no options, so write a class that starts it, and gives it one"
    return '; name the option in its class: knob = "1-lam", where λ is turned in 1−λ'


def save(path: Path, name: str, found: Tuned, *, command: str) -> None:
    """Write a setting to a file like estimators/tuned.toml, in the place of the one it had."""
    tables, at = _others(path, name), tuning_scenario()
    new = Tuning(
        estimator=name,
        knob=found.knob,
        value=found.value,
        setting=found.setting,
        match=found.match,
        ratio=round(found.ratio, 4),
        command=command,
        model=at.preset,
        identify=at.identify,
        period=at.period,
        noise=at.noise.speed,
    )
    _write(path, [*tables, asdict(new)])


def forget(path: Path, name: str) -> None:
    """Remove the setting of an estimator from such a file: what was found is no match any more."""
    _write(path, _others(path, name))


def _others(path: Path, name: str) -> list[dict[str, Any]]:
    """Return what the file holds besides one setting."""
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    return [t for t in known.get("tuned", []) if t["estimator"] != name]


def _write(path: Path, tables: list[dict[str, Any]]) -> None:
    rank = {name: place for place, name in enumerate(REGISTRY)}
    tables.sort(key=lambda t: rank.get(t["estimator"], len(rank)))
    text = "# Written by `flexaxis tune`; docs/scores.md explains.\n" + toml_text({"tuned": tables})
    write_text(path, text)
