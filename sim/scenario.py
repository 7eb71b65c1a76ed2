"""Define a scenario, which contains all settings of a simulated run except the random seed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, ValidationError, model_validator

from flexaxis.models_mjcf import DEFAULT, MODEL_NAMES
from flexaxis.sim import identity
from flexaxis.sim.conflicts import conflicts, problems
from flexaxis.sim.errors import ScenarioError, unknown
from flexaxis.sim.overrides import set_keys, suffix
from flexaxis.sim.parameters import (
    DATA_SHEET,
    DEFAULT_IDENTIFY,
    LAW_NAMES,
    AxisParameters,
    preset,
)
from flexaxis.sim.random_draws import drawn
from flexaxis.sim.tables import friction as rubbing
from flexaxis.sim.tables import nonlinear as beyond
from flexaxis.sim.tables import sensors as sensing
from flexaxis.sim.tables.config import Config, Frozen, NotNegative, Positive, Values, Word
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.events import Event, changed, find_events
from flexaxis.sim.tables.excitation import Excitation, Multisine
from flexaxis.sim.tables.faults import Fault
from flexaxis.sim.text_files import read_text, toml_tables, toml_text
from flexaxis.sim.timing import PERIOD, Grid, checked_period, sample_index

Array = NDArray[np.float64]
Tuple = Field(strict=False)  # arrays in TOML become tuples


def _a_model(name: str) -> str:
    if name not in MODEL_NAMES:
        raise ValueError(unknown("model", name, MODEL_NAMES))
    return name


class Scenario(Config):
    """Definition of a simulated run: axis, reference, control loop, sensors and faults.

    Create a scenario with `load_scenario`, `parse_scenario` or `Scenario.override`. If several keys
    are invalid, the error message reports all invalid keys at once. If all keys are valid, the
    error message reports all conflicts between keys. The page docs/scenarios.md explains each key
    of a scenario.

    Attributes
    ----------
    name : str
        Name of the scenario. Scenarios with different content should have different names.
    duration : float
        Length of the run [s].
    card, group : str, optional
        Purpose of the scenario in words, and name of its group in the catalogue.
    difficulty : {"easy", "medium", "hard"}, optional
        Expected difficulty of the scenario for a good estimator.
    period : float
        Sampling period T [s] of the controller and of all signals. The sampling rate 1/T must be an
        integer.
    substeps : int, optional
        Lower limit for the number of simulation steps per 5 ms. By default, only the nonlinear
        effects of the axis determine the number of simulation steps.
    model, preset : str
        Name of the plant model (see `flexaxis.models_mjcf.MODEL_NAMES`), and name of one of its
        parameter sets.
    parameters : dict of str to float
        Parameter values that override those of the preset [SI units].
    identify : tuple of str
        Names of the parameters to estimate. An estimator can also estimate the inverse of a
        parameter, such as ``"1/J_a"``.
    start : float
        Ratio of the initial estimate to the nominal value, which is the same for all parameters.
    known : dict of str to float, optional
        Prior knowledge that estimators receive. For a parameter that is not estimated, the entry is
        the ratio of the assumed value to the true value. For a data-sheet value such as `poles`,
        the entry is the value itself. The entry `spread` determines the size of the random error in
        each assumed parameter value. The random error depends on the seed (see `drawn`).
    output : {"speed", "increment", "angle"}
        Measured motor signal that the estimators use.
    burn_in : float
        Length of the initial interval that is excluded from all scores [s].
    streams : str
        Setting that determines which scenario keys affect the random numbers. If `streams` is
        "plant", only keys for the plant and the sensors affect the random numbers. If `streams` is
        "content", all scenario keys affect the random numbers. If `streams` is the `key` of another
        scenario, both scenarios have the same random numbers.
    feedback : {"clean", "measured"}
        Motor angle that the controller reads: the true angle if `feedback` is "clean", and the
        measured angle if `feedback` is "measured".
    delay, noise, encoder, controller, excitation, fault : Config
        Tables of the sensors, the control loop, the reference and the faults.
    filter, friction, lugre, cogging, backlash, stiffening, saturation : Config, optional
        Tables of sensor, gear and drive effects that the linear model does not describe.
    onset_spread : float, optional
        Largest absolute value of the random time shift [s]. The time shift is the same for all
        faults and pauses of a run, and depends on the seed (see `drawn`).
    nuisance : tuple of Fault, optional
        Parameter changes that are not regarded as faults. An alarm due to such a change is a false
        alarm.
    """

    name: Word
    duration: Annotated[float, Field(gt=0, le=86400)]
    card: str = ""
    group: str | None = None
    difficulty: Literal["easy", "medium", "hard"] | None = None
    period: Annotated[Positive, AfterValidator(checked_period)] = PERIOD
    substeps: Annotated[int, Field(ge=1, le=1000)] | None = None
    model: Annotated[str, AfterValidator(_a_model)] = DEFAULT
    preset: str = "n1"
    parameters: Values = Field(default_factory=Frozen)
    identify: Annotated[tuple[str, ...], Tuple, Field(min_length=1)] = DEFAULT_IDENTIFY
    start: Annotated[float, Field(ge=0.01, le=100)] = 1.0
    known: Annotated[dict[str, Positive], Field(min_length=1), AfterValidator(Frozen)] | None = None
    output: Literal["speed", "increment", "angle"] = "speed"
    burn_in: NotNegative = 5.0
    streams: identity.Streams = identity.PLANT
    feedback: Literal["clean", "measured"] = "clean"
    delay: sensing.DelayConfig = sensing.DelayConfig()
    noise: sensing.NoiseConfig = sensing.NoiseConfig()
    encoder: sensing.EncoderConfig = sensing.EncoderConfig()
    filter: sensing.FilterConfig | None = None
    controller: ControllerConfig = ControllerConfig()
    friction: rubbing.FrictionConfig | None = None
    lugre: rubbing.LuGreConfig | None = None
    static_friction: rubbing.StaticFrictionConfig | None = None
    load_friction: rubbing.LoadFrictionConfig | None = None
    gear_friction: rubbing.GearFrictionConfig | None = None
    cogging: beyond.CoggingConfig | None = None
    backlash: beyond.BacklashConfig | None = None
    stiffening: beyond.StiffeningConfig | None = None
    saturation: beyond.SaturationConfig | None = None
    excitation: Excitation = Multisine()
    fault: Annotated[tuple[Fault, ...], Tuple] = ()
    onset_spread: Annotated[float, Field(gt=0)] | None = None
    nuisance: Annotated[tuple[Fault, ...], Tuple, Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _keys_agree(self) -> Scenario:
        lines = [f"{key}: {text}" for key, text in conflicts(self)]
        if lines:
            raise ValueError("\n".join(lines))
        return self

    def drawn(self, seed: int) -> Scenario:
        """Return the scenario for one seed, with random onsets and random parameter errors."""
        return drawn(self, seed) if self.onset_spread or self.spread else self

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return sample_index(self.duration, self.period)

    @property
    def grid(self) -> Grid:
        """Grid of all sampling times in the run."""
        return Grid.first(self.samples, self.period)

    @property
    def times(self) -> Array:
        """Sample times [s], as an array (N,)."""
        return self.grid.times

    @cached_property
    def nominal(self) -> AxisParameters:
        """Parameter values of the linear axis before the first fault."""
        return preset(self.preset, self.model).replace(**self.parameters)

    @property
    def tables(self) -> dict[str, Any]:
        """Tables of the axis, the control loop and the sensors in this scenario, keyed by name.

        The attribute `exact` of a table states whether the linear model describes the logged
        signals exactly despite the effect of the table. The method `in_words` of a table returns a
        description of its effect.
        """
        return {k: v for k, v in self if isinstance(v, Config) and k != "excitation"}

    @property
    def nonlinear(self) -> dict[str, beyond.Nonlinearity]:
        """Tables of the nonlinear effects in the plant, keyed by name."""
        return self._tables_of(beyond.Nonlinearity)

    @property
    def sensors(self) -> dict[str, sensing.Sensor]:
        """Tables of the sensors, in the order in which the sensors process a signal."""
        return self._tables_of(sensing.Sensor)

    def _tables_of(self, kind: type) -> dict[str, Any]:
        return {key: table for key, table in self.tables.items() if isinstance(table, kind)}

    @property
    def linear(self) -> bool:
        """Whether the linear model with the assumed parameters describes the records exactly."""
        exact = all(table.exact for table in self.tables.values())
        return exact and not (self.known_factors or self.spread)

    @property
    def spread(self) -> float:
        """Standard deviation of ln(x), where x is the random factor of an assumed value."""
        return (self.known or {}).get("spread", 0.0)

    @property
    def known_factors(self) -> dict[str, float]:
        """Ratios of assumed parameter values to true values, keyed by parameter."""
        besides = (*DATA_SHEET, "spread")
        return {name: x for name, x in (self.known or {}).items() if name not in besides}

    @property
    def data_sheet(self) -> dict[str, float]:
        """Data-sheet values that estimators receive in addition to the parameters."""
        return {name: x for name, x in (self.known or {}).items() if name in DATA_SHEET}

    @cached_property
    def laws(self) -> dict[str, float]:
        """Values of the nonlinear plant parameters before the first fault, keyed by name."""
        values: dict[str, float] = {}
        for table in self.nonlinear.values():  # the first table that defines a name has precedence
            values = table.law | values
        return Frozen({name: float(values[name]) for name in LAW_NAMES if name in values})

    @cached_property
    def initial(self) -> dict[str, float]:
        """Values of all plant parameters before the first fault, keyed by name."""
        return Frozen(self.nominal.as_dict() | self.laws)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of all plant parameters; the parameters of the linear axis come first."""
        return tuple(self.initial)

    @property
    def unchanged(self) -> Array:
        """Values of all plant parameters before the first fault, as an array (P,)."""
        return np.array(list(self.initial.values()))

    def true_parameters(self) -> Array:
        """Return the true parameters as an array (N, P); row k applies from sample k to k + 1."""
        changes = (*self.fault, *(self.nuisance or ()))
        return np.column_stack([changed(x, n, changes, self.grid) for n, x in self.initial.items()])

    def excited(self) -> NDArray[np.bool_]:
        """Return whether the reference moves at each sample, as a boolean array (N,)."""
        return self.excitation.excited(self.grid)

    def events(self) -> tuple[Event, ...]:
        """Return all parameter changes that faults cause, in chronological order.

        A ramp causes one event at its onset. An intermittent fault causes one event at each jump.
        If several changes of a parameter overlap, each event still has the size of its own fault.
        """
        return find_events(self.fault, self.nuisance or (), self.grid, self.initial)

    @cached_property
    def hash(self) -> str:
        """SHA-256 of all scenario content except name and description (64 hex digits)."""
        return identity.content_hash(self.resolved())

    @cached_property
    def key(self) -> str:
        """Key that identifies the random numbers of the scenario (64 hex digits)."""
        return identity.stream_key(self.resolved())

    @cached_property
    def record_hash(self) -> str:
        """SHA-256 of all scenario settings that affect the signals of a record (64 hex digits)."""
        return identity.record_hash(self.resolved())

    def resolved(self) -> dict[str, Any]:
        """Return all keys and values of the scenario, including default values and all parameters.

        The returned dict does not contain keys with the value None. Therefore a new optional key
        does not change the hashes of old scenarios.
        """
        content = self.model_dump(mode="json", exclude_none=True)
        return content | {"parameters": self.nominal.as_dict()}

    def to_toml(self) -> str:
        """Return all keys and values of the scenario as TOML text for `parse_scenario`."""
        return toml_text(self.resolved())

    def override(self, changes: Mapping[str, Any], *, inherit: bool = False) -> Scenario:
        """Return a copy of this scenario with changed keys; the changes are appended to the name.

        Parameters
        ----------
        changes : mapping of str to value
            New values of scenario keys, such as ``{"start": 1.2, "fault[0].factor": 2.0}``.
        inherit : bool
            Whether the new scenario uses the random numbers of this scenario. If necessary, the
            method sets `streams` to the `key` of this scenario. If `changes` contains the key
            `streams`, the value of this key takes precedence over `inherit`.

        Raises
        ------
        ScenarioError
            If a scenario key is unknown, or if a value is not allowed.
        """
        content = self.model_dump(mode="json", exclude_none=True)
        # convert numbers and arrays of NumPy to Python types
        changes = {key: getattr(x, "tolist", lambda x=x: x)() for key, x in changes.items()}
        set_keys(content, changes, source=self.name)
        friction = content.get("friction") or {}  # a change to None removes the table
        if friction.get("coulomb") == 0 and len(friction) <= 2:
            del content["friction"]  # in a sweep, the value 0 means no friction
        if "name" not in changes:
            content["name"] = self.name + suffix(changes)
        other = scenario_from(content, source=self.name)
        if not inherit or "streams" in changes or other.key == self.key:
            return other
        return scenario_from(content | {"streams": self.key}, source=self.name)


def scenario_from(content: Mapping[str, Any], *, source: str) -> Scenario:
    """Create a scenario from nested dictionaries of keys and values.

    Parameters
    ----------
    content : mapping
        Keys and values of the scenario, for example the content of a TOML file.
    source : str
        Name of the file or other source of the keys, for use in error messages.

    Raises
    ------
    ScenarioError
        If a key of the scenario is invalid. Each line of the error message contains the source, a
        key and a description of the problem.
    """
    try:
        return Scenario.model_validate(dict(content))
    except ValidationError as error:
        lines = problems(error, Scenario)
        raise ScenarioError(*(f"{source}: {line}" for line in lines)) from None


def parse_scenario(text: str, *, source: str = "scenario") -> Scenario:
    """Create a scenario from TOML text; raise the same errors as `scenario_from`."""
    return scenario_from(toml_tables(text, source=source, refuse=ScenarioError), source=source)


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Read a scenario from a TOML file; raise the same errors as `scenario_from`."""
    return parse_scenario(read_text(Path(path), ScenarioError), source=str(path))
