"""The moving horizon against a general least-squares solver, and what it is in limiting cases."""

import numpy as np
import pytest
from acceptance.axes import held
from scipy.optimize import least_squares

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.moving_horizon import MovingHorizon
from flexaxis.estimators.offline.priors import known_P

TRUTH = np.array([1.0, 1.25, 0.05])
P0 = known_P(("k_T", "1/J_a", "f_m"), forgetting=0.995)
T = 0.005


def response(by_hand, nominal, theta, x, u, N):  # noqa: PLR0917
    """ŷ at the N samples after the first, and the state at each."""
    A, B = by_hand(nominal | {"k_T": theta[0], "J_a": 1 / theta[1], "f_m": theta[2]})
    step = held(A[:5, :5], B[:5], T)
    states = [x]
    for k in range(N):
        states.append(step @ np.r_[states[-1], u[k]])
    return np.array(states)[1:, 2], np.array(states)


def test_the_first_window_is_the_least_squares_fit(nominal, loop, by_hand):
    N, root = 60, np.sqrt(P0)

    def residuals(z):
        y, _ = response(by_hand, nominal, 1.1 * TRUTH + root * z, np.zeros(5), loop.u, N)
        return np.r_[z, loop.y[1 : N + 1] - y]

    exact = {"jac": "3-point", "xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
    fit = least_squares(residuals, np.zeros(3), **exact)
    design = make_design(three_mass(nominal), theta0=1.1 * TRUTH, P0=P0, period=T)
    ours = MovingHorizon(design, window=N, every=20, iterations=12)
    theta = ours.run(loop.u[: N + 1], loop.y[: N + 1])[-1]
    # the solver's own differences leave some 1e-7
    np.testing.assert_allclose(theta, 1.1 * TRUTH + root * fit.x, rtol=2e-6)
    assert abs(theta / TRUTH - 1.1).max() > 0.02
    # (N+M/2)/(N+M), M = 200, times R̂ P
    curvature = np.linalg.inv(fit.jac.T @ fit.jac) * np.outer(root, root)
    residual = fit.fun[3:]
    moving = abs(loop.y[1 : N + 1] - residual) > 0.5 * residual.std()
    share = 160 / 260 * np.mean(residual[moving] ** 2)
    np.testing.assert_allclose(ours.covariance, share * curvature, rtol=1e-4)


def test_the_next_window_has_the_arrival_cost_of_a_kalman_filter(nominal, loop, by_hand):
    """ξ̄ and P̄ by central differences and full matrices, after 20 samples have left the window."""
    N, every, lam = 60, 20, 0.99
    design = make_design(three_mass(nominal), P0=P0, period=T, forgetting=lam)
    ours = MovingHorizon(design, window=N, every=every, iterations=12)
    fitted = ours.run(loop.u[: N + 1], loop.y[: N + 1])[-1]

    def moved(theta):
        y, states = response(by_hand, nominal, theta, np.zeros(5), loop.u, every)
        return np.r_[y, theta, states[-1]]

    size = np.diag(1e-5 * TRUTH)
    J = np.column_stack([(moved(fitted + d) - moved(fitted - d)) / (2 * d.max()) for d in size])
    phi, F, now = J[:every], J[every:], moved(fitted)
    A = np.diag(1 / P0) + phi.T @ phi
    pull = np.linalg.solve(A, (TRUTH - fitted) / P0 + phi.T @ (loop.y[1 : every + 1] - now[:every]))
    mean, half = now[every:] + F @ pull, F @ np.linalg.cholesky(np.linalg.inv(A)) / lam**10

    def residuals(z):  # ξ = ξ̄ + P̄^½ z: P̄ is singular, as x follows from θ
        xi = mean + half @ z
        y, _ = response(by_hand, nominal, xi[:3], xi[3:], loop.u[every:], N)
        return np.r_[z, loop.y[every + 1 : every + N + 1] - y]

    z = least_squares(residuals, np.zeros(3), xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    part = slice(N + 1, N + every + 1)
    theta = ours.run(loop.u[part], loop.y[part])[-1]
    # central differences of step 1e-5 are good to some 1e-9
    np.testing.assert_allclose(theta, (mean + half @ z)[:3], rtol=1e-6)
    assert abs(theta / fitted - 1).max() > 1e-4


def test_increments_gaps_and_parts(nominal, loop):
    def make():
        options = {"P0": P0, "period": T, "forgetting": 0.995, "output": "increment"}
        return MovingHorizon(make_design(three_mass(nominal), **options), window=50)

    valid = np.arange(3000) % 5 > 0
    valid[1000:1200] = False
    y = np.where(valid, loop.increment[:3000], 1e6)  # a value in a gap must not count
    whole = make().run(loop.u[:3000], y, valid)
    parts = make()
    cut = [parts.run(loop.u[a:b], y[a:b], valid[a:b]) for a, b in ((0, 1), (1, 777), (777, 3000))]
    np.testing.assert_array_equal(np.concatenate(cut), whole)
    np.testing.assert_allclose(whole[-1], TRUTH, rtol=0.02)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"window": 105}, "multiple of every"),
        ({"every": 0}, "every 0"),
        ({"iterations": 0}, "iterations 0"),
        ({"forgetting": 1.5}, "forgetting is 1.5"),
    ],
)
def test_wrong_options(nominal, options, words):
    with pytest.raises(EstimatorError, match=words):
        given = {name: options.pop(name) for name in [*options] if name == "forgetting"}
        MovingHorizon(make_design(three_mass(nominal), P0=P0, period=T, **given), **options)
