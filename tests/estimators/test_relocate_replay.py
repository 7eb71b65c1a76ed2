"""A filter given another past: batch least squares, and the recursion written out."""

import numpy as np
import pytest

from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.predictor import predict
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.relocate.explain import SPREAD, Explanation, Ranking
from flexaxis.estimators.relocate.filter import Relocate
from flexaxis.estimators.relocate.fit import Change
from flexaxis.estimators.relocate.opened import Opened
from flexaxis.estimators.relocate.past import Normal, past_of
from flexaxis.estimators.relocate.replay import replay
from flexaxis.estimators.relocate.rows import Stretch
from flexaxis.estimators.relocate.work import finished
from flexaxis.estimators.sampling.extended import sampled_system
from flexaxis.estimators.sampling.plan import plan
from flexaxis.estimators.sampling.sampled import terms

T = 0.005
NAMES = ("k_T", "1/J_a", "f_m")
ALL = (*NAMES, "k_g")
P0 = known_P(NAMES, forgetting=0.995)
ONSET, LAST, VARIANCE, FORGETTING = 500, 620, 0.012, 0.995
BOX = np.zeros(3), np.full(3, 1e9)


def test_replay_is_least_squares(nominal, loop):
    model = three_mass(nominal).parametrize(NAMES)
    order, substeps = plan(model, 0.4 * model.theta, 2.5 * model.theta, T)
    N, theta = 400, 1.02 * model.theta
    y_hat, psi = predict(model, theta, loop.u[: N + 2], period=T)
    spread = (0.1 * theta) ** 2
    start = np.zeros((4, 6)), np.diag(spread), np.diag(spread)
    signals = np.c_[loop.u, 0 * loop.u][: N + 1], loop.y[1 : N + 1], np.ones(N, bool)
    found = replay(
        terms(model, order, substeps, T), theta, *start, signals, forgetting=1.0, box=BOX
    )
    R = np.diag(1 / spread) + psi[1 : N + 1].T @ psi[1 : N + 1]
    delta = np.linalg.solve(R, psi[1 : N + 1].T @ (loop.y[1 : N + 1] - y_hat[1 : N + 1]))
    np.testing.assert_allclose(found.theta[-1] - theta, delta, rtol=1e-6)
    np.testing.assert_allclose(found.P[-1], np.linalg.inv(R), rtol=1e-6)
    # nothing is forgotten, so the covariance is what P says
    np.testing.assert_allclose(found.claim[-1], found.P[-1], rtol=1e-6)
    assert found.X[-1, 0, 5] == pytest.approx(y_hat[N + 1] + psi[N + 1] @ delta, rel=1e-9)


@pytest.fixture(scope="module")
def filtered(nominal, simulated):
    """A filter with f_m +50 % since ONSET, which has been kept from seeing it."""
    run = simulated(5.0, seed=7, faults={ONSET * T: dict(nominal) | {"f_m": 0.075}})
    filter_ = Relocate(three_mass(nominal), suspects=["k_g"], P0=P0, period=T, alarm=1e9)
    filter_.run(run.u[: LAST + 1], run.y[: LAST + 1])
    return filter_, run


def opened(filter_, active, free=()):
    """Return the case of a change of some parameters at ONSET, found out at LAST."""
    memory, first = filter_._judge.memory, ONSET - 60
    before = memory.stretch(first)
    rows = before.rows.copy()
    for i in free:  # as if it had been estimated at the time
        rows["P"][:, i, :3] = rows["P"][:, :3, i] = 1e-3 * np.sqrt(rows["P"][:, i, i])[:, None]
        rows["P"][:, i, i] = 1e-2
        rows["claim"] = rows["P"]
    before = Stretch(first, rows[: ONSET + 40 - first])
    theta = rows["theta"][ONSET - first].copy()
    theta[active] *= 1.4
    ranking = Ranking(
        (Explanation(np.array(active), 0.0, Change(ONSET - first, theta, 0.0, 1.0)),), 1
    )
    normal = Normal(VARIANCE, np.r_[0.0, 0.0, 0.0, 0.0, 1.0])
    return Opened(LAST, before, normal, 1.0, 0.0, ONSET, ranking, 0), theta


def batch(filter_, run, case, theta, nominal):
    """Weighted least squares from the onset on, and what the textbook recursion makes of it."""
    row, active = case.before.at(ONSET), case.active
    scale = filter_._design.scale
    model = three_mass(nominal).parametrize(ALL).relative(scale)
    Phi, Gamma, H = sampled_system(model, theta, T)
    p, n = len(theta), model.n
    X = np.r_[row["X"][:n, 1 : 1 + p].T.ravel(), row["X"][:n, 0]].reshape(1 + p, n)
    X[active] = 0.0
    P, claim = row["P"].copy(), row["claim"].copy()
    for M in (P, claim):
        M[3] = M[:, 3] = 0.0
        for i in active:
            M[i] = M[:, i] = 0.0
            M[i, i] = (SPREAD * row["theta"][i]) ** 2 / VARIANCE
    moving = np.flatnonzero(np.diag(P))
    prior = np.linalg.inv(P[np.ix_(moving, moving)])
    X, psi, epsilon = X.ravel(), [], []
    for k in range(ONSET, LAST + 1):
        X = Phi @ X + Gamma * run.u[k]
        output = H @ X
        psi.append(output[:p][moving])
        epsilon.append(run.y[k + 1] - output[p])
    x, ahead = X.reshape(1 + p, n)[p], X.reshape(1 + p, n)[:p]
    psi, epsilon = np.array(psi)[:-1], np.array(epsilon)[:-1]
    N = len(epsilon)
    weights = FORGETTING ** np.arange(N - 1.0, -1.0, -1.0)
    R = FORGETTING**N * prior + (psi.T * weights) @ psi
    delta = np.zeros(p)
    delta[moving] = np.linalg.solve(R, psi.T @ (weights * epsilon))
    after = np.zeros((p, p))
    after[np.ix_(moving, moving)] = np.linalg.inv(R) / FORGETTING  # as from the next time update
    noise, samples, S = row["noise"], row["samples"], claim[np.ix_(moving, moving)]
    P, d = np.linalg.inv(prior), np.zeros(len(moving))
    for now, e in zip(psi, epsilon, strict=True):
        P = P / FORGETTING
        K = P @ now / (1 + now @ P @ now)
        residual, spread = e - now @ d, 1 + now @ S @ now
        d, P = d + K * residual, P - np.outer(K, now @ P)
        F = np.eye(len(d)) - np.outer(K, now)
        S = F @ S @ F.T + np.outer(K, K)
        samples = min(samples + 1, 400)
        noise += (residual**2 / spread - noise) / samples
    return delta, after, x + ahead.T @ delta, noise, S, moving


@pytest.mark.parametrize("active", [[2], [3], [0, 1, 2]], ids=["f_m", "k_g", "all"])
def test_after_a_rewind_the_filter_is_batch_least_squares_since_the_onset(
    nominal, filtered, active
):
    filter_, run = filtered[0].copy(), filtered[1]
    case, theta = opened(filter_, active)
    past = past_of(case.before, filter_._judge.memory, case.normal)
    delta, P, x, noise, S, moving = batch(filter_, run, case, theta, nominal)
    finished(filter_._judge.rewind.to_change(filter_._judge.memory, case, past, theta, free=set()))
    state = filter_._judge.memory.state
    assert np.any(delta[active] != 0)
    np.testing.assert_allclose(state["theta"], theta + delta, rtol=1e-7)
    np.testing.assert_allclose(state["P"], P, rtol=1e-6, atol=1e-9 * abs(P).max())
    np.testing.assert_allclose(state["X"][:5, 0], x, rtol=1e-7, atol=1e-9)
    assert state["noise"] == pytest.approx(noise, rel=1e-6)
    np.testing.assert_allclose(
        state["claim"][np.ix_(moving, moving)], S, rtol=1e-5, atol=1e-9 * abs(S).max()
    )


def test_what_is_remembered_is_what_the_refitted_filter_would_have_known(nominal, filtered):
    """The next sample continues the rewritten past without a seam."""
    filter_, run = filtered[0].copy(), filtered[1]
    case, theta = opened(filter_, [2])
    past = past_of(case.before, filter_._judge.memory, case.normal)
    before = filter_._judge.memory.stretch(ONSET - 20).rows[:21].copy()
    finished(filter_._judge.rewind.to_change(filter_._judge.memory, case, past, theta, free=set()))
    rows = filter_._judge.memory.stretch(ONSET - 20).rows
    np.testing.assert_array_equal(rows["theta"][:21], before["theta"])
    last, state = rows[-1], filter_._judge.memory.state
    np.testing.assert_allclose(last["theta"], state["theta"], rtol=1e-12)
    np.testing.assert_allclose(last["P"] / FORGETTING, state["P"], rtol=1e-9)
    for name in ("noise", "samples", "colour", "correlations", "heard", "lags", "white"):
        np.testing.assert_array_equal(last[name], state[name])
    recent = rows["epsilon"][-60:]
    assert np.std(recent) < 0.15 < np.std(filtered[0]._judge.memory.read("epsilon", LAST - 60))
    y_hat = state["X"][5, 0]
    filter_.step(run.u[LAST + 1], run.y[LAST + 1])
    assert filter_.prediction == y_hat


@pytest.mark.parametrize(("free", "variance"), [((), 0.0), ((3,), 1.0)])
def test_a_retired_suspect_stays_fixed_by_a_rewind_behind_its_freezing(filtered, free, variance):
    filter_ = filtered[0].copy()
    case, theta = opened(filter_, [2], free=(3,))
    past = past_of(case.before, filter_._judge.memory, case.normal)
    finished(
        filter_._judge.rewind.to_change(filter_._judge.memory, case, past, theta, free=set(free))
    )
    P = filter_._judge.memory.state["P"]
    assert (P[3, 3] > 0) == (variance > 0)
    assert np.any(P[3, :3] != 0) == (variance > 0)
