"""What docs/glr.py measures on: scenarios of the catalogue, changed ones, spoilt records."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario

NONE: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class Case:
    """A scenario of the catalogue, what of it is changed, and what happens to its record.

    Attributes
    ----------
    name : str
        As the tables have it.
    base : str
        Of the catalogue, without ``-v1``.
    changes : mapping
        Dotted keys and their values.
    spoilt : str
        A key of `SPOILT`; empty for a record as it is.
    """

    name: str
    base: str
    changes: Mapping[str, Any] = field(default_factory=lambda: NONE)
    spoilt: str = ""

    @property
    def scenario(self) -> Scenario:
        """The scenario, changed."""
        found = find_scenario(f"{self.base}-v1")
        return found.override(dict(self.changes)) if self.changes else found

    def spoil(self, record: Record) -> Record:
        """Return the record as estimators are given it."""
        if not self.spoilt:
            return record
        rng = np.random.default_rng([record.seed or 0, 77])
        return replace(record, **SPOILT[self.spoilt](record, rng))


def _drift(record: Record, rng: np.random.Generator) -> dict[str, Any]:
    del rng
    return {"speed": record.speed + 0.02 * record.time}


def _gaps(record: Record, rng: np.random.Generator) -> dict[str, Any]:
    here = (rng.random(len(record.time)) > 0.05) & (abs(record.time - 7.5) > 0.5)
    return {"valid": here, "speed": np.where(here, record.speed, 0.0)}


def _outliers(record: Record, rng: np.random.Generator) -> dict[str, Any]:
    far = 30 * rng.standard_normal(len(record.time)) * (rng.random(len(record.time)) < 0.01)
    return {"speed": record.speed + far + 1e9 * (record.time == 7.0)}


def _stuck(record: Record, rng: np.random.Generator) -> dict[str, Any]:
    del rng
    assert record.speed is not None
    held = record.speed[np.searchsorted(record.time, 7.0)]
    return {"speed": np.where(abs(record.time - 7.5) <= 0.5, held, record.speed)}


def _doubled(record: Record, rng: np.random.Generator) -> dict[str, Any]:
    more = np.sqrt(3) * 0.1 * rng.standard_normal(len(record.time))
    return {"speed": record.speed + np.where(record.time < 10.0, 0.0, more)}


SPOILT: Mapping[str, Callable[[Record, np.random.Generator], dict[str, Any]]] = {
    "drift": _drift,
    "gaps": _gaps,
    "outliers": _outliers,
    "stuck": _stuck,
    "doubled": _doubled,
}
"""A drift of .02 rad/s a second; 5 % and a second missing; 1 % wild and one of 1e9; stuck for a
second; noise twice as large from 10 s on."""


def _plain(*names: str) -> tuple[Case, ...]:
    return tuple(Case(name, name) for name in names)


def _step(name: str, base: str = "fm_step", **changes: Any) -> Case:
    return Case(name, base, {key.replace("__", "."): value for key, value in changes.items()})


def _fault(parameter: str, factor: float, at: float = 10.0) -> dict[str, Any]:
    return {"kind": "step", "parameter": parameter, "at": at, "factor": factor}


def _rest(base: str, seconds: float) -> Case:
    """Rest first, and then as before."""
    changes = {"excitation.pause": [[0.0, seconds]], "duration": 20.0 + seconds,
               "burn_in": 5.0 + seconds, "fault[0].at": 10.0 + seconds}  # fmt: skip
    return Case(f"{base}, {seconds:g} s of rest first", base, changes)


def _isolation() -> tuple[Case, ...]:
    """Return the study of docs/examples/isolation.toml."""
    names = ("k_T", "J_a", "f_m", "J_m", "k_g", "k_a", "d_g", "d_a")
    return tuple(
        Case(f"isolation, {name} × {factor:g}", "fm_step",
             {"fault[0].parameter": name, "fault[0].factor": factor})
        for name in names for factor in (0.8, 1.25)
    )  # fmt: skip


def _constant(base: str, seconds: float) -> Case:
    changes = {"fault": [], "duration": seconds, "start": 1.0}
    return Case(f"{base}, {seconds:g} s without a fault", base, changes)


STARTS = (_step("starts at half", start=0.5), _step("starts at double", start=2.0))
PAUSED = {"excitation.pause": [[10.0, 730.0]], "duration": 760.0, "fault[0].at": 740.0}

CASES: Mapping[str, tuple[Case, ...]] = {
    "linear": _plain("fm_step", "fm_double", "ja_step", "kt_step", "two_faults", "kg_step",
                     "jm_step", "dg_double"),
    "isolation": _isolation(),
    "friction": _plain(
        "fm_step", "coulomb_fm_step", "lugre_fm_step", "lugre_stribeck_fm_step",
        "real_coulomb_fm_step", "real_lugre_fm_step", "coulomb_fc_step",
        "encoder_coulomb_fm_step", "wg_fm_step", "wg_fc_step", "coulomb_moves_fm_step",
        "load_friction_fm_step",
    ),
    "unmodelled": _plain(
        "told_kg_fm_step", "backlash_fm_step", "stiffening_fm_step", "cogging_fm_step",
        "load_friction_fm_step",
    ),
    "quiet": (
        _constant("fm_step", 500.0),
        _constant("coulomb_fm_step", 100.0),
        *_plain("warming_fm", "warming_fm_step", "warming_coulomb", "wg_warming", "load",
                "temperature_fm_step"),
        Case("drift of the sensor", "fm_step", {"fault": [], "duration": 60.0}, "drift"),
        Case("noise doubled", "fm_step", {"fault": [], "duration": 60.0}, "doubled"),
    ),
    "ground": (
        *_plain("rest_fm_step", "rest_coulomb_fm_step", "gone_fc_step", "appearing_fc_step",
                "sticking_fm_step", "light_ja_step"),
        *(_rest(base, s) for base in ("fm_step", "coulomb_fm_step") for s in (0.5, 2.0, 60.0)),
        *(_step(f"σ = {sigma:g} rad/s", noise__speed=sigma) for sigma in (0.003, 0.01, 0.03, 0.3)),
        _step("J/f = 10 s, f_m asked for", "light_ja_step", identify=["k_T", "1/J_a", "f_m"]),
        _step("J/f = .01 s", parameters__f_m=0.176),
        _step("J_a .1 s after f_m", "two_faults", fault=[_fault("f_m", 1.5),
                                                         _fault("J_a", 1.1, 10.1)]),
        Case("drift of the sensor", "fm_step", spoilt="drift"),
        _step("10 ms", period=0.01, excitation__high=20.0),
        _step("1 ms", period=0.001),
        *STARTS,
        Case("12 min held", "coulomb_fm_step", PAUSED),
        Case("gaps", "fm_step", spoilt="gaps"),
        Case("outliers", "fm_step", spoilt="outliers"),
        Case("stuck sensor", "fm_step", spoilt="stuck"),
    ),
    "starts": STARTS,
    "budget": _plain("fm_double", "ja_big_step", "dg_double", "appearing_fc_step"),
}  # fmt: skip
"""Cases by table."""
