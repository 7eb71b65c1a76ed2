"""Interacting multiple models on an axis with friction: parts by hand, and as a whole."""

from functools import cache

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError
from flexaxis.estimators.finding import Finding
from flexaxis.estimators.methods.imm import joint_imm
from flexaxis.estimators.methods.imm_friction import imm_friction
from flexaxis.estimators.models.axes import N1, three_mass
from flexaxis.estimators.recursion.as_told import as_told, told_records
from flexaxis.estimators.recursion.changes import single_change
from flexaxis.estimators.recursion.design import make_design
from flexaxis.estimators.recursion.jumps import AGES, Jumps
from flexaxis.estimators.recursion.modal import Modes
from flexaxis.estimators.recursion.records import joined, record
from flexaxis.estimators.recursion.tracker import Tracker
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.scoring.theta import started_nominal
from flexaxis.sim.simulate import simulate

T, SIGMA = 0.005, 0.1
RNG = np.random.default_rng(4)


@cache
def drawn(name):
    """Torque and speed of a scenario with what an estimator is told of it."""
    scenario = find_scenario(name)
    one = simulate(scenario, [0])[0]
    return one.torque, one.speed, dict(started_nominal(scenario)), nominal_torque(scenario)


def made(name, **options):
    _, _, nominal, torque = drawn(name)
    return imm_friction(nominal, T, torque=torque, **options)


# ------------------------------------------------------------------ parts


@pytest.mark.slow
def test_one_linearisation_is_all_there_is_where_the_model_is_linear():
    """With k_T alone ξ = [k_T; x] moves linearly, so a filter a mode gives the same."""
    model, N = three_mass(N1), 3000
    u = RNG.normal(size=N)
    y = joint_speed(model, u, np.where(np.arange(N) < 2000, 1.0, 0.8))
    walk, jump, hold, rate = 1e-3, 0.2, 0.1, 0.1
    each = joint_imm(
        model,
        identify=["k_T"],
        P0=[0.04],
        drift=[walk**2 * T],
        jump=[jump**2 * T / hold],
        rate=rate,
        hold=hold,
        period=T,
        noise=SIGMA,
    )
    design = make_design(
        model, identify=["k_T"], theta0=None, P0=[0.04], period=T, noise=SIGMA, scale=[1.0]
    )
    modes = Modes(
        which=(0,),
        walk=np.array([walk**2 * T]),
        jump=np.array([jump**2 * T / hold]),
        rate=np.array([rate]),
        hold=hold,
    )
    shared = Tracker(
        design,
        tracked=1,
        modes=modes,
        told=(),
        fixable={},
        x0_covariance=np.zeros((5, 5)),
        commissioning=0,
    )
    shared.state["echo"][0, 1] = 1e30  # innovations in a row count each, as they do there
    expected = each.run(u, y)
    assert abs(expected[-1, 0] - 0.8) < 0.02
    np.testing.assert_allclose(shared.run(u, y), expected, rtol=1e-7)
    np.testing.assert_allclose(shared.covariance, each.covariance, rtol=1e-6)


def joint_speed(model, u, k_T):
    """Speed with noise for a k_T that changes."""
    from flexaxis.estimators.offline.predictor import predict

    one = model.parametrize(["k_T"])
    return predict(one, [1.0], k_T * u, period=T)[0] + SIGMA * RNG.normal(size=len(u))


def test_what_was_told_is_conditioning_by_hand():
    q, p, modes = 2, 5, 3
    root = RNG.normal(size=(modes, p, p))
    P, delta = root @ root.transpose(0, 2, 1), RNG.normal(size=(modes, p))
    weight = np.array([0.5, 0.3, 0.2])
    delta -= weight @ delta
    theta, told = RNG.normal(size=p), np.array([0.3, -0.2])
    tuning, state = told_records(q, [([2, 4], told)])
    state = joined(state, record(theta=theta, P=P, delta=delta, predicted=weight))
    given = np.empty(q)
    _run_plain(tuning, state, given)
    S = np.einsum("j,jab->ab", weight, P) + np.einsum("j,ja,jb->ab", weight, delta, delta)
    apart = told - theta[[2, 4]]
    inverse = np.linalg.inv(S[np.ix_([2, 4], [2, 4])])
    share = 1 / (1 + np.exp((apart @ inverse @ apart - 5.991464547107979) / 2))  # χ²(2), 95 %
    expected = theta[:q] + share * S[:q][:, [2, 4]] @ inverse @ apart
    assert 0.05 < share < 0.99
    np.testing.assert_allclose(given, expected, rtol=1e-9)
    union = tuning["union"][0]
    full, d = S[np.ix_(union, union)], S[np.ix_(union, [2, 4])] @ inverse @ apart
    part = S[np.ix_(union, [2, 4])] @ inverse @ S[np.ix_([2, 4], union)]
    claimed = state["given_P"][0] + state["given_between"][0]
    mixture = share * (full - part) + (1 - share) * full + share * (1 - share) * np.outer(d, d)
    np.testing.assert_allclose(claimed, mixture, rtol=1e-9, atol=1e-12)


def _run_plain(tuning, state, given):
    from numba import njit

    call = as_told.dispatcher

    @njit
    def run(tunings, states, given):
        call(tunings[0], states[0], given)

    run(tuning, state, given)


def test_the_best_single_change_is_generalised_least_squares():
    root = RNG.normal(size=(4, 4))
    C = root @ root.T
    d = 7.0 * np.eye(4)[2] + 0.1 * RNG.normal(size=4)
    change = single_change(d, C)
    weights = np.linalg.inv(C)
    left = [
        min(
            (d - a * np.eye(4)[i]) @ weights @ (d - a * np.eye(4)[i])
            for a in np.linspace(-9, 9, 18001)
        )
        for i in range(4)
    ]
    assert change.index == int(np.argmin(left)) == 2
    assert change.gain == pytest.approx(d @ weights @ d - left[2], abs=1e-3)
    assert change.size == pytest.approx(7.0, abs=3 * change.deviation)
    assert change.deviation == pytest.approx(weights[2, 2] ** -0.5)


def test_what_is_fixed_or_lost_explains_nothing():
    C = np.diag([1.0, 0.0])
    assert single_change(np.array([3.0, 9.0]), C).index == 0
    assert single_change(np.array([np.nan, 1.0]), C).gain == 0.0


def watched(period=T, q=2):
    """What `Jumps` reads of a filter: nothing has changed, and a jump is always likely."""
    ring = np.zeros((500, q + q * q + 1))
    ring[:, :q], ring[:, q : q + q * q], ring[:, -1] = 1.0, 0.01 * np.eye(q).ravel(), 0.9
    return record(ring=ring, samples_taken=0, due=-1, armed=1, calm=0)


def test_alarms_between_looks_do_not_leave_one_due_of_which_nothing_was_found():
    """An alarm comes again and again: each begins anew, and all looks end by themselves."""
    jumps, state, looks = Jumps(["k_T", "f_m"], T), watched(), []
    alarms = {600, 601, 602, 605, 640, 641, *range(700, 720)}
    for k in range(2000):
        state["samples_taken"] = k + 1
        if k in alarms or k == state["due"][0]:
            jumps.attend(state)
            looks.append(k)
    assert jumps.findings == []
    assert not jumps.alarm
    assert state["due"] == -1
    last, ages = 719, np.round(np.cumsum(AGES) / T)
    np.testing.assert_array_equal(looks[-len(AGES) :], last + ages)


def test_a_look_that_ended_does_not_name_an_older_finding():
    jumps, state = Jumps(["k_T", "f_m"], T), watched()
    jumps.findings.append(older := Finding(10, 9, ("f_m",), (1.5,)))
    for k in range(600, 2000):
        state["samples_taken"] = k + 1
        if k in {600, 650, 651, 652, 653} or k == state["due"][0]:
            jumps.attend(state)
    assert jumps.findings == [older]


# ------------------------------------------------------------------ as a whole


def test_chunks_find_what_a_run_finds():
    """Also where a chunk ends while a jump is likely, but not significant yet."""
    u, y, *_ = (v[:1600] for v in drawn("load_friction_fm_step-v1")[:2])
    whole, parts = made("load_friction_fm_step-v1"), made("load_friction_fm_step-v1")
    looks, part_looks = _looks(whole), _looks(parts)
    expected = whole.run(u, y)
    taken = [parts.run(u[k : k + 20], y[k : k + 20]) for k in range(0, len(u), 20)]
    np.testing.assert_array_equal(np.concatenate(taken), expected)
    assert part_looks == looks
    assert len(looks) > 10
    assert parts.findings == whole.findings
    assert parts.learnt == whole.learnt
    np.testing.assert_array_equal(parts.covariance, whole.covariance)
    assert not parts._first  # samples of commissioning are needed once


def _looks(estimator):
    """Return a list to which the samples are added at which an estimator looks at a jump."""
    looks, attend = [], estimator._jumps.attend

    def noted(state):
        looks.append(int(state["samples_taken"][0]) - 1)
        attend(state)

    estimator._jumps.attend = noted
    return looks


def test_what_is_shown_is_what_a_run_returned():
    u, y, *_ = (v[:1300] for v in drawn("fm_step-v1")[:2])
    estimator = made("fm_step-v1")  # without friction, so that f_c is drawn to none
    theta = estimator.run(u, y)
    np.testing.assert_array_equal(estimator.theta, theta[-1])
    shown = [estimator.learnt[name] for name in estimator.names]
    np.testing.assert_array_equal([value for value, _ in shown], theta[-1])
    deviations = np.sqrt(np.diag(estimator.covariance))
    np.testing.assert_array_equal([deviation for _, deviation in shown], deviations)
    undrawn = estimator.commissioned()
    assert abs(theta[-1, 3]) < abs(undrawn["nominal"]["f_c"])
    assert deviations[3] < undrawn["deviations"]["f_c"]


def test_the_sample_in_which_it_begins_anew_has_an_estimate():
    estimator, u = made("fm_step-v1", commissioning=0.0), RNG.normal(size=20)
    estimator.run(u, np.zeros(20))
    estimator.state["anew"] = 1.0
    theta = estimator.run(u, np.zeros(20))
    assert estimator.state["samples_taken"][0] == 19  # it did
    assert (theta[0] != 0).all()


def test_friction_is_told_from_viscous_friction_and_a_fault_is_named():
    u, y, *_ = drawn("coulomb_fm_step-v1")
    estimator = made("coulomb_fm_step-v1")
    theta = estimator.run(u, y)
    assert estimator.names == ("k_T", "1/J_a", "f_m", "f_c")
    before = theta[1000:2000].mean(axis=0) / [1.0, 1.25, 0.05, 0.1] - 1
    assert np.all(np.abs(before) < [0.01, 0.005, 0.02, 0.04])
    assert T * np.abs(theta[2000:3000, 2] - 0.075).sum() / 0.025 < 0.3
    (finding,) = estimator.findings
    assert 2000 <= finding.alarm < 2060
    assert abs(finding.onset - 2000) < 60
    assert finding.parameters == ("f_m",)
    low, high = finding.interval[0]
    assert low < 1.5 < high < low + 0.4
    assert not estimator.fixed_because


def test_steps_are_a_run_and_a_copy_goes_on_by_itself():
    u, y, *_ = (
        values[:1200] if isinstance(values, np.ndarray) else values
        for values in drawn("coulomb_fm_step-v1")
    )
    run, step = made("coulomb_fm_step-v1"), made("coulomb_fm_step-v1")
    expected = run.run(u, y)
    taken = np.array([step.step(*pair) for pair in zip(u[:900], y[:900], strict=True)])
    np.testing.assert_array_equal(taken, expected[:900])
    other = step.copy()
    np.testing.assert_array_equal(step.run(u[900:], y[900:]), expected[900:])
    np.testing.assert_array_equal(other.run(u[900:], y[900:]), expected[900:])
    run.reset()
    np.testing.assert_array_equal(run.run(u, y), expected)


@pytest.mark.slow
def test_point_to_point_moves_leave_the_scale_as_told():
    u, y, *_ = drawn("coulomb_moves_fm_step-v1")
    estimator = made("coulomb_moves_fm_step-v1")
    theta = estimator.run(u[:2000], y[:2000])
    assert "J_m" in estimator.fixed_because
    assert "as it was told" in estimator.fixed_because["J_m"]
    assert estimator.learnt["J_m"] == (N1["J_m"], 0.0)
    assert abs(theta[1900, 0] - 1) < 0.03


def test_a_gap_and_a_start_in_motion_do_no_harm():
    u, y, *_ = drawn("coulomb_fm_step-v1")
    valid = np.ones(len(u), bool)
    valid[1500:1560] = False
    part = slice(450, 2000)
    theta = made("coulomb_fm_step-v1").run(u[part], y[part], valid[part])
    error = theta[-200:].mean(axis=0) / [1.0, 1.25, 0.05, 0.1] - 1
    assert np.all(np.abs(error) < [0.01, 0.005, 0.03, 0.05])


def test_what_was_commissioned_can_be_begun_from():
    u, y, nominal, torque = drawn("coulomb_fm_step-v1")
    first = made("coulomb_fm_step-v1")
    first.run(u[:2000], y[:2000])
    known = first.commissioned()
    assert set(known["deviations"]) == set(known["nominal"])
    assert known["nominal"]["J_a"] == pytest.approx(0.8, rel=0.01)
    second = imm_friction(
        nominal | known["nominal"], T, torque=torque, deviations=known["deviations"]
    )
    theta = second.run(u[1000:1400], y[1000:1400])
    assert np.all(np.abs(theta[100:] / [1.0, 1.25, 0.05, 0.1] - 1) < [0.02, 0.01, 0.05, 0.06])


def test_what_is_told_of_laws_is_drawn_to_and_the_rest_to_none():
    _, _, nominal, torque = drawn("fm_step-v1")
    told = {"f_c": 0.1, "kappa": 1e3}
    estimator = imm_friction(nominal | told, T, torque=torque)
    names, scale = estimator._design.model.names, estimator._design.scale
    drawn_to = {names[i]: value * scale[i] for i, value in estimator._told.items()}
    assert drawn_to["f_c"] == pytest.approx(0.1)
    assert drawn_to["kappa"] == pytest.approx(1e3)
    assert drawn_to["f_s"] == drawn_to["gap"] == 0.0
    assert drawn_to["J_m"] == pytest.approx(nominal["J_m"])


def test_what_is_not_seen_and_was_not_told_is_taken_as_absent():
    """At rest nothing is seen."""
    _, _, nominal, torque = drawn("fm_step-v1")
    estimator = imm_friction(nominal | {"kappa": 1e3}, T, torque=torque, commissioning=0.5)
    estimator.run(np.zeros(200), np.zeros(200))
    because = estimator.fixed_because
    assert because["kappa"].endswith("stays as it was told")
    assert because["J_m"].endswith("stays as it was told")
    assert because["gap"].endswith("taken as absent")
    assert estimator.learnt["kappa"] == (pytest.approx(1e3), 0.0)
    assert estimator.learnt["gap"] == (0.0, 0.0)


@pytest.mark.slow
def test_a_told_zero_is_refused_by_its_name():
    _, _, nominal, torque = drawn("fm_step-v1")
    with pytest.raises(EstimatorError, match=r"^f_m is told to be 0, .* leave it out"):
        imm_friction(nominal | {"f_m": 0.0}, T, torque=torque)
    left = {"identify": ("k_T", "1/J_a"), "track": ("k_T", "1/J_a", "f_c")}
    estimator = imm_friction(nominal | {"f_m": 0.0}, T, torque=torque, **left)
    assert estimator.names == ("k_T", "1/J_a", "f_c")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"learn": ["J_x"]}, "no parameter for that"),
        ({"learn": "all"}, "or 'auto' or 'none'"),
        ({"hold": 0.001}, "lasts more than one sample"),
        ({"walk": 0.0}, "walk is 0"),
        ({"deviations": {"J_a": -1.0}}, "above 0"),
        ({"commissioning": -1.0}, "not negative"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options, match):
    with pytest.raises(EstimatorError, match=match):
        imm_friction(N1, T, **options)


@pytest.mark.slow
def test_nothing_is_learnt_where_nothing_shall_be():
    estimator = imm_friction(N1, T, learn="none")
    assert set(estimator.learnt) == {"k_T", "1/J_a", "f_m", "f_c"}
