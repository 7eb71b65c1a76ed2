"""
Every registered estimator: any unit, rate and start, whatever happens to the axis, in one shape.
"""

import pickle
from functools import cache

import numpy as np
import pytest
from acceptance.axes import AXES, NAMES, scaled, simulate, theta_of
from acceptance.disturbances import DISTURBANCES
from acceptance.measures import (
    claims,
    make,
    nominal_torque,
    outcome,
    relative_rms,
    stepped,
    undisturbed,
    unit_error,
)
from acceptance.units import CHANGES

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.protocol import run_estimator
from flexaxis.estimators.registry import REGISTRY

MOVING = [name for name in REGISTRY if name != "frozen"]
# A bank of hypotheses: its long runs are for the night.
LONG = {"glr"}
# Whose loop over increments is compiled here at once; that of each other takes as long again.
# With the Δ of the paper the noise alone is beyond a per cent.
NOISY = {"rpem-drift"}
# Without state correction x remembers what the old estimates did to it, and the claim does not.
CONSISTENT = ("cusum-reset", "oracle-reset")


@cache
def disturbed(case):
    return DISTURBANCES[case](AXES["n1"])


def slow(value):
    return pytest.param(value, marks=pytest.mark.slow)


# Units


@pytest.mark.parametrize("units", CHANGES, ids=lambda units: units.name)
@pytest.mark.parametrize("name", REGISTRY)
def test_no_unit_matters(name, units):
    assert unit_error(name, units, axis="n1", period=0.005, seconds=5.0) < 1e-6


# Rates and starts


def arrives(name, axis, period, start=1.2, seconds=40.0):
    given = undisturbed(axis, period, seconds)
    return outcome(make(name, axis=axis, period=period, start=start), given)


@pytest.mark.parametrize("period", [slow(0.001), slow(0.002), slow(0.005), 0.01])
@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("name", [slow(n) if n in LONG else n for n in MOVING])
def test_any_rate_will_do(name, axis, period):
    found = arrives(name, axis, period)
    assert found.finite and not found.findings
    assert found.error < 0.03 or axis == "n2"


@pytest.mark.parametrize("start", [0.8, slow(0.9), slow(1.1), slow(1.2), slow(1.3), 1.5])
@pytest.mark.parametrize("name", [slow(n) if n in LONG else n for n in MOVING if n not in NOISY])
def test_a_wrong_start_is_left_without_an_alarm(name, start):
    found = arrives(name, "n1", 0.005, start)
    assert found.error < 0.01 and not found.findings


# Disturbances


@pytest.mark.parametrize(
    ("name", "case"),
    [
        pytest.param(n, case, marks=[pytest.mark.slow] * (n in LONG and case != "outlier of 1e9"))
        for n in MOVING
        for case in DISTURBANCES
    ],
)
def test_a_disturbance_is_survived(name, case):
    """Longer ones, and sensors that fail, are those of `flexaxis check --long`."""
    found = outcome(make(name), disturbed(case))
    assert found.finite
    assert found.error < 0.05
    assert found.at_rest == 0


def on_an_axis_without(absent, name, seconds, fault=1.0):
    """A start 10 % off, and f_m times as large at half time."""
    axis = AXES["n1"] | {absent: 0.0}
    after = axis | {"f_m": fault * axis["f_m"]}
    run = simulate(axis, seconds, faults={seconds / 2: after})
    model, torque = three_mass(scaled(axis, 1.1)), nominal_torque("n1", 0.005)
    made = REGISTRY[name].factory(model, 0.005, identify=NAMES, torque=torque)
    return relative_rms(run_estimator(made, run.u, run.y), run, 2.0), made


@pytest.mark.parametrize("absent", ["f_g", slow("f_a"), slow("d_g"), slow("d_a")])
@pytest.mark.parametrize("name", MOVING)
def test_a_friction_or_damping_may_be_absent(name, absent):
    error, made = on_an_axis_without(absent, name, 20.0)
    assert error < 0.03 and np.isfinite(made.covariance).all()
    assert not getattr(made, "findings", ())


# Claims


def test_after_a_known_change_the_claim_is_right():
    """
    NEES of `oracle-reset`, which begins anew: from the first sample on theory says its error.

    k_T alone, in which the model is linear: no step is too large for a linearised filter.
    """
    jumps = {"parameter": "k_T", "factor": 0.9}
    runs = {seed: stepped("n1", 11.2, at=10.0, seed=seed, **jumps) for seed in range(100)}
    found = claims("oracle-reset", runs, ("k_T",))
    # a mean of 100 χ² of one degree has a deviation of 14 %
    assert (abs(found.mean - 1) < 0.15 + 2 * found.deviation).all(), found


@pytest.mark.parametrize("name", [slow(n) if n in LONG else n for n in CONSISTENT])
def test_in_steady_state_the_claim_is_right(name):
    runs = {seed: stepped("n1", 11.2, at=10.0, seed=seed) for seed in range(30)}
    found = claims(name, runs)
    assert abs(found.mean[0] - 1) < 0.15 + 2 * found.deviation[0]


# Shape


@cache
def motion():
    """3 s with gaps: u, y, valid."""
    run = stepped("n1", 3.0, at=2.0, seed=1)
    k = np.arange(len(run.u))
    return run.u, run.y, (k % 7 > 0) & ((k < 300) | (k > 320))


def by_steps(estimator, stop, start=0):
    u, y, valid = motion()
    return np.array([estimator.step(u[k], y[k] if valid[k] else None) for k in range(start, stop)])


@pytest.mark.parametrize("name", REGISTRY)
def test_one_shape(name):
    estimator, p = make(name), len(NAMES)
    assert tuple(estimator.names) == NAMES and estimator.output == "speed"
    np.testing.assert_allclose(estimator.theta, theta_of(AXES["n1"]))
    u, y, valid = motion()
    for k in range(320):
        theta = estimator.step(u[k], y[k] if valid[k] else None)
        np.testing.assert_allclose(theta, estimator.theta, rtol=1e-12)
        if name == "frozen":  # expects nothing of y
            continue
        assert np.isfinite(estimator.prediction)
        if valid[k]:
            assert estimator.innovation == pytest.approx(y[k] - estimator.prediction, abs=1e-12)
            # of what the noise is like nothing is known at first
            assert estimator.innovation_variance > 0 or (
                k < 60 and np.isnan(estimator.innovation_variance)
            )
        else:
            assert np.isnan(estimator.innovation) and np.isnan(estimator.innovation_variance)
    C = estimator.covariance
    assert theta.shape == (p,) and C.shape == (p, p)
    np.testing.assert_allclose(C, C.T)
    d = 1 / theta_of(AXES["n1"])
    assert np.linalg.eigvalsh(C * np.outer(d, d))[0] >= 0
    assert all(finding.alarm < 320 for finding in getattr(estimator, "findings", ()))


@pytest.mark.parametrize("name", REGISTRY)
def test_steps_and_run_agree_and_show_the_same(name):
    """A run may be taken in parts, and keeps its innovations with their variances."""
    u, y, valid = motion()
    one, other = make(name, onsets=(400,)), make(name, onsets=(400,))
    expected, shown = [], []
    for k in range(600):
        expected.append(one.step(u[k], y[k] if valid[k] else None))
        shown.append((one.innovation, one.innovation_variance))
    theta, innovations = [], []
    for part in (slice(0, 250), slice(250, 251), slice(251, 600)):
        theta.append(other.run(u[part], y[part], valid[part]))
        innovations.append(other.innovations)
    np.testing.assert_array_equal(np.concatenate(theta), expected)
    np.testing.assert_array_equal(np.concatenate(innovations)[:, 0], np.array(shown)[:, 0])
    np.testing.assert_array_equal(np.concatenate(innovations)[valid, 1], np.array(shown)[valid, 1])
    np.testing.assert_array_equal(other.covariance, one.covariance)
    assert other.run([], []).shape == (0, len(NAMES))


@pytest.mark.parametrize("name", REGISTRY)
def test_reset_begins_anew_and_a_copy_goes_its_own_way(name):
    u, y, _ = motion()
    estimator = make(name, onsets=(400,))
    first = by_steps(estimator, 600)
    end = estimator.covariance
    estimator.reset()
    np.testing.assert_array_equal(by_steps(estimator, 300), first[:300])
    twin = estimator.copy()
    assert type(twin) is type(estimator)
    twin.run(-u[:200], y[:200] + 1.0)  # must not reach the original
    other = estimator.copy()
    np.testing.assert_array_equal(by_steps(estimator, 600, 300), first[300:])
    np.testing.assert_array_equal(estimator.covariance, end)
    np.testing.assert_array_equal(by_steps(other, 600, 300), first[300:])
    np.testing.assert_array_equal(other.covariance, end)


@pytest.mark.parametrize("name", [slow(n) if n in LONG else n for n in MOVING])
def test_innovations_are_as_large_as_they_claim(name):
    """Normalised innovations squared: their mean is 1 ± √(2/6000) where all is well."""
    run = undisturbed("n1", 0.005).run
    estimator = make(name)
    run_estimator(estimator, run.u, run.y)
    innovation, variance = estimator.innovations[2000:].T
    assert np.mean(innovation**2 / variance) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("name", REGISTRY)
def test_it_goes_on_in_another_process(name):
    u, y, valid = motion()
    here = make(name)
    here.run(u[:200], y[:200], valid[:200])
    there = pickle.loads(pickle.dumps(here))
    np.testing.assert_array_equal(*(e.run(u[200:], y[200:], valid[200:]) for e in (here, there)))


# Options

OPTIONS = [(name, option) for name in REGISTRY for option in REGISTRY[name].options]


IMPOSSIBLE = (np.nan, np.inf, -np.inf, -1.0, "fast", [1.0, 2.0])
ENDLESS = ("ceiling",)  # where infinite means none


@pytest.mark.parametrize(("name", "option"), OPTIONS)
def test_what_no_option_can_be_is_refused(name, option):
    taken = []
    for value in IMPOSSIBLE:
        if value is np.inf and option in ENDLESS:
            continue
        try:
            make(name, **{option: value})
            taken.append(f"{value} is taken")
        except EstimatorError as error:
            if option not in str(error):
                taken.append(f"{value} is refused by {error}, which does not name it")
        except Exception as error:
            taken.append(f"{value} raises {error!r}")
    assert not taken
