"""Detect, rewind, refit, as a whole, against known faults and where there is none."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.colour import NORMAL
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.finding import UNEXPLAINED
from flexaxis.estimators.relocate.opened import opened

NAMES = ("k_T", "1/J_a", "f_m")
SUSPECTS = ("J_m", "J_g", "k_g", "k_a", "d_g", "d_a", "f_g", "f_a")
T = 0.005
P0 = known_P(NAMES, forgetting=0.995)


def slow_axis(nominal, by_hand, period, seconds=20.0):
    """u and noisy speed of the axis, driven by noise below 30 Hz, sampled at another rate."""
    rng = np.random.default_rng(0)
    A, B = by_hand(dict(nominal))
    step = expm(np.block([[A[:5, :5], B[:5, None]], [np.zeros((1, 6))]]) * period)
    N = round(seconds / period)
    lines = np.zeros(N // 2 + 1, complex)
    lines[1 : round(30 * seconds)] = np.exp(2j * np.pi * rng.random(round(30 * seconds) - 1))
    u = np.fft.irfft(lines, N)
    u /= u.std()
    x, speed = np.zeros(5), np.empty(N)
    for k in range(N):
        speed[k] = x[2]
        x = (step @ np.r_[x, u[k]])[:5]
    return u, speed + 0.1 * rng.standard_normal(N)


@pytest.fixture
def relocate(nominal):
    return Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=0.005)


@pytest.mark.parametrize(
    ("name", "factor"), [("f_m", 1.5), ("1/J_a", 1.1), ("k_T", 0.9), ("k_g", 0.8), ("J_m", 1.1)]
)
def test_names_the_parameter_and_its_size(nominal, simulated, relocate, name, factor):
    parameter = name.removeprefix("1/")
    run = simulated(12.0, seed=3, faults={6.0: nominal | {parameter: factor * nominal[parameter]}})
    theta = relocate.run(run.u, run.y)
    (finding,) = relocate.findings
    assert finding.parameters == (name,)
    ratio = finding.ratio[0] ** (-1 if name.startswith("1/") else 1)
    assert ratio - 1 == pytest.approx(factor - 1, rel=0.08)  # four deviations of the refit
    assert abs(finding.onset - 1200) <= 10 and finding.alarm - 1200 < 40
    truth = np.array([nominal["k_T"], 1 / nominal["J_a"], nominal["f_m"]])
    if name in NAMES:
        truth[NAMES.index(name)] *= finding.ratio[0]
    np.testing.assert_allclose(theta[-1], truth, rtol=0.015)


def test_without_a_change_it_is_the_corrected_rpem(nominal, loop, relocate):
    # at rest, before the first sample, it has nothing to forget: one time update less
    plain = Rpem(three_mass(nominal), P0=0.995 * P0, state_correction=True, period=T)
    np.testing.assert_allclose(relocate.run(loop.u, loop.y), plain.run(loop.u, loop.y), rtol=1e-9)
    assert relocate.findings == ()


def test_steps_blocks_and_the_whole_agree(nominal, simulated, relocate):
    run = simulated(8.0, seed=1, faults={5.0: nominal | {"f_m": 0.1}})
    whole = relocate.run(run.u, run.y)
    found = relocate.findings
    relocate.reset()
    parts = [relocate.run(run.u[a:b], run.y[a:b]) for a, b in ((0, 900), (900, 1003))]
    steps, alarms = [], []
    for u, y in zip(run.u[1003:], run.y[1003:], strict=True):
        steps.append(relocate.step(u, y))
        alarms.append(relocate.alarm)
    np.testing.assert_array_equal(whole, np.vstack([*parts, steps]))
    assert relocate.findings == found
    assert np.flatnonzero(alarms).tolist() == [found[0].alarm - 1003]


def test_the_past_does_not_know_the_future(nominal, simulated, relocate):
    run = simulated(8.0, seed=2, faults={5.0: nominal | {"f_m": 0.1}})
    theta = relocate.run(run.u, run.y)
    other = run.y.copy()
    other[1020:] += 1.0
    relocate.reset()
    np.testing.assert_array_equal(relocate.run(run.u, other)[:1020], theta[:1020])


def test_no_model_of_the_change_is_said_and_said_once(nominal, simulated, relocate):
    run = simulated(12.0, seed=4)
    y = run.y.copy()
    y[1200:] += 2.0 * np.random.default_rng(0).standard_normal(1200)  # the sensor goes bad
    relocate.run(run.u, y)
    (finding,) = relocate.findings
    assert finding.parameters == () and finding.reason == UNEXPLAINED


@pytest.mark.slow
def test_a_gap_and_an_increment_model(nominal, simulated):
    run = simulated(10.0, seed=5, faults={6.0: nominal | {"f_m": 0.1}})
    filter_ = Relocate(
        three_mass(nominal), suspects=SUSPECTS, P0=P0, output="increment", period=0.005
    )
    y = run.increment + 0.1 * np.random.default_rng(1).standard_normal(len(run.u))
    valid = np.ones(len(y), bool)
    valid[1100:1120] = False
    theta = filter_.run(run.u, y, valid)
    (finding,) = filter_.findings
    assert finding.parameters == ("f_m",)
    assert theta[-1, 2] == pytest.approx(0.1, rel=0.02)


def test_a_fault_is_found_in_a_coloured_residual(nominal, simulated, relocate):
    run = simulated(14.0, seed=6, faults={10.0: nominal | {"f_m": 0.075}})
    white = np.random.default_rng(2).standard_normal(len(run.u))
    y = run.y + 0.1 * lfilter([1.0], [1.0, -1.8, 0.9], white)  # rms 0.5 rad/s, five times σ
    relocate.run(run.u, y)
    (finding,) = relocate.findings
    assert finding.parameters == ("f_m",)
    assert abs(finding.onset - 2000) < 20 and finding.alarm < 2400


@pytest.mark.parametrize("start", [0.8, 0.9, 1.2, 1.3, 1.5])
def test_a_wrong_start_is_no_fault(nominal, loop, start):
    """The residual of a start-up is coloured, and white as soon as it is over."""
    truth = three_mass(nominal).parametrize(NAMES).theta
    filter_ = Relocate(
        three_mass(nominal), suspects=SUSPECTS, theta0=start * truth, P0=P0, period=T
    )
    # three parameters with up to .33 % of standard deviation: four of those
    np.testing.assert_allclose(filter_.run(loop.u, loop.y)[-1], truth, rtol=0.0135)
    assert filter_.findings == ()


@pytest.mark.parametrize("zero", ["f_a", "f_g", "d_a"])
def test_a_parameter_that_is_zero_is_no_suspect_and_does_no_harm(nominal, simulated, zero):
    axis = dict(nominal) | {zero: 0.0}
    run = simulated(12.0, seed=3, parameters=axis, faults={6.0: axis | {"f_m": 0.075}})
    filter_ = Relocate(three_mass(axis), suspects=SUSPECTS, P0=P0, period=T)
    theta = filter_.run(run.u, run.y)
    (finding,) = filter_.findings
    assert finding.parameters == ("f_m",)
    assert theta[-1, 2] == pytest.approx(0.075, rel=0.02)


def test_negative_parameters_are_found_as_positive_ones(nominal, simulated, relocate):
    """A torque that acts the other way round: k_T = −1, and the controller knows."""
    run = simulated(10.0, seed=3, faults={6.0: dict(nominal) | {"k_T": 0.9}})
    theta = relocate.run(run.u, run.y)
    turned = dict(nominal) | {"k_T": -nominal["k_T"]}
    filter_ = Relocate(three_mass(turned), suspects=SUSPECTS, P0=P0, period=T)
    mirrored = filter_.run(-run.u, run.y)
    np.testing.assert_allclose(mirrored, theta * [-1, 1, 1], rtol=1e-9)
    assert filter_.findings == relocate.findings != ()
    lower, upper = filter_.bounds
    assert np.all(lower < upper)


def test_in_rest_nothing_is_found_and_nothing_forgotten(nominal, simulated, relocate):
    still = np.zeros(60_000)  # five minutes
    run = simulated(14.0, seed=1)
    theta = relocate.run(np.r_[still, run.u], np.r_[still, run.y])
    truth = three_mass(nominal).parametrize(NAMES).theta
    assert np.all(np.isfinite(theta)) and relocate.findings == ()
    np.testing.assert_array_equal(theta[: len(still)], np.tile(truth, (len(still), 1)))
    np.testing.assert_allclose(theta[-2000:], np.tile(truth, (2000, 1)), rtol=0.03)


def test_a_fault_in_a_pause_is_found_when_the_excitation_returns(nominal, simulated, relocate):
    fault = {20.0: dict(nominal) | {"f_m": 0.075}}
    run = simulated(36.0, seed=1, pause=(10.0, 30.0), faults=fault)
    theta = relocate.run(run.u, run.y)
    (finding,) = relocate.findings
    assert finding.parameters == ("f_m",) and 6000 <= finding.alarm < 6100
    assert theta[-1, 2] == pytest.approx(0.075, rel=0.02)
    relocate.reset()
    healthy = simulated(36.0, seed=1, pause=(10.0, 30.0))
    relocate.run(healthy.u, healthy.y)
    assert relocate.findings == ()


def test_a_long_gap_forgets_nothing(nominal, simulated, relocate):
    run = simulated(20.0, seed=1)
    gap = np.zeros(100_000)
    relocate.run(run.u[:2000], run.y[:2000])
    P = relocate._judge.memory.state["P"].copy()
    relocate.run(gap, gap, gap > 0)
    np.testing.assert_array_equal(relocate._judge.memory.state["P"], P)
    relocate.run(run.u, run.y)
    assert relocate.findings == ()


@pytest.mark.parametrize("at", [1500, 2000, 2001, 2003, 2005, 2008])
@pytest.mark.parametrize("size", [1e9, -50.0])
def test_a_lone_outlier_is_no_finding_and_hides_none(nominal, simulated, relocate, at, size):
    run = simulated(14.0, seed=1, faults={10.0: dict(nominal) | {"f_m": 0.075}})
    y = run.y.copy()
    y[at] += size
    theta = relocate.run(run.u, y)
    (finding,) = relocate.findings
    assert finding.parameters == ("f_m",)
    assert theta[-1, 2] == pytest.approx(0.075, rel=0.02)


def test_a_suspect_that_changed_is_known_two_seconds_later(nominal, simulated, relocate):
    run = simulated(12.0, seed=3, faults={6.0: dict(nominal) | {"k_g": 0.8 * nominal["k_g"]}})
    relocate.run(run.u[:1500], run.y[:1500])
    i = relocate._design.model.names.index("k_g")
    assert relocate._judge.memory.state["P"][i, i] > 0
    relocate.run(run.u[1500:], run.y[1500:])
    state = relocate._judge.memory.state
    assert not state["P"][i].any() and not state["claim"][:, i].any()
    assert state["theta"][i] == pytest.approx(0.8, rel=0.02)


def test_a_late_finding_leaves_the_noise_as_it_was(nominal, simulated):
    """What came before the refit is judged by what the refitted filter makes of it."""
    run = simulated(12.0, seed=3, faults={6.0: dict(nominal) | {"f_m": 0.075}})
    slow = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T)
    slow._judge.policy = type(slow._judge.policy)(T, looks=(0.35, 0.5))
    slow.run(run.u, run.y)
    (finding,) = slow.findings
    assert finding.parameters == ("f_m",) and finding.alarm - 1200 > 60
    assert slow._judge.memory.state["noise"] == pytest.approx(0.01, rel=0.2)  # four deviations


def test_an_alarm_restores_what_was_normal(nominal, simulated):
    """What the fault did to the residual until it was heard is not learnt."""
    run = simulated(7.0, seed=3, faults={6.0: dict(nominal) | {"k_T": 0.5}})
    deaf = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T, alarm=1e9)
    deaf.run(run.u[:1220], run.y[:1220])
    state = deaf._judge.memory.state
    learnt = {name: state[name].copy() for name in NORMAL}
    case = opened(deaf._judge.memory, T)
    row = case.before.at(case.onset)
    assert 1190 < case.onset < 1205 and case.normal.variance == row["noise"]
    for name in NORMAL:
        np.testing.assert_array_equal(state[name], row[name])
        assert np.any(learnt[name] != row[name])
    assert not state["armed"] and not state["learning"]


@pytest.mark.parametrize("period", [0.001, 0.002, 0.01])
def test_at_other_rates(nominal, by_hand, period):
    u, y = slow_axis(nominal, by_hand, period)
    filter_ = Relocate(three_mass(nominal), suspects=SUSPECTS, P0=P0 * period / T, period=period)
    theta = filter_.run(u, y)
    truth = three_mass(nominal).parametrize(NAMES).theta
    assert filter_.findings == ()
    np.testing.assert_allclose(theta[-1], truth, rtol=0.015)


def test_a_copy_goes_on_by_itself(nominal, simulated, relocate):
    run = simulated(8.0, seed=1, faults={5.0: dict(nominal) | {"f_m": 0.1}})
    relocate.run(run.u[:1003], run.y[:1003])
    other = relocate.copy()
    np.testing.assert_array_equal(
        other.run(run.u[1003:], run.y[1003:]), relocate.run(run.u[1003:], run.y[1003:])
    )
    assert other.findings == relocate.findings
    assert other._judge.memory is not relocate._judge.memory


@pytest.mark.parametrize("option", ["alarm", "gain", "period", "noise"])
@pytest.mark.parametrize("value", [float("nan"), 0.0, -1.0])
def test_options_are_checked(nominal, option, value):
    options = dict(P0=P0, period=T) | {option: value}
    with pytest.raises(EstimatorError, match=option):
        Relocate(three_mass(nominal), **options)


@pytest.mark.parametrize("size", [1e6, 1e30, 1e300])
@pytest.mark.parametrize("at", [[700], [30, 31, 32], [2010, 2011, 2012, 2013], [2500, 2502, 2504]])
def test_nonsense_is_as_good_as_missing(nominal, simulated, relocate, at, size):
    """To the last bit, before and after a fault at 10 s: it is in no fit, no alarm and no mean."""
    run = simulated(15.0, faults={10.0: {**nominal, "f_m": 0.1}})
    valid = np.ones(len(run.u), bool)
    valid[at] = False
    missing = relocate.run(run.u, run.y, valid)
    relocate.reset()
    nonsense = run.y.copy()
    nonsense[at] = size * np.where(np.arange(len(at)) % 2, -1.0, 1.0)
    np.testing.assert_array_equal(relocate.run(run.u, nonsense), missing)
    assert [f.parameters for f in relocate.findings] == [("f_m",)]
