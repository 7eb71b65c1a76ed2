"""Find the setting of an estimator's knob at which it is as noisy as the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import Tuning
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.files import write_text
from flexaxis.experiments.scoring.pooling import case_of, pool_group
from flexaxis.experiments.scoring.ranking import REFERENCE
from flexaxis.experiments.studies.knobs import knob_of, numbers_of
from flexaxis.experiments.studies.sweep import reference
from flexaxis.sim.errors import FlexaxisError, did_you_mean
from flexaxis.sim.reading import read_toml
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.toml_text import toml_text

EXCESS = "excess"  # what is matched unless the std of one parameter is
TOLERANCE = 0.01  # of the matched noise
ROUNDS = 12
DIGITS = 4  # of a setting: more than the tolerance can tell apart
SPAN = 8.0  # an option is looked for from its default over this to its default times this


@dataclass(frozen=True)
class Tuned:
    """A setting found.

    Attributes
    ----------
    setting : str
        The estimator with its knob, as for `--estimator`.
    knob : str
    value : float
        Of the knob.
    match : str
        What is matched: "excess", or the parameter whose std is.
    ratio : float
        Noise over that of the reference: of the excess error the root, so that it is a ratio of
        deviations.
    ratios : dict of str to float
        Ratio of the std of each parameter.
    lag : float or None
        Lag [s] on the scenario for which it is least.
    """

    setting: str
    knob: str
    value: float
    match: str
    ratio: float
    ratios: dict[str, float]
    lag: float | None = None


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
    """

    seeds: Sequence[int]
    bench: Bench
    match: str = EXCESS
    _known: dict[str, dict[str, float]] = field(default_factory=dict, repr=False)

    def noises(self, setting: str) -> dict[str, float]:
        """Return the std by parameter, and the root of the excess error as "excess".

        On the nominal axis, started at the truth.
        """
        if setting not in self._known:
            rows = self._rows(tuning_scenario(), setting)
            found = {row["parameter"]: row["std"] for row in rows if row["std"]}
            if rows[0]["excess"]:
                found[EXCESS] = float(np.sqrt(rows[0]["excess"]))
            self._known[setting] = found
        return self._known[setting]

    def lag(self, setting: str, scenario: Scenario) -> float:
        """Return the lag [s] after the faults of a scenario."""
        rows = [row for row in self._rows(scenario, setting) if row["changed"]]
        if not rows:
            raise FlexaxisError(f"{scenario.name} has no fault in an estimated parameter")
        return float(np.exp(np.mean([np.log(row["lag"]) for row in rows])))

    def _rows(self, scenario: Scenario, setting: str) -> list[dict[str, Any]]:
        runs = self.bench.runs([scenario], [setting], self.seeds)[scenario.hash, setting]
        return pool_group([case_of(run) for run in runs], scenario)


def match_noise(name: str, trials: Trials, options: Mapping[str, float] | None = None) -> Tuned:
    """
    Turn the knob until the noise is that of `rpem-forgetting` at its default, on the nominal axis.

    Secant steps in the logarithms; noise grows with every registered knob's speed.

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
        If the estimator has no knob, or no setting is found.
    """
    knob, speed = _knob(name)
    wanted = trials.noises(reference())
    if trials.match not in wanted:
        raise FlexaxisError(
            f"{trials.match!r} cannot be matched.{did_you_mean(trials.match, wanted)} "
            f"There are: {', '.join(wanted)}"
        )
    slope, before, tried = 0.5, None, ""
    for _ in range(ROUNDS):
        speed = float(f"{speed:.{DIGITS}g}")
        value = 1 - speed if knob == "forgetting" else speed
        tried = setting(name, {**(options or {}), knob: value})
        own = trials.noises(tried)
        if trials.match not in own:
            break
        ratios = {p: own[p] / wanted[p] for p in wanted if p in own}
        ratio = ratios.pop(EXCESS, 1.0) if trials.match == EXCESS else ratios[trials.match]
        error = float(np.log(ratio))
        if abs(error) < TOLERANCE:
            return Tuned(tried, knob, round(value, 12), trials.match, ratio, ratios)
        if before is not None and abs(np.log(speed) - before[0]) > 1e-6:
            slope = np.clip((error - before[1]) / (np.log(speed) - before[0]), 0.1, 2.0)
        before = np.log(speed), error
        speed *= float(np.exp(np.clip(-error / slope, -1.5, 1.5)))
    raise FlexaxisError(
        f"{name}: no setting of its knob has the noise of {REFERENCE} (last tried {tried})"
    )


def least_lag(name: str, options: Sequence[str], scenario: Scenario, trials: Trials) -> Tuned:
    """
    Find the options with which an estimator is fastest after a fault, at matched noise.

    Each in turn: the best of seven values on a logarithmic grid, then a search between its
    neighbours; the knob is matched anew for every value.

    Parameters
    ----------
    name : str
        An estimator with a knob.
    options : sequence of str
        The options to turn, besides the knob.
    scenario : Scenario
        With a fault in an estimated parameter.
    trials : Trials

    Raises
    ------
    FlexaxisError
        If there is no such option, or no setting that matches and keeps every run.
    """
    known = numbers_of(name)
    for option in options:
        if option not in known:
            raise FlexaxisError(f"{name} has no option {option!r}.{did_you_mean(option, known)}")
    tried: dict[str, Tuned] = {}

    def attempt(given: dict[str, float]) -> float:
        given = {key: float(f"{value:.{DIGITS}g}") for key, value in given.items()}
        try:
            found = match_noise(name, trials, given)
        except FlexaxisError:
            return np.inf
        lag = trials.lag(found.setting, scenario)
        tried.setdefault(found.setting, Tuned(**{**asdict(found), "lag": lag}))
        return lag

    best: dict[str, float] = {}
    for option in options:
        turned = _minimum(lambda x, o=option: attempt({**best, o: float(np.exp(x))}), known[option])
        best[option] = float(f"{turned:.{DIGITS}g}")
    found = min(tried.values(), key=lambda t: t.lag or np.inf, default=None)
    if found is None or found.lag == np.inf:
        raise FlexaxisError(f"{name}: no setting keeps every run of {scenario.name}")
    return found


def setting(name: str, options: Mapping[str, float]) -> str:
    """Return an estimator with options, as for `--estimator`.

    Examples
    --------
    >>> setting("ekf", {"walk": 0.002})
    'ekf[walk=0.002]'
    """
    return f"{name}[{','.join(f'{key}={value:.12g}' for key, value in options.items())}]"


def save(path: Path, name: str, found: Tuned, *, command: str, scenario: str | None = None) -> None:
    """Write a setting to a file like estimators/tuned.toml, in the place of the one it had."""
    tables, at = _others(path, name, scenario), tuning_scenario()
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
        scenario=scenario,
        lag=None if found.lag is None else round(found.lag, 4),
    )
    tables.append({key: value for key, value in asdict(new).items() if value is not None})
    _write(path, tables)


def forget(path: Path, name: str, *, scenario: str | None = None) -> None:
    """Remove the setting of an estimator from such a file: what was found is no match any more."""
    _write(path, _others(path, name, scenario))


def _others(path: Path, name: str, scenario: str | None) -> list[dict[str, Any]]:
    """Return what the file holds besides one setting."""
    known = read_toml(path, FlexaxisError) if path.exists() else {}
    tables = known.get("tuned", [])
    return [t for t in tables if (t["estimator"], t.get("scenario")) != (name, scenario)]


def _write(path: Path, tables: list[dict[str, Any]]) -> None:
    rank = {name: place for place, name in enumerate(REGISTRY)}
    tables.sort(key=lambda t: (rank.get(t["estimator"], len(rank)), t.get("scenario", "")))
    text = "# Written by `flexaxis tune`; docs/scores.md explains.\n" + toml_text({"tuned": tables})
    write_text(path, text)


def _knob(name: str) -> tuple[str, float]:
    """Return the knob and its default, as what it gives of speed: 1−λ of a forgetting factor."""
    knob, value = knob_of(name)
    if knob is None:
        own = "" if name in REGISTRY else '; name the option in its class: knob = "forgetting"'
        raise FlexaxisError(f"{name} has no knob to turn{own}")
    return knob, 1 - value if knob == "forgetting" else value


def _minimum(of, default: float) -> float:
    """Return where a function of log x is least, near a default of x."""
    grid = np.log(default) + np.log(SPAN) * np.linspace(-1, 1, 7)
    at = int(np.argmin([of(x) for x in grid]))
    sides = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    inner = minimize_scalar(of, bounds=sides, method="bounded", options={"maxiter": 6})
    return float(np.exp(inner.x if inner.fun < of(grid[at]) else grid[at]))
