"""When a change is believed, by hand."""

import numpy as np
import pytest

from flexaxis.estimators.relocate.explain import Explanation, Ranking
from flexaxis.estimators.relocate.fit import Change
from flexaxis.estimators.relocate.policy import (
    TAKEN_BACK,
    Accept,
    Case,
    GiveUp,
    Policy,
    Retract,
    Wait,
    dubious,
)

T = 0.005
POLICY = Policy(T)


def ranking(odds, unexplained=1.0, singles=3):
    change = Change(2, np.ones(3), 0.0, unexplained)
    found = (Explanation(np.array([i]), value, change) for i, value in enumerate(odds))
    return Ranking(tuple(found), singles)


@pytest.mark.parametrize(
    ("dubious", "lead", "gained", "age", "decision"),
    [
        (0.0, 6.0, 20.0, 0, Accept),
        (0.0, 6.0, 10.0, 0, Wait),  # too little evidence
        (0.0, 2.0, 20.0, 5, Wait),  # two hypotheses explain it equally well: wait
        (0.0, 2.0, 20.0, 30, Accept),  # they still do: take either
        (0.5, 6.0, 60.0, 0, Wait),  # half of the residual is no noise: see whether it lasts
        (0.5, 6.0, 20.0, 40, Wait),  # and ask for three times as much
        (0.5, 6.0, 60.0, 40, Accept),
    ],
)
def test_when_a_change_is_believed(dubious, lead, gained, age, decision):
    found = ranking([gained - 5.0, gained - 5.0 - lead, -80.0])
    case = Case(age, 80, -5.0, 1.0, dubious)
    assert isinstance(POLICY.decide(found, case), decision)
    for accepted in (1, TAKEN_BACK):  # another one goes only for one that is clearly better
        case = Case(age, 80, -5.0, 1.0, dubious, accepted)
        assert isinstance(POLICY.decide(found, case), Accept if lead > 4.5 else Wait)
    same = Case(age, 80, 1e9, 1.0, dubious, accepted=0)
    assert isinstance(POLICY.decide(found, same), Accept)  # it is refined


def test_correlated_residuals_ask_for_as_much_more():
    found = ranking([15.0, 9.0, -80.0])
    assert isinstance(POLICY.decide(found, Case(0, 80, 0.0, 1.0, 0.0)), Accept)
    assert isinstance(POLICY.decide(found, Case(0, 80, 0.0, 2.0, 0.0)), Wait)  # lead and evidence
    assert isinstance(POLICY.decide(found, Case(30, 80, 0.0, 2.0, 0.0)), Wait)  # evidence


@pytest.mark.parametrize(("accepted", "decision"), [(None, Wait), (0, Retract), (TAKEN_BACK, Wait)])
def test_what_later_data_do_not_bear_out_is_taken_back(accepted, decision):
    found = ranking([60.0, 0.0, 0.0], unexplained=3.0)
    assert isinstance(POLICY.decide(found, Case(60, 202, 0.0, 1.0, 0.0, accepted)), decision)
    few = Case(60, 12, 0.0, 1.0, 0.0, accepted=0)  # ten samples cannot tell
    assert isinstance(POLICY.decide(found, few), Accept)


@pytest.mark.parametrize(("square", "conclusion"), [(1.0, Wait), (2.1, Wait), (2.4, GiveUp)])
def test_in_the_end_the_recent_residual_is_judged(square, conclusion):
    """1.5 and four deviations of the mean of 60 squares, 4·√(2/60) = .73, make 2.23."""
    white = np.r_[np.full(500, 9.0), np.full(60, np.sqrt(square))]
    assert isinstance(POLICY.conclude(white, 1.0), conclusion)
    assert isinstance(POLICY.conclude(white, 9.0), Wait)


def test_all_times_are_seconds():
    fine = Policy(T / 5)
    assert fine.ages[-1] == 5 * POLICY.ages[-1] == 500
    found = ranking([15.0, 14.0, -80.0])
    assert isinstance(POLICY.decide(found, Case(25, 80, 0.0, 1.0, 0.0)), Accept)
    assert isinstance(fine.decide(found, Case(25, 400, 0.0, 1.0, 0.0)), Wait)
    assert isinstance(fine.decide(found, Case(125, 400, 0.0, 1.0, 0.0)), Accept)


def test_rounding_noise_is_not_dubious():
    """A difference of neighbours can be foretold, but no force that lasts makes it."""
    colour = np.array([-0.8, -0.6, -0.4, -0.2, 0.6])
    assert dubious(colour, -0.5) == 0.0
    assert dubious(colour, 0.5) == pytest.approx(0.4)
