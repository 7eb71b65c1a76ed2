"""Sensors that do not follow the axis, and filters that begin anew after one."""

from functools import cache

import numpy as np
import pytest
from acceptance.axes import AXES, simulate, theta_of
from acceptance.measures import make

from flexaxis.estimators.filters.fault_monitor import check_residual
from flexaxis.estimators.filters.state import PATIENCE

COUNT = 2 * np.pi / 2048 / 0.005  # rad/s, by which the speed of a coarse encoder steps
TRUTH = theta_of(AXES["n1"])
FAILS, HEALS, END = 2000, 4000, 9000  # samples


@cache
def run():
    return simulate(AXES["n1"], 45.0)


@cache
def saturated():
    y = run().y.copy()
    y[FAILS:HEALS] = np.clip(y[FAILS:HEALS], -2.5, 2.5)
    return y


def counted():
    """Speed by the difference of what an encoder counts, and the noise of that alone."""
    angle = np.cumsum(run().clean) * 0.005
    counts = np.floor(angle / (COUNT * 0.005))
    return np.diff(counts, prepend=0.0) * COUNT


def stuck(y, value):
    y = y.copy()
    y[FAILS:HEALS] = value
    return y


def believed(estimator):
    return np.isfinite(estimator.innovations[:, 0])


def error(theta):
    return np.abs(theta[-1000:, :3].mean(axis=0) / TRUTH - 1).max()


@pytest.mark.parametrize("name", ["rpem-forgetting", "ekf", "imm"])
def test_equal_readings_of_a_coarse_encoder_are_believed(name):
    """Of 45 s some 1200 repeat, in motion; and so do those of an axis at rest under torque."""
    y = counted()
    assert 500 < np.sum(np.diff(y) == 0) < 4000
    estimator = make(name)
    estimator.run(run().u, y)
    assert believed(estimator)[100:].all()


@pytest.mark.parametrize("value", [0.0, 4.0])
@pytest.mark.parametrize("name", ["rpem-forgetting", "ekf", "imm"])
def test_a_sensor_that_is_stuck_is_not_believed(name, value):
    estimator = make(name)
    estimator.run(run().u, stuck(run().y, value))
    taken = np.flatnonzero(believed(estimator)[FAILS:HEALS])
    assert len(taken) < 10
    assert believed(estimator)[HEALS + 300 :].all()


@pytest.mark.parametrize("name", ["rpem-forgetting", "ekf"])
def test_the_end_of_the_range_is_known_once_it_was_reached(name):
    """In the second half of the saturation no clipped reading is taken, not even the first."""
    estimator = make(name)
    estimator.run(run().u, saturated())
    clipped = saturated() != run().y
    known = believed(estimator)
    assert not known[3000:HEALS][clipped[3000:HEALS]].any()
    assert known[3000:HEALS][~clipped[3000:HEALS]].all()


@pytest.mark.parametrize("value", [0.0, 5.0])
def test_a_filter_that_believes_in_jumps_begins_anew_when_the_sensor_reads_on(value):
    estimator = make("imm")
    theta = estimator.run(run().u, stuck(run().y, value))
    np.testing.assert_allclose(theta[HEALS + 1 : HEALS + 200], [TRUTH] * 199)  # θ(0); it waits
    assert not believed(estimator)[HEALS + 1 : HEALS + 200].any()
    assert believed(estimator)[HEALS + 300]
    assert error(theta) < 0.01


@pytest.mark.parametrize("name", ["rpem-forgetting", "variable-forgetting", "cusum-reset"])
def test_what_forgets_begins_anew_where_it_is_lost(name):
    """The sensor has the wrong sign for 20 s: the way back from there leads into another valley."""
    y = run().y.copy()
    y[FAILS : FAILS + 4000] *= -1
    estimator = make(name)
    theta = estimator.run(run().u, y)
    assert error(theta) < 0.02
    gone = np.flatnonzero(~believed(estimator))
    assert len(gone) % 200 <= 5  # each time for 1 s; a reading may repeat by chance
    assert gone[-1] < END - 2000


@pytest.mark.parametrize("name", ["rpem-forgetting", "rpem-drift", "cusum-reset"])
def test_what_forgets_goes_on_where_its_model_lacks_what_has_changed(name):
    """A gear a fifth softer than it was told leaves a tenth of y, in every minute of its life."""
    softer = simulate(
        AXES["n1"], 45.0, faults={10.0: AXES["n1"] | {"k_g": 0.8 * AXES["n1"]["k_g"]}}
    )
    estimator = make(name)
    estimator.run(softer.u, softer.y)
    left = estimator.innovations[4000:, 0]
    assert np.mean(left**2) > 0.05 * np.mean(softer.y[4000:] ** 2)
    assert believed(estimator).all()


def test_the_waiting_time_before_a_reset_doubles():
    names = ("signal", "prediction", "noise", "judged", "last_left", "gone")
    state = dict.fromkeys(names, 1.0) | {"astray_memory": 50.0, "patience": PATIENCE}
    waits = []
    for _ in range(3):
        state |= {"judged": 0.0, "gone": 0.0, "anew": 0.0, "squares": np.zeros(3)}
        while not state["anew"]:
            check_residual(state, 1.0, 1.0)
        waits.append(state["gone"] / 50)
    assert waits == [PATIENCE, 2 * PATIENCE, 4 * PATIENCE]
