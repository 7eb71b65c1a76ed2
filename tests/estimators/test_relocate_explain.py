"""The hypotheses ranked on a past made by hand."""

from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import norm

from flexaxis.estimators import three_mass
from flexaxis.estimators.relocate.explain import (
    Explanation,
    Hypotheses,
    Ranking,
)
from flexaxis.estimators.relocate.fit import Change, Past
from flexaxis.estimators.relocate.past import Normal, likelihood, outliers, whitened
from flexaxis.estimators.sampling.plan import plan
from flexaxis.estimators.sampling.sampled import sample, terms

T, SIGMA = 0.005, 0.1
NAMES, SUSPECTS = ("k_T", "1/J_a", "f_m"), ("k_g", "J_m")
WHITE = Normal(SIGMA**2, np.r_[0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def hypotheses(nominal):
    wide = three_mass(nominal).parametrize([*NAMES, *SUSPECTS])
    model = wide.relative(wide.theta)
    box = np.full(5, 0.4), np.full(5, 2.5)
    order, substeps = plan(model, *box, T)
    return Hypotheses(
        terms(model, order, substeps, T), box, identified=3, candidates=np.arange(len(box[0]))
    )


@pytest.fixture(scope="module")
def ranked(hypotheses, simulated):
    """Rank all hypotheses on 250 samples, 100 of them before the alarm, of an axis with a fault."""

    def rank(fault, factor, nominal, since=150, length=250):
        changed = dict(nominal) | {fault: factor * nominal[fault]}
        run = simulated(4.0, seed=3, faults={(since + 90) * T: changed})
        D = sample(hypotheses.terms, np.ones(5), np.arange(0))[0]
        x, states = np.zeros(5), []
        for u in run.u[: since + 100]:
            states.append(x)
            x = (D[:5] @ np.r_[x, u])[:5]
        states = np.array(states)[since:]
        epsilon = run.y[since : since + 100] - states[:, 2]
        past = Past(
            theta=np.ones((100, 5)),
            x=states,
            likelihood=-np.cumsum(epsilon**2) / SIGMA**2 / 2,
            u=np.c_[run.u, 0 * run.u][since : since + length],
            y=run.y[since + 1 : since + length + 1],
            present=np.ones(length, bool),
            epsilon=np.r_[np.zeros(4), epsilon],
            colour=np.zeros(4),
            variance=SIGMA**2,
        )
        return partial(hypotheses.rank, past, SIGMA**2)

    return rank


@pytest.mark.parametrize(("fault", "factor", "index"), [("f_m", 1.5, 2), ("k_g", 0.8, 3)])
def test_all_hypotheses_have_their_place(nominal, ranked, fault, factor, index):
    rank = ranked(fault, factor, nominal)
    ranking = rank(None)
    assert len(ranking.explanations) == 6 and ranking.best == index
    odds = np.array([found.odds for found in ranking.explanations])
    assert np.all(np.isfinite(odds))
    assert ranking.lead == odds[index] - np.delete(odds[:5], index).max()
    assert ranking.change.theta[index] == pytest.approx(factor, rel=0.05)
    assert abs(ranking.change.onset - 90) <= 5
    again = rank(ranking)
    assert again.best == index and again.odds >= ranking.odds - 0.02


def test_what_is_not_identified_and_what_is_several_costs_evidence(nominal, ranked):
    """Two nats for each suspect; six for all identified ones at once."""
    rank = ranked("f_m", 1.02, nominal)  # so small that none is far behind
    found = rank(None).explanations
    costs = [e.change.evidence - e.odds for e in found if e.change is not None]
    assert len(costs) == 6
    np.testing.assert_allclose(costs, [0, 0, 0, 2, 2, 6], atol=1e-9)


def test_several_do_not_compete_with_a_lead(nominal):
    """That all identified ones changed is true of each of them: it takes no lead away."""
    change = object()
    one = [Explanation(np.array([i]), odds, change) for i, odds in enumerate((9.0, 1.0, 3.0))]
    several = Explanation(np.arange(3), 8.0, change)
    assert Ranking((*one, several), 3).lead == 6.0
    assert Ranking((*one[1:], several), 2).lead == 5.0


def test_the_likelihood_is_that_of_normal_residuals():
    rng = np.random.default_rng(0)
    scale = 1 + rng.random(50)
    epsilon = 0.1 * np.sqrt(scale) * rng.standard_normal(50)
    known = np.ones(50, bool)
    known[20:25] = False
    white = whitened(np.r_[np.zeros(4), np.where(known, epsilon, 0)], scale, known, WHITE)
    densities = norm(0, SIGMA * np.sqrt(scale)).logpdf(epsilon)
    expected = np.cumsum(np.where(known, densities + np.log(SIGMA * np.sqrt(2 * np.pi)), 0))
    np.testing.assert_allclose(likelihood(white, scale, known), expected, rtol=1e-9)


def test_residuals_are_whitened_by_their_past():
    colour = np.array([0.9, -0.4, 0.1, 0.0, 0.3])
    epsilon = np.random.default_rng(1).standard_normal(30)
    white = whitened(epsilon, np.ones(26), np.ones(26, bool), Normal(2.0, colour))
    expected = [
        epsilon[k] - sum(colour[i] * epsilon[k - 1 - i] for i in range(4)) for k in range(4, 30)
    ]
    np.testing.assert_allclose(white, np.array(expected) / np.sqrt(0.6), rtol=1e-12)


def test_only_a_lone_residual_is_an_outlier():
    epsilon = np.array([0.1, 1e9, -0.1, 0.1, 2.0, 3.0, 4.0, 0.1, np.nan, 1.0, np.nan, 7.0])
    found = outliers(epsilon, 0.1)
    assert np.flatnonzero(found).tolist() == [1, 9, 11]  # the last may still be the first of many


def test_the_matrix_of_a_sample_is_that_of_the_relative_parameters(nominal, hypotheses, by_hand):
    A, B = by_hand(dict(nominal) | {"k_g": 1.1 * nominal["k_g"]})
    exact = expm(np.block([[A[:5, :5], B[:5, None]], [np.zeros((1, 6))]]) * T)[:5]
    theta = np.array([1.0, 1.0, 1.0, 1.1, 1.0])
    D = sample(hypotheses.terms, theta, np.arange(0))
    np.testing.assert_allclose(D[0, :5], exact, rtol=1e-9, atol=1e-12)


def test_of_hypotheses_that_are_all_absurd_one_that_was_fitted_leads():
    """At 1e300 nats what is a nat behind is equal, and may come first."""
    fitted = Change(3, np.ones(2), -1e300, np.inf)
    found = [Explanation(np.array([i]), -1e300, change) for i, change in enumerate([None, fitted])]
    ranking = Ranking(tuple(found), singles=2)
    assert ranking.best == 1
    assert ranking.change is fitted
    assert ranking.lead == 0.0
