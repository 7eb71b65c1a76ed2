"""A scenario: everything that defines a run except its seed, as TOML and as a frozen object."""

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
from flexaxis.sim.files import read_text, toml_tables, toml_text
from flexaxis.sim.overrides import set_keys, suffix
from flexaxis.sim.parameters import (
    DATA_SHEET,
    DEFAULT_IDENTIFY,
    LAW_NAMES,
    AxisParameters,
    preset,
)
from flexaxis.sim.tables import friction as rubbing
from flexaxis.sim.tables import nonlinear as beyond
from flexaxis.sim.tables import sensors as sensing
from flexaxis.sim.tables.config import Config, Frozen, NotNegative, Positive, Values, Word
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.events import Event, changed, drawn, find_events
from flexaxis.sim.tables.excitation import Excitation, Multisine
from flexaxis.sim.tables.faults import Fault
from flexaxis.sim.timing import PERIOD, Grid, checked_period, sample_index

Array = NDArray[np.float64]
Tuple = Field(strict=False)  # arrays in TOML become tuples


def _a_model(name: str) -> str:
    if name not in MODEL_NAMES:
        raise ValueError(unknown("model", name, MODEL_NAMES))
    return name


class Scenario(Config):
    """Definition of a run: axis, excitation, loop, sensors and faults over time.

    Create a scenario with `load_scenario`, `parse_scenario` or `Scenario.override`, which report
    all wrong keys at once, or else all conflicts between keys. docs/scenarios.md explains each key.

    Attributes
    ----------
    name : str
        Name of the scenario. A scenario with other content gets another name.
    duration : float
        Length of the run [s].
    card, group : str, optional
        Description of what the scenario tests, and its group in the catalogue.
    difficulty : {"easy", "medium", "hard"}, optional
        Difficulty for a good estimator.
    period : float
        Sampling period T [s] of controller and signals; 1/T is an integer.
    substeps : int, optional
        Steps of the simulation per 5 ms, to use more than the nonlinear laws of the axis require.
    model, preset : str
        Plant, one of `flexaxis.models_mjcf.MODEL_NAMES`, and the name of one of its parameter sets.
    parameters : dict of str to float
        Values that replace those of the preset [SI units].
    identify : tuple of str
        Parameters to estimate, including inverses such as ``"1/J_a"``.
    start : float
        Initial estimate of these parameters over their nominal value.
    known : dict of str to float, optional
        Values that estimators know: a factor on the true value for other parameters, the value
        itself for those in `DATA_SHEET`. With `spread`, each seed draws an error for every
        parameter that is not estimated (`drawn`).
    output : {"speed", "increment", "angle"}
        Signal that the estimators read.
    burn_in : float
        Time from the start that is not scored [s].
    streams : str
        Key of the random numbers: "plant" (the part of the scenario that affects plant and
        sensors), "content" (the whole scenario), or the `key` of another scenario, to share its
        random numbers.
    feedback : {"clean", "measured"}
        Whether the controller reads the true motor angle or the measured one.
    delay, noise, encoder, controller, excitation, fault
        Tables for sensors, control loop, reference and faults.
    filter, friction, lugre, cogging, backlash, stiffening, saturation, optional
        Tables for effects beyond the linear model: filter, friction, gear and drive.
    onset_spread : float, optional
        Largest shift of faults and pauses, drawn by seed [s] (`drawn`).
    nuisance : tuple of Fault, optional
        Changes of true parameters that do not count as faults; an alarm on them is a false alarm.
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
        """Return the scenario with the values drawn for a seed; see `sim.tables.events.drawn`."""
        return drawn(self, seed) if self.onset_spread or self.spread else self

    @property
    def samples(self) -> int:
        """Number of samples N."""
        return sample_index(self.duration, self.period)

    @property
    def grid(self) -> Grid:
        """The samples of the run."""
        return Grid.first(self.samples, self.period)

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return self.grid.times

    @cached_property
    def nominal(self) -> AxisParameters:
        """Parameters before any fault."""
        return preset(self.preset, self.model).replace(**self.parameters)

    @property
    def tables(self) -> dict[str, Any]:
        """The tables of axis, loop and sensors that are in use, by key.

        Each has `exact` (whether the linear model describes the logged signals) and `in_words`.
        """
        return {k: v for k, v in self if isinstance(v, Config) and k != "excitation"}

    @property
    def nonlinear(self) -> dict[str, beyond.Nonlinearity]:
        """The nonlinear tables of the plant, by key."""
        return self._tables_of(beyond.Nonlinearity)

    @property
    def sensors(self) -> dict[str, sensing.Sensor]:
        """The sensor tables by key, in the order in which a signal passes through them."""
        return self._tables_of(sensing.Sensor)

    def _tables_of(self, kind: type) -> dict[str, Any]:
        return {key: table for key, table in self.tables.items() if isinstance(table, kind)}

    @property
    def linear(self) -> bool:
        """Whether the linear model with the values known to estimators describes the records."""
        exact = all(table.exact for table in self.tables.values())
        return exact and not (self.known_factors or self.spread)

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm of the drawn factors on known values."""
        return (self.known or {}).get("spread", 0.0)

    @property
    def known_factors(self) -> dict[str, float]:
        """Wrong parameter values that estimators use, as factors on the true values, by name."""
        besides = (*DATA_SHEET, "spread")
        return {name: x for name, x in (self.known or {}).items() if name not in besides}

    @property
    def data_sheet(self) -> dict[str, float]:
        """Data-sheet values that estimators receive in addition to the parameters."""
        return {name: x for name, x in (self.known or {}).items() if name in DATA_SHEET}

    @cached_property
    def laws(self) -> dict[str, float]:
        """Parameters of the plant's nonlinear laws before any fault."""
        values: dict[str, float] = {}
        for table in self.nonlinear.values():  # the first table with a name takes precedence
            values = table.law | values
        return Frozen({name: float(values[name]) for name in LAW_NAMES if name in values})

    @cached_property
    def initial(self) -> dict[str, float]:
        """The P parameters before any fault: those of the plant, then those of its laws."""
        return Frozen(self.nominal.as_dict() | self.laws)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the P parameters."""
        return tuple(self.initial)

    @property
    def unchanged(self) -> Array:
        """Values (P,) of the parameters before any fault."""
        return np.array(list(self.initial.values()))

    def true_parameters(self) -> Array:
        """Return the parameters (N, P) that act from each sample to the next."""
        changes = (*self.fault, *(self.nuisance or ()))
        return np.column_stack([changed(x, n, changes, self.grid) for n, x in self.initial.items()])

    def excited(self) -> NDArray[np.bool_]:
        """Return whether the reference moves at each sample (N,)."""
        return self.excitation.excited(self.grid)

    def events(self) -> tuple[Event, ...]:
        """Return the changes of the true parameters, in order of time.

        A ramp is one event at its onset; an intermittent fault is one event at each switch. If
        changes of one parameter overlap, each event has the size of its own fault alone.
        """
        return find_events(self.fault, self.nuisance or (), self.grid, self.initial)

    @cached_property
    def hash(self) -> str:
        """Identity of the scenario: SHA-256 of its content without name and description."""
        return identity.content_hash(self.resolved())

    @cached_property
    def key(self) -> str:
        """Key of the random streams for `flexaxis.sim.streams.stream`: 64 hex digits."""
        return identity.stream_key(self.resolved())

    @cached_property
    def record_hash(self) -> str:
        """SHA-256 of everything that determines a record's signals except seed and repeat."""
        return identity.record_hash(self.resolved())

    def resolved(self) -> dict[str, Any]:
        """Return the scenario with all defaults and all parameter values filled in.

        Keys with the value None are left out, so that new features do not change old hashes.
        """
        content = self.model_dump(mode="json", exclude_none=True)
        return content | {"parameters": self.nominal.as_dict()}

    def to_toml(self) -> str:
        """Return `resolved` as TOML, which parses to the same scenario."""
        return toml_text(self.resolved())

    def override(self, changes: Mapping[str, Any], *, inherit: bool = False) -> Scenario:
        """Return the scenario with some keys changed and the changes appended to its name.

        Parameters
        ----------
        changes : mapping of str to value
            New values by dotted key, such as ``{"start": 1.2, "fault[0].factor": 2.0}``.
        inherit : bool
            Whether to keep the random numbers of this scenario. If the changes would give others
            and do not set `streams`, `streams` is set to this scenario's `key`.

        Raises
        ------
        ScenarioError
            If a key is unknown or a value is not allowed.
        """
        content = self.model_dump(mode="json", exclude_none=True)
        # convert numbers and arrays of NumPy to Python types
        changes = {key: getattr(x, "tolist", lambda x=x: x)() for key, x in changes.items()}
        set_keys(content, changes, source=self.name)
        friction = content.get("friction") or {}  # a change to None removes the table
        if friction.get("coulomb") == 0 and len(friction) <= 2:
            del content["friction"]  # 0 in a sweep means no friction; the other key is the kind
        if "name" not in changes:
            content["name"] = self.name + suffix(changes)
        other = scenario_from(content, source=self.name)
        if not inherit or "streams" in changes or other.key == self.key:
            return other
        return scenario_from(content | {"streams": self.key}, source=self.name)


def scenario_from(content: Mapping[str, Any], *, source: str) -> Scenario:
    """Return a scenario from nested keys and values.

    Parameters
    ----------
    content : mapping
        Keys and values as read from a TOML file.
    source : str
        Name of the scenario's origin for messages.

    Raises
    ------
    ScenarioError
        If a key is wrong; each line of the message names source, key and problem.
    """
    try:
        return Scenario.model_validate(dict(content))
    except ValidationError as error:
        lines = problems(error, Scenario)
        raise ScenarioError(*(f"{source}: {line}" for line in lines)) from None


def parse_scenario(text: str, *, source: str = "scenario") -> Scenario:
    """Return a scenario from TOML text; errors as from `scenario_from`."""
    return scenario_from(toml_tables(text, source=source, refuse=ScenarioError), source=source)


def load_scenario(path: str | os.PathLike[str]) -> Scenario:
    """Return a scenario from a TOML file; errors as from `scenario_from`."""
    return parse_scenario(read_text(Path(path), ScenarioError), source=str(path))
