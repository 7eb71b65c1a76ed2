"""What estimators are told of an axis and asked about it, and how what they answer is scored."""

import re

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import in_a_line
from flexaxis.experiments.catalogue.find import find_scenario, scenarios
from flexaxis.experiments.running.estimators import Spec, build, parse
from flexaxis.experiments.scoring.excess import information
from flexaxis.experiments.scoring.nominal_torque import design_torque
from flexaxis.experiments.scoring.parameter_names import (
    started_nominal,
    started_theta,
    theta_over_time,
)
from flexaxis.experiments.scoring.score_table import rows
from flexaxis.experiments.scoring.scores import Track
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.scenario import parse_scenario
from flexaxis.sim.simulate import simulate

LINEAR = ("k_T", "1/J_a", "f_m")
DRY = "friction.coulomb = 0.1\n"
ASKED = DRY + 'identify = ["k_T", "1/J_a", "f_m", "f_c"]\n'
SHEET = "known = { poles = 24, torque_limit = 1.75, noise = 0.2, k_g = 1.1 }\n"
FAULT = '[[fault]]\nkind = "step"\nparameter = "f_c"\nat = 2.0\nfactor = 1.5\n'


def made(text="", fault=""):
    return parse_scenario(f'name = "x"\nduration = 4.0\nburn_in = 0.5\n{text}{fault}')


class Asks:
    """A user's class that keeps what it is given, and answers with the truth it made up."""

    names, output, laws = LINEAR, "speed", False

    def __init__(self, nominal, period, *, identify=(), noise=None):
        self.nominal, self.asked, self.noise = dict(nominal), tuple(identify), noise
        self.theta = np.array([1.0, 1.25, 0.05, 0.1, 0.0, 0.3])[: len(self.names)]
        self.covariance = np.diag(np.arange(1.0, 1 + len(self.names)))

    def step(self, u, y):
        return self.theta


class Tracks(Asks):
    names, laws = (*LINEAR, "f_c", "c_sin", "f_s"), True


def spec(name):
    return parse(f"{__name__}:{name}")


def test_the_data_sheet_reaches_everybody_as_it_is():
    nominal = build(spec("Asks"), made(SHEET)).nominal
    assert nominal.pop("poles") == 24 and nominal.pop("torque_limit") == 1.75
    assert nominal.pop("noise") == 0.2
    assert nominal.keys() == set(PARAMETER_NAMES) and nominal["k_g"] == pytest.approx(1.166e5)


def test_known_values_are_wrong_by_draws_of_their_own_and_the_plant_stays_where_it_is():
    exact, wrong = made(DRY), made(DRY + "known = { spread = 0.05, f_c = 1.2, poles = 24 }\n")
    draws = [started_nominal(wrong.drawn(seed)) for seed in range(200)]
    sizes = {name: np.log([draw[name] for draw in draws]) for name in draws[0]}
    assert wrong.drawn(3) is wrong.drawn(3)
    true = exact.nominal | {"f_c": 0.12, "poles": 24}
    for name in ("k_T", "J_a", "f_m", "r", "poles"):  # identified, or counted
        assert sizes.pop(name) == pytest.approx(np.log(true[name]))
    z = np.array([sizes[name] - np.log(true[name]) for name in true.keys() & sizes.keys()]) / 0.05
    # four standard deviations of the mean, the standard deviation and the correlation of 200 draws
    assert len(z) == 9 and abs(z.mean(axis=1)).max() < 4 / np.sqrt(200)
    assert abs(z.std(axis=1) - 1).max() < 4 / np.sqrt(400)
    assert abs(np.corrcoef(z) - np.eye(9)).max() < 4 / np.sqrt(200)
    other = wrong.override({"identify": ["k_g"]}, inherit=True).drawn(7)
    assert started_nominal(other)["d_g"] == draws[7]["d_g"]
    assert simulate(exact, [5])[0].speed.tobytes() == simulate(wrong, [5])[0].speed.tobytes()
    words = "known values wrong by 5 %; known poles = 24"
    assert not wrong.linear and in_a_line(wrong).endswith(words)


def test_who_is_not_told_has_no_entry_and_nobody_is_told_a_law():
    for text in ("", ASKED):
        assert started_nominal(made(text)).keys() == set(PARAMETER_NAMES)
    told = started_nominal(made(DRY + "known.f_c = 1.2\n"))
    assert told["f_c"] == pytest.approx(0.12) and len(told) == 13


def test_only_who_has_laws_is_asked_for_them():
    assert build(spec("Asks"), made(ASKED)).asked == LINEAR
    assert build(spec("Tracks"), made(ASKED)).asked == (*LINEAR, "f_c")
    assert build(spec("Tracks"), made(DRY)).asked == LINEAR
    with pytest.raises(EstimatorError, match=r"identifies only f_c, .*`laws`. Omit"):
        build(parse("rpem-forgetting"), made(DRY + 'identify = ["f_c"]\n'))


@pytest.mark.slow
def test_q_is_of_the_linear_parameters_of_identify():
    M = information(made(ASKED))
    assert not M[3].any() and not M[:, 3].any()
    # the phases of the nominal run are other ones, so that Q is the same but for some per cent
    assert np.diag(M)[:3] == pytest.approx(np.diag(information(made(DRY))), rel=0.05)


@pytest.mark.slow
def test_a_level_of_friction_near_zero_loses_no_run_and_one_far_above_does():
    asked, besides = made(ASKED), made(DRY)
    names = (*LINEAR, "f_c")
    truth = theta_over_time(asked, names)
    for scenario, factor, lost in (
        (asked, 0.0, False), (asked, 11.0, True), (besides, 11.0, False), (besides, np.nan, True)
    ):  # fmt: skip
        theta = truth * [1, 1, 1, factor]
        found = rows(Track(scenario, names, theta, scenario.true_parameters()))
        assert found[0]["diverged"] == lost, factor
    assert found[3]["std"] == pytest.approx(900.0)
    assert started_theta(asked, names)[3] == 0.1


def test_nothing_of_the_laws_shows_in_the_torque_that_estimators_are_offered():
    """Who is told the size of the motion is not told which laws act, or of a fault."""
    one = find_scenario("coulomb_fm_step-v1")
    other = one.override({"friction.coulomb": 0.2})
    np.testing.assert_array_equal(design_torque(one), design_torque(other))
    real = find_scenario("real_lugre_fm_step-v1")
    linear = find_scenario("fm_step-v1").override({"known": {"k_g": 1.1, "J_m": 0.95, "k_a": 0.95}})
    np.testing.assert_array_equal(design_torque(real), design_torque(linear))
    assert not np.array_equal(design_torque(real), design_torque(one))  # what is told does show
    offered = {}

    def mine(nominal, period, *, identify, output, torque):
        offered["torque"] = torque
        return REGISTRY["frozen"].factory(nominal, period, identify=identify, output=output)

    mine.laws = True
    build(Spec("mine", {}, mine), real)
    np.testing.assert_array_equal(offered["torque"], design_torque(real))


def test_errors_of_known_values_move_no_record():
    for name in (line["name"] for line in scenarios(group="known")):
        scenario, twin = find_scenario(name), re.sub("^known[0-9]+_", "", name)
        if twin != name:
            assert scenario.record_hash == find_scenario(twin).record_hash
