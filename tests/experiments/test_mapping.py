"""Which column is which signal, in which unit: what one of each unit is in SI, and two clocks."""

import math

import numpy as np
import pytest

from flexaxis.experiments.logs.mapping import UNITS, mapping_from, pick
from flexaxis.experiments.logs.reading.log import Log

# One of each unit, as a book of tables has it.
ONE = {
    "time": {"s": 1, "ms": 1 / 1000, "us": 1 / 1_000_000, "ns": 1 / 1_000_000_000},
    "torque": {"Nm": 1, "mNm": 1 / 1000, "kNm": 1000, "A": 1, "mA": 1 / 1000, "%": 1 / 100, "1": 1},
    "angle": {"rad": 1, "mrad": 1 / 1000, "deg": math.radians(1), "rev": 2 * math.pi},
    "speed": {
        "rad/s": 1,
        "deg/s": math.radians(1),
        "rpm": 2 * math.pi / 60,
        "rev/s": 2 * math.pi,
        "1/min": 2 * math.pi / 60,
        "Hz": 2 * math.pi,
    },
}


def log(clock=None, **columns):
    """A log whose columns are named as its signals, or as told."""
    arrays = {name: np.asarray(values, float) for name, values in columns.items()}

    def read(names, *, strict=True):
        return {name: arrays[name] for name in names}

    return Log("log", tuple(arrays), read, clock=clock or {})


def test_every_unit_is_in_the_table_of_the_test():
    assert all(set(UNITS[kind]) <= set(ONE[kind]) for kind in UNITS)


@pytest.mark.parametrize(
    ("signal", "unit"), [(kind, unit) for kind, each in ONE.items() for unit in each]
)
def test_one_of_each_unit(signal, unit):
    ramp = np.arange(1.0, 6.0)
    given = log(time=ramp, torque=ramp, angle=ramp, speed=ramp)
    raw = pick(given, mapping_from({"unit": {signal: unit}}, source=""))
    np.testing.assert_allclose(getattr(raw, signal), ramp * ONE[signal][unit], rtol=1e-12)
    assert raw.stated == {signal}


def test_a_factor_comes_after_the_unit():
    ramp = np.arange(5.0)
    given = mapping_from({"unit": {"angle": "rev"}, "scale": {"angle": -0.5}}, source="")
    raw = pick(log(time=ramp, torque=ramp, angle=ramp), given)
    np.testing.assert_allclose(raw.angle, -math.pi * ramp)


@pytest.mark.parametrize(
    ("kind", "wanted"),
    [
        # a command stays until the next, and before the first one there is none
        ("held", [math.nan, 10.0, 10.0, 20.0, 30.0, 30.0]),
        # a current is read off between its samples, and not beyond them
        ("smooth", [math.nan, 10.0, 15.0, 20.0, math.nan, math.nan]),
    ],
)
def test_a_torque_by_a_clock_of_its_own(kind, wanted):
    columns = {
        "time": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        "angle": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        "sent": [1.0, 3.0, 3.5],
        "torque": [10.0, 20.0, 30.0],
    }
    given = log(clock={"angle": "time", "torque": "sent"}, **columns)
    raw = pick(given, mapping_from({"torque_is": kind}, source=""))
    np.testing.assert_array_equal(raw.torque, wanted)
    assert "torque by sent" in raw.joined
