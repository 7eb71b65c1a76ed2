"""Sensors that do not follow the axis, and filters that begin anew after one."""

import pickle
from functools import cache

import numpy as np
import pytest
from acceptance.axes import AXES, simulate, theta_of
from acceptance.measures import make

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


def test_a_range_that_is_exceeded_has_no_end_there():
    """What was the end of it may be read again, once something beyond it was read."""
    y = saturated().copy()
    y[HEALS + 400] = 2.5  # by chance, as an encoder may
    estimator = make("ekf")
    estimator.run(run().u, y)
    assert np.abs(y[HEALS : HEALS + 400]).max() > 2.5
    assert believed(estimator)[HEALS + 400]


@pytest.mark.parametrize("value", [0.0, 5.0])
def test_a_filter_that_believes_in_jumps_begins_anew_when_the_sensor_reads_on(value):
    estimator = make("imm")
    theta = estimator.run(run().u, stuck(run().y, value))
    np.testing.assert_allclose(theta[HEALS + 1 : HEALS + 200], [TRUTH] * 199)  # θ(0); it waits
    assert not believed(estimator)[HEALS + 1 : HEALS + 200].any()
    assert believed(estimator)[HEALS + 300]
    assert error(theta) < 0.01


def test_a_saturated_sensor_throws_no_filter_that_believes_in_jumps():
    assert error(make("imm").run(run().u, saturated())) < 0.01


@pytest.mark.parametrize("cut", [FAILS + 5, HEALS + 1, HEALS + 77])
def test_it_begins_anew_at_the_same_sample_however_the_samples_come(cut):
    y = stuck(run().y, 5.0)
    whole, parts = make("imm"), make("imm")
    expected = whole.run(run().u, y)
    first = parts.run(run().u[:cut], y[:cut])
    parts = pickle.loads(pickle.dumps(parts))
    some = [parts.step(a, b) for a, b in zip(run().u[cut : cut + 5], y[cut : cut + 5], strict=True)]
    rest = parts.run(run().u[cut + 5 :], y[cut + 5 :])
    np.testing.assert_array_equal(np.vstack([first, some, rest]), expected)
    whole.reset()
    np.testing.assert_array_equal(whole.run(run().u, y), expected)


def test_a_filter_whose_prediction_is_no_number_begins_anew():
    estimator = make("imm")
    estimator.run(run().u[:FAILS], run().y[:FAILS])
    estimator.state["X"][:, :, 0] = np.nan
    theta = estimator.run(run().u[FAILS:], run().y[FAILS:])
    assert np.isfinite(theta).all() and np.isfinite(estimator.covariance).all()
    assert error(theta) < 0.03


@pytest.mark.parametrize("odd", [np.nan, np.inf, 1e200])
def test_a_filter_whose_slope_is_no_number_moves_by_none_and_begins_anew(odd):
    """ψ may overflow, or its square, while ŷ does not: as where friction is all but none."""
    estimator = make("rpem-forgetting")
    estimator.run(run().u[:FAILS], run().y[:FAILS])
    before = estimator.theta.copy()
    estimator.state["X"][-1, 1] = odd
    theta = estimator.run(run().u[FAILS:], run().y[FAILS:])
    assert np.isfinite(theta).all() and np.isfinite(estimator.covariance).all()
    np.testing.assert_array_equal(theta[0], before)
    assert error(theta) < 0.03


def test_findings_before_it_began_anew_stay_and_later_ones_are_counted_on():
    estimator = make("glr")
    fault = simulate(AXES["n1"], 45.0, faults={36.0: AXES["n1"] | {"f_m": 0.1}})
    estimator.run(fault.u, stuck(fault.y, 5.0))
    named = [f for f in estimator.findings if "f_m" in f.parameters]
    assert [36.0 <= f.alarm * 0.005 < 37.0 for f in named] == [True], estimator.findings
    assert abs(named[0].onset * 0.005 - 36.0) < 0.1


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
