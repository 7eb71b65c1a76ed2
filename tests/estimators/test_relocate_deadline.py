"""Work after an alarm that is spread over samples: never too much in one, and the same findings."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.finding import OVERTAKEN
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.entry import relocate, relocate_friction
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.past import Normal, past_of
from flexaxis.estimators.relocate.rows import Stretch
from flexaxis.estimators.relocate.work import CALL, finished, operations, seconds
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.scoring.theta import started_nominal
from flexaxis.sim.simulate import simulate

NAMES = ("k_T", "1/J_a", "f_m")
SUSPECTS = ("J_m", "J_g", "k_g", "k_a", "d_g", "d_a", "f_g", "f_a")
T = 0.005
P0 = known_P(NAMES, forgetting=0.995)
ONSET = 600


@pytest.fixture(scope="module")
def make(nominal):
    made = {
        deadline: Relocate(
            three_mass(nominal), suspects=SUSPECTS, P0=P0, period=T, deadline=deadline
        )
        for deadline in (None, 0.2 * T)
    }

    def of(deadline=0.2 * T):
        made[deadline].reset()
        return made[deadline]

    return of


@pytest.fixture(scope="module")
def faulty(nominal, simulated):
    return simulated(5.0, seed=3, faults={ONSET * T: nominal | {"f_m": 1.5 * nominal["f_m"]}})


def stepped(estimator, u, y, each=lambda: None):
    theta = []
    for one, other in zip(u, y, strict=True):
        theta.append(estimator.step(one, other))
        each()
    return np.array(theta)


def busy(estimator, run):
    """Take samples until there is work left over."""
    k = 0
    while estimator._pace.front is None:
        estimator.step(run.u[k], run.y[k])
        k += 1
    return k


def test_no_step_does_more_than_its_budget_and_the_finding_is_the_same(make, faulty):
    at_once, spread, spent = make(None), make(), []
    whole = at_once.run(faulty.u, faulty.y)
    theta = stepped(
        spread, faulty.u, faulty.y, lambda: spent.append(spread._pace.spent / spread._pace._budget)
    )
    assert 0.5 < max(spent) <= 1.0
    (early,), (late,) = at_once.findings, spread.findings
    assert late.parameters == early.parameters == ("f_m",)
    assert late.ratio == pytest.approx(early.ratio, rel=0.01)
    assert early.alarm <= late.alarm <= early.alarm + 30  # three looks, of ten samples each
    # before the alarm nothing differs, and in the end what is told is the same
    np.testing.assert_array_equal(theta[:ONSET], whole[:ONSET])
    np.testing.assert_allclose(theta[-1], whole[-1], rtol=1e-3)


def test_an_alarm_is_said_when_it_is_told(make, faulty):
    spread, alarms = make(), []
    stepped(spread, faulty.u, faulty.y, lambda: alarms.append(spread.alarm))
    assert np.flatnonzero(alarms).tolist() == [spread.findings[0].alarm]


def test_steps_blocks_and_the_whole_agree(make, faulty):
    spread = make()
    whole, found = spread.run(faulty.u, faulty.y), spread.findings
    spread.reset()
    cut = ONSET + 8  # in the middle of the work
    parts = [
        spread.run(faulty.u[:cut], faulty.y[:cut]),
        stepped(spread, faulty.u[cut:], faulty.y[cut:]),
    ]
    np.testing.assert_array_equal(np.vstack(parts), whole)
    assert spread.findings == found


@pytest.mark.parametrize(
    "copied", [lambda e: e.copy(), copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))]
)
def test_a_copy_in_the_midst_of_work_disturbs_nothing_and_goes_on_alike(make, faulty, copied):
    spread = make()
    k = busy(spread, faulty)
    whole = spread.run(faulty.u[k:], faulty.y[k:])
    found = spread.findings
    spread.reset()
    assert busy(spread, faulty) == k
    other = copied(spread)
    for estimator in (spread, other):
        assert estimator.findings == ()
        theta = estimator.run(faulty.u[k:], faulty.y[k:])
        np.testing.assert_array_equal(theta, whole)
        assert estimator.findings == found


def test_a_reset_throws_the_work_away(make, faulty):
    spread = make()
    whole = spread.run(faulty.u, faulty.y)
    spread.reset()
    busy(spread, faulty)
    spread.reset()
    np.testing.assert_array_equal(spread.run(faulty.u, faulty.y), whole)


def test_gaps_and_hostile_samples_in_the_midst_of_work_keep_the_budget(make, faulty):
    spread = make()
    k = busy(spread, faulty)
    rng = np.random.default_rng(0)
    for y in [*[None] * 20, *1e6 * rng.standard_normal(300), *faulty.y[k:]]:
        theta = spread.step(float(rng.standard_normal()), y)
        assert spread._pace.spent <= spread._pace._budget
        assert np.isfinite(theta).all()


def test_what_is_copied_of_a_judgement_is_all_that_is_left_of_it(make, faulty):
    spread = make()
    busy(spread, faulty)
    left = list(copy.deepcopy(spread)._pace._work)
    assert left == list(spread._pace._work) and 0 < max(left) <= spread._pace._budget


def test_a_piece_longer_than_a_sample_is_done_nevertheless(make, faulty):
    spread = make()
    k = busy(spread, faulty)
    spread._pace._next = 3.0 * spread._pace._budget  # as if more than there is ever time for
    spread.step(faulty.u[k], faulty.y[k])
    assert spread._pace.spent > spread._pace._budget
    spread.run(faulty.u[k + 1 :], faulty.y[k + 1 :])
    assert spread._pace.front is None and len(spread.findings) == 1


@pytest.mark.parametrize(
    "most, reasons, adapting",
    [(10_000, {""}, False), (10, {OVERTAKEN}, False), (10, {OVERTAKEN}, True)],
)
def test_of_an_alarm_while_samples_wait_the_last_look_is_taken_unless_too_many_do(
    make, faulty, monkeypatch, *, most, reasons, adapting
):
    spread = make()
    monkeypatch.setattr(spread._pace, "_most", most)
    judge, begin, first, ages = spread._judge, spread._pace._begin, [], []
    # one that adapts looks into what is unexplained once more: not where there is no time
    monkeypatch.setattr(judge, "policy", replace(judge.policy, adapting=adapting))
    look = judge._look

    def slowly():
        begin()
        if not first and spread._judge.memory.count >= ONSET - 50:
            first.append(True)
            spread._pace._work, spread._pace._next = iter([spread._pace._budget] * 300), 1.0
            spread._pace.front = spread._judge.memory.fork()

    def seen(case):
        ages.append(judge.memory.count - 1 - case.alarm)
        return look(case)

    monkeypatch.setattr(spread._pace, "_begin", slowly)
    monkeypatch.setattr(judge, "_look", seen)
    spread._judge.memory.state["stop"] = ONSET - 50
    waiting = []
    stepped(spread, faulty.u, faulty.y, lambda: waiting.append(len(spread._pace._missed)))
    assert max(waiting) >= 250 and waiting[-1] == 0
    assert {finding.reason for finding in spread.findings} == reasons
    assert ages == ([judge.policy.ages[-1]] if "" in reasons else [])


def test_what_is_caught_up_with_in_a_step_fits_into_it(make, faulty, monkeypatch):
    """Counted at the filter that catches up: so much for a call, and for each of its samples."""
    spread = make()
    memory, pace, taken, most = spread._judge.memory, spread._pace, [], []
    run = memory.run

    def counted(u, *rest):
        taken.append(len(u))
        return run(u, *rest)

    monkeypatch.setattr(memory, "run", counted)

    def each():
        most.append(sum(CALL + count * pace._sample for count in taken) / pace._budget)
        taken.clear()

    stepped(spread, faulty.u[:100], faulty.y[:100])
    taken.clear()
    monkeypatch.setattr(pace, "_budget", CALL + 100 * pace._sample)
    pace._work, pace._next = iter([pace._budget] * 300), pace._budget  # so long nothing is taken
    pace.front = memory.fork()
    stepped(spread, faulty.u[100:500], faulty.y[100:500], each)
    assert 0.9 < max(most) <= 1.0 and not pace._missed


def test_a_gap_in_the_midst_of_work_is_one_when_it_is_caught_up_with(make, faulty):
    at_once, spread = make(None), make()
    y, there = faulty.y.copy(), np.ones(len(faulty.y), bool)
    there[ONSET + 6 : ONSET + 26] = False
    y[~there] *= -3.0  # of no meaning, and yet not so absurd that they would be left out unasked
    whole = at_once.run(faulty.u, y, there)
    theta = spread.run(faulty.u, y, there)
    assert [f.parameters for f in spread.findings] == [f.parameters for f in at_once.findings]
    np.testing.assert_allclose(theta[-1], whole[-1], rtol=1e-3)


def test_samples_of_half_a_minute_may_wait(make):
    assert make()._pace._most * T == 30.0


def test_the_shortest_deadline_for_some_work_has_time_for_it():
    for work in (1e4, 1e6):
        assert operations(seconds(work)) == pytest.approx(work)


def test_a_search_whose_start_is_forgotten_ends(make, faulty):
    spread = make()
    spread.run(faulty.u[:900], faulty.y[:900])
    memory, lookout = spread._judge.memory, spread._judge.lookout
    expected = np.ones(len(memory.state["theta"]))
    lookout._begin(memory, expected)
    lookout._first = memory.first - 1
    assert lookout.searching
    assert finished(lookout.look(memory, expected)) is None
    assert not lookout.searching


def test_pieces_are_bit_for_bit_the_whole(make, faulty):
    whole = make(None)
    whole.run(faulty.u[: ONSET + 4], faulty.y[: ONSET + 4])
    memory, rank = whole._judge.memory, whole._judge.hypotheses.ranking
    known, normal = memory.stretch(ONSET - 100), Normal(0.01, np.r_[0.1, 0.0, 0.0, 0.0, 0.99])
    past = past_of(Stretch(known.first, known.rows[:100]), memory, normal)
    first, *others = [finished(rank(past, 0.01, None, grain=g)) for g in (np.inf, 1e9, 1e5, 1.0)]
    for other in others:
        for a, b in zip(first.explanations, other.explanations, strict=True):
            assert a.odds == b.odds and (a.change is None) == (b.change is None)
            if a.change is not None and b.change is not None:
                assert a.change[:1] + a.change[2:] == b.change[:1] + b.change[2:]
                np.testing.assert_array_equal(a.change.theta, b.change.theta)


@pytest.mark.parametrize("deadline", [0.0, -1.0, np.nan, 1e-6])
def test_a_deadline_too_short_for_any_work_is_refused(nominal, deadline):
    with pytest.raises(EstimatorError, match="deadline"):
        Relocate(three_mass(nominal), P0=P0, period=T, deadline=deadline)


@pytest.mark.slow
@pytest.mark.parametrize(
    "scenario",
    ["fm_step-v1", "ja_step-v1", "kt_step-v1", "fm_double-v1", "coulomb_fm_step-v1"],
)
@pytest.mark.parametrize("factory", [relocate, relocate_friction])
def test_on_scenarios_no_step_does_more_than_its_budget(scenario, factory):
    record = simulate(find_scenario(scenario), [0])[0]
    nominal = dict(started_nominal(find_scenario(scenario)))
    more = {"torque": record.torque} if factory is relocate else {}
    spread = factory(nominal, T, deadline=0.2 * T, **more)
    for u, y in zip(record.torque, record.speed, strict=True):
        spread.step(u, y)
        assert spread._pace.spent <= spread._pace._budget
    assert factory is not relocate or "coulomb" in scenario or spread.findings
