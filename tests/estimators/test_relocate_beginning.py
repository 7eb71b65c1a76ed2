"""How `relocate-friction` begins: what it hears, learns, takes as told, and what noise it finds."""

from functools import cache

import numpy as np
import pytest
from acceptance.axes import AXES
from acceptance.axes import simulate as by_hand
from acceptance.measures import make

from flexaxis.estimators.finding import UNEXPLAINED
from flexaxis.estimators.methods.friction import rpem_friction
from flexaxis.estimators.methods.imm_friction import imm_friction
from flexaxis.estimators.models.axes import N1, one_mass
from flexaxis.estimators.recursion.seen import AS_TOLD, NOT_ASKED_FOR, NOT_THERE, seen
from flexaxis.estimators.relocate.beginning import FITTED
from flexaxis.estimators.relocate.entry import relocate_friction
from flexaxis.estimators.relocate.needed import Posterior, Question, needed
from flexaxis.estimators.relocate.opened import opened
from flexaxis.estimators.relocate.policy import LATER, LOOKS, Policy
from flexaxis.estimators.relocate.remainder import remainder
from flexaxis.estimators.sampling.sampled import planned
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.scoring.theta import started_nominal
from flexaxis.sim.simulate import simulate

T = 0.005
LAWS = {"f_c": 0.1, "f_s": 0.02, "v_s": 0.5, "sigma_0": 700.0, "sigma_1": 0.5, "v_0": 0.25}
LAWS |= {"kappa": 0.0, "gap": 0.0}


@cache
def drawn(name):
    """Torque and speed of a scenario with what an estimator is told of it."""
    scenario = find_scenario(name)
    one = simulate(scenario, [0])[0]
    return one.torque, one.speed, dict(started_nominal(scenario))


def test_what_is_left_tells_as_much_as_its_correlation_allows():
    rng, N, rho = np.random.default_rng(0), 40_000, 0.5
    model = one_mass({"k_T": 1.0, "J_m": 6e-3, "f_m": 0.05}).parametrize(["f_m"])
    terms = planned(model, 0.1 * model.theta, 10 * model.theta, T)
    noise = 0.1 * rng.standard_normal(N)
    for k in range(1, N):
        noise[k] += rho * noise[k - 1]
    present = rng.random(N) < 0.9
    signals = np.zeros((N, 2)), noise, present
    left = remainder(terms, model.theta, np.zeros(terms.n), signals, 3)
    assert left.variance == pytest.approx(0.01 / (1 - rho**2), rel=0.03)
    assert left.share == pytest.approx(1.0) and not left.explained  # the model is at rest
    white = remainder(
        terms, model.theta, np.zeros(terms.n), (signals[0], rng.standard_normal(N), present), 3
    )
    assert white.repeated == pytest.approx(1.0, abs=0.05) and white.explained  # all may be noise
    seen_rho = 0.9 * rho  # a tenth of the neighbours is missing
    assert left.repeated == pytest.approx((1 + seen_rho) / (1 - seen_rho), rel=0.05)


def test_what_is_seen_is_four_times_better_known_than_before():
    assert seen([0.9, 0.07, 0.06, 0.0], 1.0).tolist() == [False, False, True, True]


def test_what_is_not_seen_is_as_told_whatever_the_data_say():
    none = np.array([], int)
    posterior = Posterior(np.arange(2), np.array([5.0, 1.0]), np.array([[100.0, 50], [50, 100.0]]))
    question = Question(np.array([0]), np.zeros(1), none)
    known = {"mean": np.zeros(2), "deviation": np.ones(2)}
    asked, fixed = needed(posterior, [question], **known)
    assert asked.active.tolist() == [0, 1] and not fixed  # the data contradict
    left, fixed = needed(posterior, [question], **known, unseen=[question])
    assert left.active.tolist() == [1]
    assert left.theta[0] == pytest.approx(1.0 + 50 * 5.0 / 100)  # given that
    assert [places.tolist() for places, _ in fixed] == [[0]]


def test_a_case_that_nothing_explains_is_closed_before_later_looks():
    learns = Policy(T, looks=(*LOOKS, *LATER), adapting=True)
    last, settled = learns.ages[-1], round(0.5 / T)
    assert [learns.ends(age, None) for age in (settled - 1, settled)] == [False, True]
    assert [learns.ends(age, 0) for age in (settled, last)] == [False, True]
    plain = Policy(T)
    assert [plain.ends(age, None) for age in (settled - 1, plain.ages[-1])] == [False, True]


def test_nothing_is_heard_before_the_last_fit():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_, armed = relocate_friction(nominal, T), []
    for k in range(0, 1000, 100):
        filter_.run(u[k : k + 100], y[k : k + 100])
        armed.append(int(filter_._judge.memory.state["armed"]))
    assert armed[2:] == [0] * 6 + [1] * 2  # before that no noise is known to listen with
    assert not filter_.findings


def test_the_noise_of_a_fit_is_what_it_leaves():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal, T)
    filter_.run(u[:205], y[:205])
    first = filter_._judge.commission._prior.noise
    filter_.run(u[205:1000], y[205:1000])
    # what a model without friction leaves of the first second is rougher than the noise is
    assert first == pytest.approx(0.01, rel=0.4)  # 200 samples less 16 parameters: 10 %, 4 times
    assert filter_._judge.commission._prior.noise == pytest.approx(0.01, rel=0.25)


def test_it_says_what_is_as_told_and_what_is_absent():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal, T)
    assert filter_.fixed_because == {}
    filter_.run(u[:1000], y[:1000])
    because = filter_.fixed_because
    assert because["J_m"] in {AS_TOLD, NOT_ASKED_FOR}
    assert because["kappa"] == because["gap"] == NOT_THERE
    assert not {"k_T", "1/J_a", "f_m", "f_c", "sigma_0"} & set(because)


def test_moves_leave_the_scale_as_told():
    u, y, nominal = drawn("coulomb_moves_fm_step-v1")
    filter_ = relocate_friction(nominal, T)
    theta = filter_.run(u[:2000], y[:2000])
    assert {filter_.fixed_because[name] for name in ("J_m", "k_g", "k_a")} == {AS_TOLD}
    assert abs(theta[1900, 0] - 1) < 0.03
    assert abs(theta[1900, 2] / 0.05 - 1) < 0.03


def test_a_change_behind_an_alarm_that_nothing_explains_is_found():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal, T)
    filter_.run(u[:1951], y[:1951])
    filter_._judge.case = opened(filter_._judge.memory, T)  # a false alarm, .25 s before the change
    filter_._judge.memory.state["stop"] = filter_._judge._next_stop(present=True)
    filter_.run(u[1951:2300], y[1951:2300])
    (finding,) = filter_.findings
    assert finding.reason != UNEXPLAINED
    assert finding.parameters == ("f_m",) and abs(finding.onset - 2000) <= 10
    assert finding.alarm <= 1950 + 0.5 / T + 10


def test_told_of_its_laws_it_is_commissioned_in_a_second():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal | LAWS, T)
    theta = filter_.run(u[:240], y[:240])
    assert not filter_._judge.commission.goes_on(240)
    assert (abs(theta[:200, 3] - 0.1) < 1e-12).all()  # friction acts from the first sample on
    assert abs(theta[-1, 3] / 0.1 - 1) < 0.1
    part = {name: LAWS[name] for name in ("f_c", "f_s")}
    some = relocate_friction(nominal | part, T)
    some.run(u[:240], y[:240])
    assert some._judge.commission.goes_on(240) and FITTED[-1] > 1


@pytest.mark.parametrize("make", [rpem_friction, imm_friction])
def test_what_is_told_of_friction_is_where_an_estimator_starts(make):
    _, _, nominal = drawn("coulomb_fm_step-v1")
    torque = nominal_torque(find_scenario("coulomb_fm_step-v1"))
    told = make(nominal | LAWS, T, torque=torque, noise=0.1)
    not_told = make(nominal, T, torque=torque, noise=0.1)
    where = told.names.index("f_c")
    assert told.theta[where] == pytest.approx(0.1)

    def deviation(filter_):
        design = filter_._design
        return np.sqrt(np.diag(design.P0)[where]) * design.scale[where]

    assert deviation(told) / deviation(not_told) == pytest.approx(0.02 / 0.1275, rel=0.05)


def test_its_prior_of_what_is_told_is_narrow():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal | LAWS, T)
    filter_.run(u[:205], y[:205])
    prior, design = filter_._judge.commission._prior, filter_._design
    where = design.model.names.index("f_c")
    assert prior.theta[where] * design.scale[where] == pytest.approx(0.1)
    assert prior.deviation[where] * design.scale[where] == pytest.approx(0.02)
    assert N1["k_g"] * 0.1 == pytest.approx(
        (prior.deviation * design.scale[: len(prior.deviation)])[design.model.names.index("k_g")]
    )


def test_dry_friction_walks_relative_to_what_it_is_found_to_be():
    u, y, nominal = drawn("coulomb_fm_step-v1")
    filter_ = relocate_friction(nominal, T, walk=2e-3)
    filter_.run(u[:1000], y[:1000])
    judge, scale = filter_._judge, filter_._design.scale
    memory, prior = judge.memory, judge.commission._prior
    walks = np.sqrt(np.diag(memory.drift) * prior.noise / T)[:4] * scale[:4]
    np.testing.assert_allclose(walks[:3], 2e-3 * np.array([1.0, 1.25, 3 * 0.05]), rtol=1e-9)
    assert walks[3] == pytest.approx(2e-3 * 3.0 * 0.1, rel=0.05)  # of .1 N m, as it is


@pytest.mark.parametrize("at", [[100], [150, 151, 152]])
def test_nonsense_in_the_first_seconds_is_as_good_as_missing(at):
    """What a gap holds has no part in sizes, prior and fit either."""
    run = by_hand(AXES["n1"], 5.0)
    valid = np.ones(len(run.u), bool)
    valid[at] = False
    nonsense, estimator = run.y.copy(), make("relocate-friction")
    nonsense[at] = 1e30
    missing = estimator.run(run.u, run.y, valid)
    for given in ((nonsense,), (nonsense, valid)):
        estimator.reset()
        np.testing.assert_array_equal(estimator.run(run.u, *given), missing)


def test_what_a_gap_holds_is_no_motion():
    """The sizes of laws that nobody told come from how the axis has moved."""
    run, estimator, priors = by_hand(AXES["n1"], 2.0), relocate_friction(N1, T), []
    valid = np.arange(len(run.u)) != 100
    for held in (run.y[100], 1e30):
        y = run.y.copy()
        y[100] = held
        estimator.reset()
        estimator.run(run.u, y, valid)
        prior = estimator._judge.commission._prior
        priors.append(np.r_[prior.theta, prior.deviation])
    np.testing.assert_array_equal(priors[1], priors[0])
