"""Days of an axis that wears and warms: the same test motion each day, friction as it is then."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flexaxis.estimators.models.axes import BRISTLES, STATIC, three_mass
from flexaxis.estimators.models.laws import Law
from flexaxis.experiments.logs.as_log import LogStyle, logged, write_log
from flexaxis.experiments.logs.axis_file import Axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import spare_foreign
from flexaxis.experiments.logs.identification.identify import GIVEN
from flexaxis.experiments.storage.files import OutputError, make_folder, write_text
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate
from flexaxis.sim.streams import stream
from flexaxis.sim.tables.faults import changeable

Array = NDArray[np.float64]

FIRST_DAY = datetime(2026, 1, 1, 6, 0)
MEAN = 25.0  # °C, at which the parameters are those of the scenario
WEATHER = 5.0  # days, over which the temperature forgets
SEASON = 0.5  # part of the variance of the temperature that is a slow wave over all days
WITHIN = 0.3  # K, by which a test motion warms the axis
AXIS, TRUTH = "axis.toml", "truth.json"  # in the folder, besides the logs
SHEET = 0.05  # part by which a value of a data sheet is off, at most
STIFF = 1e4  # N m/rad, of the bristles that stand for Coulomb's friction


@dataclass(frozen=True)
class Days:
    """What happens to an axis from day to day.

    Attributes
    ----------
    days : int
        How many there are, from 1.
    wear : mapping of str to float
        By which part a parameter has grown on the last day, such as ``{"f_c": 0.12}``.
    from_day : int
        On which it is still what it was; it grows evenly from there on.
    span : float
        Between the coldest and the warmest day [K].
    warm : mapping of str to float
        By which part a parameter changes with the temperature [1/K], such as ``{"f_c": -0.01}``:
        exponentially, as the viscosity of a grease does.
    scatter : float
        Standard deviation from day to day of those that wear or warm, as a part, of unknown cause.
    """

    days: int = 60
    wear: Mapping[str, float] = field(default_factory=dict)
    from_day: int = 30
    span: float = 25.0
    warm: Mapping[str, float] = field(default_factory=dict)
    scatter: float = 0.01

    def __post_init__(self) -> None:
        known = changeable(_LINEAR)
        for option in ("wear", "warm"):
            for name, part in getattr(self, option).items():
                if name not in known:
                    raise LogError(
                        f"--{option} {name}: no such parameter.{did_you_mean(name, known)}"
                    )
                if not -1 < part < 10:
                    raise LogError(f"--{option} {name}: {100 * part:g} % is no change of friction")
        if not 2 <= self.days <= 10_000:
            raise LogError(f"--days {self.days}: give 2 to 10000")
        if self.wear and not 0 <= self.from_day < self.days:
            raise LogError(f"--from-day {self.from_day}: give a day from 0 to {self.days - 1}")
        if not (self.span >= 0 and self.scatter >= 0):
            raise LogError("--temperature and --scatter take 0 or more")

    def temperatures(self, rng: np.random.Generator) -> Array:
        """Return the temperature (days,) of each day [°C]: a season, and weather upon it."""
        season = np.sqrt(2 * SEASON) * np.sin(
            2 * np.pi * (np.arange(self.days) / self.days + rng.random())
        )
        keep, fresh = np.exp(-1 / WEATHER), rng.standard_normal(self.days)
        fresh[1:] *= np.sqrt(1 - keep**2)
        found = season + np.sqrt(1 - SEASON) * lfilter([1.0], [1.0, -keep], fresh)
        return MEAN + self.span * ((found - found.min()) / np.ptp(found) - 0.5)

    def factors(self, temperatures: Array, rng: np.random.Generator) -> dict[str, Array]:
        """Return the factor (days,) on each parameter that changes."""
        number = np.arange(1, self.days + 1)
        grown = np.clip((number - self.from_day) / max(self.days - self.from_day, 1), 0, 1)
        return {
            name: np.exp(np.log1p(self.warm.get(name, 0.0)) * (temperatures - MEAN))
            * (1 + self.wear.get(name, 0.0) * grown)
            * np.exp(self.scatter * rng.standard_normal(self.days))
            for name in dict.fromkeys([*self.wear, *self.warm])
        }


@dataclass(frozen=True)
class Day:
    """One of them.

    Attributes
    ----------
    number : int
        From 1.
    date : str
        By ISO 8601, which begins the name of its log.
    temperature : float
        [°C].
    factors : dict of str to float
    """

    number: int
    date: str
    temperature: float
    factors: dict[str, float]


def calendar(scenario: Scenario, days: Days, seed: int) -> list[Day]:
    """Return what the axis is like on each day."""
    for name in dict.fromkeys([*days.wear, *days.warm]):
        if name not in scenario.parameter_names or not scenario.initial[name]:
            raise LogError(
                f"{scenario.name} has no {name} that could change; it has "
                f"{', '.join(n for n in scenario.parameter_names if scenario.initial[n])}"
            )
    temperatures = days.temperatures(stream(scenario.key, seed, "days.temperature"))
    factors = days.factors(temperatures, stream(scenario.key, seed, "days.scatter"))
    return [
        Day(
            number=i + 1,
            date=(FIRST_DAY + timedelta(days=i)).isoformat(timespec="minutes"),
            temperature=float(temperatures[i]),
            factors={name: float(values[i]) for name, values in factors.items()},
        )
        for i in range(days.days)
    ]


def without_faults(scenario: Scenario, duration: float) -> Scenario:
    """Return what is driven every day: a scenario in which nothing changes while it runs."""
    changes: dict[str, Any] = {"fault": [], "nuisance": None, "duration": duration, "burn_in": 0.0}
    return scenario.override(changes | {"name": f"{scenario.name}, daily"[:60].replace(", ", "-")})


def record_of(scenario: Scenario, day: Day, seed: int) -> Record:
    """Simulate the test motion of a day: the excitation of every day, noise of its own."""
    changed = [
        {"kind": "step", "parameter": name, "at": scenario.period, "factor": factor}
        for name, factor in day.factors.items()
    ]  # a sample after the start, while the axis is at rest
    todays = scenario.override({"fault": changed, "name": scenario.name}, inherit=True)
    return simulate(todays, [seed], repeat=day.number)[0]


def write_day(folder: Path, scenario: Scenario, day: Day, *, seed: int, style: LogStyle) -> Path:
    """Simulate a day and write its log, with a column `temp` [°C]; return its path."""
    rng = stream(scenario.key, seed, f"days.log.{day.number}")
    columns = logged(record_of(scenario, day, seed), style, rng)
    time = columns["time"]
    warming = WITHIN * (time - time[0]) / (time[-1] - time[0])
    read = day.temperature + warming + 0.1 * rng.standard_normal(len(time))
    path = _path(folder, day.date)
    write_log(path, columns | {"temp": np.round(read, 1)}, style)
    return path


def write_days(
    folder: Path, scenario: Scenario, days: Days, *, seed: int, style: LogStyle
) -> Iterator[Path]:
    """Write a folder of logs, one a day, and beside them what is true and the axis; yield paths.

    Parameters
    ----------
    folder : Path
        Made if it is missing; the logs of an earlier set are replaced, all of them.
    scenario : Scenario
        As from `without_faults`.
    days : Days
    seed : int
    style : LogStyle

    Raises
    ------
    OutputError
        If somebody else's files are in the folder.
    """
    plan = calendar(scenario, days, seed)
    earlier = _earlier(folder)
    spare_foreign(folder / AXIS, *earlier, *(_path(folder, day.date) for day in plan))
    make_folder(folder)
    for path in earlier:  # a trend would take them for logs of the same axis
        path.unlink()
    told_axis(scenario, seed).save(folder / AXIS)
    truth = {"scenario": scenario.resolved(), "seed": seed, "days": [vars(day) for day in plan]}
    write_text(folder / TRUTH, json.dumps(truth, indent=1) + "\n")
    for day in plan:
        yield write_day(folder, scenario, day, seed=seed, style=style)


def _path(folder: Path, date: str) -> Path:
    return folder / f"{date[:10]}.csv"


def _earlier(folder: Path) -> list[Path]:
    """Return the logs of an earlier set; refuse files without a truth that `write_days` wrote."""
    if not folder.is_dir() or not any(folder.iterdir()):
        return []
    try:
        truth = json.loads((folder / TRUTH).read_bytes())
        paths = [_path(folder, day["date"]) for day in truth["days"]]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise OutputError(
            f"{folder} holds files but no {TRUTH} of `flexaxis days`: they might be logs of a real "
            "axis, and are left as they are. Choose another folder with -o"
        ) from error
    return [path for path in paths if path.is_file()]


def known_axis(scenario: Scenario) -> Axis:
    """Return the axis as it truly is at 25 °C."""
    laws = tuple(law for law, there in _LAWS if getattr(scenario, there) is not None)
    taken = {*_LINEAR, *(name for law in laws for name in law.names)}
    kept = {name: float(x) for name, x in dict(scenario.initial).items() if name in taken}
    return Axis(replace(three_mass(kept), laws=laws), {"model": "three_mass"}, known=True)


def told_axis(scenario: Scenario, seed: int) -> Axis:
    """Return the axis as its owner knows it before the first log: by data sheets.

    The torque constant and the gear ratio, which no log tells, are right; the bristles that stand
    for Coulomb's friction are no property of an axis. All else is off by up to `SHEET`.
    """
    axis, rng = known_axis(scenario), stream(scenario.key, seed, "days.sheet")
    off = {name: 1 + SHEET * rng.uniform(-1.0, 1.0) for name in axis.model.nominal}
    return axis.having(
        {n: value * off[n] for n, value in axis.model.nominal.items() if n not in GIVEN}
    )


_LINEAR = ("k_T", "J_m", "J_g", "J_a", "k_g", "k_a", "d_g", "d_a", "f_m", "f_g", "f_a", "r")
_COULOMB = Law(
    "bristle",
    drive=BRISTLES.drive,
    acts=BRISTLES.acts,
    parameters={"coulomb": "f_c", "stiffness": STIFF},
)
_LAWS = ((_COULOMB, "friction"), (STATIC, "static_friction"))
