"""Which column is which signal, in which unit: what one of each unit is in SI, and two clocks."""

import math

import numpy as np
import pandas as pd
import pytest

from flexaxis.experiments.logs.findings import checked
from flexaxis.experiments.logs.mapping import LogMap, pick
from flexaxis.experiments.logs.read import Log

# One of each unit, as a book of tables has it.
TURN, INCH, POUND = 2 * math.pi, 0.0254, 0.45359237 * 9.80665
ONE = {
    "time": {"s": 1, "ms": 1 / 1000, "us": 1e-6, "ns": 1e-9, "min": 60, "h": 3600},
    "torque": {
        "Nm": 1, "mNm": 1 / 1000, "µNm": 1e-6, "cNm": 1 / 100, "Ncm": 1 / 100, "Nmm": 1 / 1000,
        "kNm": 1000, "lb·in": POUND * INCH, "lbf·in": POUND * INCH, "lbf*ft": POUND * 0.3048,
        "ozfin": POUND / 16 * INCH, "kgfcm": 0.0980665, "N": 1, "mN": 1 / 1000,
        "kN": 1000, "A": 1, "mA": 1 / 1000, "V": 1, "mV": 1 / 1000, "%": 1 / 100,
        "1": 1,
    },
    "angle": {
        "rad": 1, "mrad": 1 / 1000, "µrad": 1e-6, "deg": math.radians(1),
        "rev": TURN, "m": 1, "cm": 1 / 100, "mm": 1 / 1000, "um": 1e-6, "nm": 1e-9, "in": INCH,
    },
    "speed": {
        "rad/s": 1, "mrad/s": 1 / 1000, "deg/s": math.radians(1),
        "rpm": TURN / 60, "rev/s": TURN, "1/min": TURN / 60, "Hz": TURN,
        "m/s": 1, "cm/s": 1 / 100, "mm/s": 1 / 1000,
        "in/s": INCH,
    },
}  # fmt: skip


@pytest.mark.parametrize(
    ("column", "unit"),
    [("speed_deg_s", "deg/s"), ("speed_rad_s", "rad/s"), ("speed_mm_s", "mm/s"), ("speed", "")],
)
def test_a_unit_at_the_end_of_a_name(column, unit):
    ramp = np.arange(1.0, 6.0)
    given = checked(LogMap, {"speed": column}, "")
    raw = pick(log(time=ramp, torque=ramp, **{column: ramp}), given)
    np.testing.assert_allclose(raw.signals["speed"], ramp * ONE["speed"].get(unit, 1.0), rtol=1e-12)
    assert raw.linear == (unit == "mm/s")


def log(**columns):
    """A log whose columns are named as its signals, or as told."""
    return Log({name: pd.Series(values) for name, values in columns.items()}, {})


@pytest.mark.parametrize(
    ("signal", "unit"), [(kind, unit) for kind, each in ONE.items() for unit in each]
)
def test_one_of_each_unit(signal, unit):
    ramp = np.arange(1.0, 6.0)
    given = log(time=ramp, torque=ramp, angle=ramp, speed=ramp)
    raw = pick(given, checked(LogMap, {"unit": {signal: unit}}, ""))
    values = raw.time if signal == "time" else raw.signals[signal]
    np.testing.assert_allclose(values, ramp * ONE[signal][unit], rtol=1e-12)
    assert raw.unit.keys() == {signal}


def test_a_factor_comes_after_the_unit():
    ramp = np.arange(5.0)
    given = checked(LogMap, {"unit": {"angle": "rev"}, "scale": {"angle": -0.5}}, "")
    raw = pick(log(time=ramp, torque=ramp, angle=ramp), given)
    np.testing.assert_allclose(raw.signals["angle"], -math.pi * ramp)
