"""Events where changes of one parameter overlap, against closed forms."""

import numpy as np
import pytest

from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import scenario_from

F_M = 0.05  # of n1
STEP = {"kind": "step", "parameter": "f_m", "at": 10.0, "factor": 1.5}
RAMP = {"kind": "ramp", "parameter": "f_m", "at": 6.0, "over": 8.0, "factor": 2.0}
THERMAL = {"kind": "thermal", "parameter": "f_m", "at": 2.0, "time_constant": 4.0, "factor": 0.7}
LOOSE = {"kind": "intermittent", "parameter": "f_m", "at": 9.0, "on": 2.0, "off": 1.0,
         "until": 12.0, "factor": 0.0}  # fmt: skip


def scenario(*faults, nuisance=None):
    content = {"name": "x", "duration": 20.0, "fault": list(faults)}
    return scenario_from(content | ({"nuisance": nuisance} if nuisance else {}), source="x")


def found(*faults, nuisance=None):
    events = scenario(*faults, nuisance=nuisance).events()
    return [(event.index, event.before, event.after) for event in events]


def near(*values):
    return pytest.approx(values, rel=1e-12)  # a few roundings


def thermal(k):
    """Factor of THERMAL in sample k: the mean of 1 − .3 (1 − exp(−t/4 s)) until the next."""
    t = 0.005 * k - 2.0
    return 1 - 0.3 * (1 - (np.exp(-t / 4) - np.exp(-(t + 0.005) / 4)) * 4 / 0.005)


def ramp(k):
    """Factor of RAMP in sample k: the mean of a line from 1 at 6 s to 2 at 14 s."""
    return 1 + (0.005 * (k + 0.5) - 6.0) / 8.0


def test_a_step_in_a_thermal_change():
    warm = F_M * thermal(1999)
    assert found(THERMAL, STEP) == [near(400, F_M, 0.7 * F_M), near(2000, warm, 1.5 * warm)]


def test_a_step_inside_a_ramp_leaves_it_its_event():
    half = STEP | {"factor": 0.5}
    there = F_M * ramp(1999)
    assert found(RAMP, half) == [near(1200, F_M, 2 * F_M), near(2000, there, 0.5 * there)]
    assert found(half, RAMP) == found(RAMP, half)


def test_a_ramp_after_a_step_begins_from_what_that_left():
    late = RAMP | {"at": 12.0}
    assert found(STEP, late) == [near(2000, F_M, 1.5 * F_M), near(2400, 1.5 * F_M, 3 * F_M)]


def test_what_begins_in_one_sample_is_one_event_and_each_settles_in_its_time():
    loose = LOOSE | {"at": 6.0, "until": 20.0, "factor": 3.0}  # off again when the ramp ends
    assert found(RAMP, loose)[0] == near(1200, F_M, 2 * 3 * F_M)


@pytest.mark.parametrize("drift", [THERMAL, RAMP, THERMAL | {"factor": 3.0}])
def test_a_step_on_a_drifting_parameter_has_the_size_of_the_step(drift):
    ((index, before, after),) = found(STEP, nuisance=[drift])
    truth = scenario(STEP, nuisance=[drift]).true_parameters()[:, PARAMETER_NAMES.index("f_m")]
    assert (index, before) == (2000, truth[1999]) and before != F_M
    assert after / before == pytest.approx(1.5, rel=1e-14)


def test_a_nuisance_in_the_same_sample_is_no_part_of_the_event():
    assert found(STEP, nuisance=[STEP | {"factor": 3.0}]) == [near(2000, F_M, 1.5 * F_M)]


@pytest.mark.parametrize("kind", [STEP, RAMP, THERMAL])
def test_a_fault_towards_zero_ends_there(kind):
    ((_, before, after),) = found(kind | {"factor": 0.0})
    assert before == F_M and after == pytest.approx(0, abs=F_M * 1e-15)
    assert found(kind | {"factor": 0.0, "at": 1.0}, STEP | {"at": 19.0})[0][2] == after


def test_a_profile_is_an_event_a_line_of_the_size_of_that_line():
    points = [[2.0, 0.5], [4.0, 0.5], [4.5, 1.0], [8.0, 0.0], [16.0, 0.0], [17.0, 1.0]]
    wear = {"kind": "profile", "parameter": "f_m", "at": 5.0, "points": points, "factor": 2.0}
    assert found(wear) == [
        near(1001, F_M, 1.5 * F_M),
        near(1801, 1.5 * F_M, 2 * F_M),
        near(1901, 2 * F_M, F_M),
    ]
