"""Friction of a gear in a filter with a bank: which of two models of friction goes on."""

from types import SimpleNamespace

import numpy as np
import pytest

from flexaxis.estimators.glr.contest import LEAD, TOGETHER, Contest
from flexaxis.estimators.glr.mixture import _between
from flexaxis.estimators.offline.structure import with_laws
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.nominal import nominal_torque
from flexaxis.experiments.scoring.parameter_names import started_nominal
from flexaxis.sim.simulate import simulate

FIRST, PERIOD = 800, 0.005


def traces(ours, theirs, N=TOGETHER, claimed=(1.0, 1.0)):
    """What two filters predict whose innovations have these deviations, and what they claim."""
    noise = np.random.default_rng(0).standard_normal(N)  # both measure the same
    for deviation, variance in zip((ours, theirs), claimed, strict=True):
        e = deviation * noise
        yield np.column_stack([np.zeros(N), e, np.full(N, variance)])


def held(ours, theirs, *, blocks=40, shaped=False, **options):
    contest = Contest(FIRST, PERIOD)
    one, other = traces(ours, theirs, blocks * TOGETHER, **options)
    for start in range(0, len(one), TOGETHER):
        part = slice(start, start + TOGETHER)
        contest.take(one[part], other[part], awake=True, shaped=shaped)
        if contest.over:
            return contest.won, start // TOGETHER
    return contest.won, None


def test_who_predicts_better_goes_on():
    assert held(1.5, 1.0) == (True, 1)
    assert held(1.0, 1.5) == (False, 1)
    won, after = held(1.0, 1.0)
    assert not won and after == 1 + FIRST // TOGETHER  # for none leads by so much


def test_what_they_claim_of_the_noise_is_right_but_for_a_factor():
    assert held(1.5, 1.0, claimed=(1e-6, 1e4)) == (True, 1)
    assert held(1.0, 1.5, claimed=(1e4, 1e-6)) == (False, 1)
    assert held(1.0, 1.5, claimed=(1e-6, 1e4)) == (False, 1)  # or too little


def test_a_shape_is_given_up_for_more_and_not_at_once():
    lead = TOGETHER * np.log(1.7)  # nats in a block
    assert LEAD < lead < 3 * LEAD
    assert held(1.7, 1.0)[1] == 1 and held(1.7, 1.0, shaped=True) == (True, 2)
    assert held(1.0, 1.7, shaped=True) == (False, 1 + FIRST // TOGETHER)


def of_drive(name, seed=0):
    scenario = find_scenario(name)
    return build(parse("glr[gear=true]"), scenario), simulate(scenario, [seed])[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mx64_fc_step-v1", "xl330_fm_step-v1"])
def test_a_drive_is_known_by_the_friction_of_its_gear(name):
    """Without it the torque constant is off by 30 and 5 %, the inertia of the arm by 11 and 9 %."""
    made, record = of_drive(name)
    theta = made.run(record.torque[:1900], record.increment[:1900])
    assert "gear" in made.shape and "mu_m" in made.learnt and "sigma_0" not in made.learnt
    truth = find_scenario(name).nominal
    assert theta[1000:, 0].mean() == pytest.approx(truth.k_T, rel=0.01)
    assert theta[1000:, 1].mean() == pytest.approx(1 / truth.J_a, rel=0.015)
    assert not made.findings


@pytest.mark.slow
def test_what_is_tracked_besides_has_its_own_scale():
    """The Stribeck speed of a gear has another size than that of bristles."""
    scenario = find_scenario("mx64_fc_step-v1")
    made = build(parse('glr[gear=true,track=["k_T","1/J_a","f_m","f_c","v_s"]]'), scenario)
    record = simulate(scenario, [0])[0]
    theta = made.run(record.torque[:1900], record.increment[:1900])
    assert "gear" in made.shape and made.names[-1] == "v_s"
    np.testing.assert_allclose(theta[-1], made.theta, rtol=1e-9)


@pytest.mark.slow
def test_samples_one_by_one_are_those_of_a_run_and_a_reset_begins_again():
    made, record = of_drive("mx64_fc_step-v1")
    u, y = record.torque[:900], record.increment[:900]
    theta = made.run(u, y)
    assert made.shape
    made.reset()
    assert not made.shape and "mu_m" not in made.learnt
    other = made.copy()
    steps = [other.step(*sample) for sample in zip(u, y, strict=True)]
    np.testing.assert_array_equal(steps, theta)
    assert other.shape and not made.shape


def test_who_is_told_of_the_gear_begins_with_its_friction():
    scenario = find_scenario("mx64_fc_step-v1")
    nominal = dict(started_nominal(scenario)) | {"mu_m": 0.3}
    model = with_laws(nominal, torque=nominal_torque(scenario), period=scenario.period)
    assert model.laws[0].kind == "gear" and model.nominal["mu_m"] == 0.3
    assert model.nominal["mu_e"] == pytest.approx(0.1) and model.nominal["v_s"] > 0


def test_of_one_hypothesis_what_is_uncertain_of_its_size_remains():
    """What lies between hypotheses is none of one; 1/(J/κ + 1/v) of a jump stays."""
    bank = {"weight": np.ones(1), "D": np.eye(1), "size": np.array([3.0]), "J": np.array([8.0]),
            "kappa": 2.0}  # fmt: skip
    tuning = {"variance": np.array([0.25])}
    work = SimpleNamespace(
        bank=[bank], tuning=[tuning], p=1, jumps=SimpleNamespace(which=np.zeros(1))
    )
    assert _between(work) == pytest.approx(np.array([[1 / (8 / 2 + 1 / 0.25)]]))
