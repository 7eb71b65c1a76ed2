"""The demo without a screen: the loop, the faults, the race, the knobs and the dots."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.offline.priors import known_P
from flexaxis.experiments.demo.live_axis import SPELL, LiveAxis
from flexaxis.experiments.demo.racer import NAMES, Racer
from flexaxis.experiments.demo.session import MARK, DemoSession
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.parameters import preset
from flexaxis.sim.timing import PERIOD, rate

RATE = rate(PERIOD)
PAPER = ("rpem-forgetting", "rpem-drift")


def test_pieces_of_any_length_give_the_same_run():
    whole, pieces = LiveAxis(seed=3), LiveAxis(seed=3)
    expected = whole.advance(60)
    found = [pieces.advance(n) for n in (1, 7, 20, 32)]
    for name in ("torque", "speed"):
        parts = np.concatenate([getattr(part, name) for part in found])
        np.testing.assert_array_equal(parts, getattr(expected, name))
    assert pieces.time == pytest.approx(60 * PERIOD)


def test_the_axis_moves_as_in_the_catalogue():
    """Motor speed of rms 5 rad/s, torque of 0.85 N m: what the reference is scaled for."""
    axis = LiveAxis()
    axis.advance(1000)
    period = axis.advance(2000)
    assert np.std(period.speed) == pytest.approx(5.0, rel=0.03)
    assert np.std(period.torque) == pytest.approx(0.85, rel=0.05)


def test_stop_and_go_begins_when_it_is_chosen():
    axis = LiveAxis()
    axis.advance(RATE)
    axis.excitation = "stop-and-go"
    excited = axis.advance(round(SPELL * RATE) + 1).excited
    assert excited[:-1].all() and not excited[-1]


def test_noise_has_the_deviation_that_is_said():
    """It reaches the sensor of the speed alone: beside an axis without, the rest is the same."""
    noisy, quiet = LiveAxis(seed=3), LiveAxis(seed=3)
    noisy.noise, quiet.noise = 0.3, 0.0
    one, other = noisy.advance(2000), quiet.advance(2000)
    np.testing.assert_array_equal(one.torque, other.torque)
    assert np.std(one.speed - other.speed) == pytest.approx(0.3, rel=0.06)  # 4 sd of 2000


def test_both_racers_find_the_fault():
    session = DemoSession()
    session.advance(10 * RATE)
    session.inject("f_m", 2.0)
    session.advance(10 * RATE)
    assert session.axis.theta(NAMES)[2] == 0.1
    for racer in session.racers:
        np.testing.assert_allclose(racer.theta[:3], [1.0, 1.25, 0.1], rtol=0.05)
    session.repair()
    session.advance(10 * RATE)
    for racer in session.racers:
        np.testing.assert_allclose(racer.theta[:3], [1.0, 1.25, 0.05], rtol=0.05)


def test_the_race_is_what_the_estimator_does_alone():
    """Whatever the pieces in which the session advances, to the last bit."""
    session, axis = DemoSession(seed=1), LiveAxis(seed=1)
    for piece in (3, 50, 347):
        session.advance(piece)
    samples = axis.advance(400)
    alone = Rpem(
        three_mass(axis.nominal.as_dict()),
        P0=known_P(NAMES, forgetting=0.995),
        forgetting=0.995,
        period=0.005,
    )
    expected = alone.run(samples.torque, samples.speed)
    np.testing.assert_array_equal(session.racers[0].theta, expected[-1])
    np.testing.assert_array_equal(session.curves().theta[:, 0, :3], expected[MARK - 1 :: MARK])
    np.testing.assert_array_equal(session.racers[0].P, np.diag(alone.P))


def test_a_fault_gives_a_dot_with_the_scores_in_words():
    session = DemoSession(estimators=PAPER, seed=2)
    session.advance(10 * RATE)
    session.inject("f_m", 1.5)
    assert not session.points
    session.advance(5 * RATE)
    forgetting, drift = session.points
    assert (forgetting.parameter, forgetting.racer, drift.racer) == ("f_m", 0, 1)
    # known for many runs: lag 1.27 s and std 0.31 % with forgetting, 1.4 % with Δ, which is quicker
    assert forgetting.lag == pytest.approx(1.27, abs=0.4)
    assert forgetting.std == pytest.approx(0.31, rel=0.6)
    assert drift.std > 3 * forgetting.std and drift.lag < 0.5 * forgetting.lag


@pytest.mark.parametrize("knob", [{"forgetting": 0.99}, {"regularization": 0.3}])
def test_knobs_turn_while_it_runs(knob):
    """The estimate goes on where it was, the P as well, and the filter is settled."""
    session = DemoSession()
    session.advance(8 * RATE)
    racer = session.racers[0]
    before, P = racer.theta.copy(), racer.P
    session.tune(0, replace(racer.tuning, **knob))
    np.testing.assert_allclose(racer.P, P, rtol=1e-15)  # it went from the filter's units and back
    session.advance(1)
    np.testing.assert_allclose(racer.theta, before, rtol=5e-3)
    session.advance(RATE)
    np.testing.assert_allclose(racer.theta, [1.0, 1.25, 0.05], rtol=0.03)


def test_knobs_do_what_theory_says():
    """P = (1−λ) Q⁻¹, eq. (29); with one Δ_ii alone a hundred times as large P_ii is ten times."""
    session = DemoSession(estimators=PAPER, seed=4)
    session.advance(20 * RATE)
    before = session.curves().P[-100:].mean(axis=0)
    session.tune(0, replace(session.racers[0].tuning, forgetting=0.99))
    drift = session.racers[1].tuning.drift
    session.tune(1, replace(session.racers[1].tuning, drift=drift | {"k_T": 100 * drift["k_T"]}))
    session.advance(20 * RATE)
    # P follows the excitation, the faster it forgets the more: means over one period, still rough
    ratio = session.curves().P[-100:].mean(axis=0) / before
    np.testing.assert_allclose(ratio[0], 2.0, rtol=0.3)
    assert ratio[1, 0] == pytest.approx(10, rel=0.4)
    assert ratio[1, 1] == pytest.approx(1, rel=0.3)


def test_without_regularisation_a_pause_winds_up():
    session = DemoSession(estimators=("rpem-forgetting", "rpem-forgetting[regularization=0.01]"))
    session.advance(5 * RATE)
    session.axis.excitation = "off"
    session.advance(15 * RATE)
    plain, regularised = session.racers
    assert plain.P.max() > 500 * 2.97e-4  # up to its ceiling, a deviation of 3 %
    assert np.all(np.diag(regularised.P) <= 2.97e-4 / 0.01 * (1 + 1e-9))


def test_estimators_can_be_changed_while_it_runs():
    session = DemoSession()
    session.advance(8 * RATE)
    session.inject("f_m", 2.0)
    session.choose(1, "ekf")
    assert session.racers[1].text == "ekf" and not session.racers[1].knobs
    session.advance(30 * RATE)  # its walk is relative, and slow for a friction that doubles
    np.testing.assert_allclose(session.racers[1].theta, [1.0, 1.25, 0.1], rtol=0.05)
    assert np.isnan(session.racers[1].P).all() and (session.racers[1].deviation > 0).all()
    with pytest.raises(EstimatorError, match="Did you mean"):
        session.choose(1, "ekff")
    assert session.racers[1].text == "ekf"


def test_an_estimator_of_ones_own_races(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "class Still:\n"
        "    names, output = ('k_T', '1/J_a', 'f_m'), 'speed'\n"
        "    def __init__(self, nominal, period):\n"
        "        self.theta = [nominal['k_T'], 1 / nominal['J_a'], nominal['f_m']]\n"
        "    def step(self, u, y):\n"
        "        return self.theta\n"
        "class Other(Still):\n"
        "    names = ('f_m',)\n"
    )
    session = DemoSession(estimators=(f"{path}:Still", "ekf"))
    session.advance(50)
    assert np.isnan(session.curves().deviation[-1, 0]).all()
    np.testing.assert_array_equal(session.racers[0].theta, [1.0, 1.25, 0.05])
    with pytest.raises(FlexaxisError, match="the demo races k_T, 1/J_a, f_m"):
        Racer(f"{path}:Other", preset("n1"))
    with pytest.raises(FlexaxisError, match="give two"):
        DemoSession(estimators=("ekf",))
