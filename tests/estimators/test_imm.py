"""Interacting multiple models against a textbook loop, and after a jump."""

from functools import partial

import numpy as np
import pytest
from acceptance.textbook import sampled

from flexaxis.estimators import EstimatorError, three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.ekf import joint_ekf
from flexaxis.estimators.methods.imm import joint_imm

TRUTH = np.array([1.0, 1.25, 0.05])
T, SIGMA = 0.005, 0.1
OPTIONS = {
    "P0": (0.05 * TRUTH) ** 2,
    "drift": (1e-4 * TRUTH) ** 2,
    "jump": (0.02 * TRUTH) ** 2,
    "rate": 2.0,
    "hold": 0.1,
    "period": T,
    "noise": SIGMA,
}


def imm_of(nominal, **options):
    modes = {name: options.pop(name) for name in ("jump", "rate", "hold")}
    return joint_imm(make_design(three_mass(nominal), **options), **modes)


def kalman(nominal, xi, P, y, u, W):  # noqa: PLR0917
    """One sample of a joint EKF by central differences: ξ, P after y, after u, and log Λ."""

    step = partial(sampled, nominal, u=u)
    S = P[5, 5] + SIGMA**2
    gain = P[:, 5] / S
    logarithm = -0.5 * (np.log(2 * np.pi * S) + (y - xi[5]) ** 2 / S)
    xi, P = xi + gain * (y - xi[5]), P - S * np.outer(gain, gain)

    def predicted(xi, P):
        size = np.diag(np.r_[abs(xi[:3]), np.ones(5)] * 1e-5)
        F = np.column_stack([(step(xi + d) - step(xi - d)) / (2 * d.max()) for d in size])
        return step(xi), F @ P @ F.T + np.diag(np.r_[W, np.zeros(5)])

    return xi, P, logarithm, predicted


def textbook(nominal, loop, N):
    """θ (N, 3), covariance (3, 3) and probabilities (4,) at the last sample."""
    walks = [OPTIONS["drift"] + OPTIONS["jump"] * (np.arange(3) == i - 1) for i in range(4)]
    stay, quiet = 1 - T / OPTIONS["hold"], 1 - OPTIONS["rate"] * T
    chain = np.diag([quiet, stay, stay, stay])
    chain[0, 1:], chain[1:, 0] = (1 - quiet) / 3, 1 - stay
    modes = []
    for W in walks:
        P = np.zeros((8, 8))
        P[:3, :3] = np.diag(OPTIONS["P0"] + W)
        modes.append((np.r_[TRUTH, np.zeros(5)], P))
    expected, theta = np.array([1.0, 0, 0, 0]), np.empty((N, 3))
    for k in range(N):
        now = [
            kalman(nominal, xi, P, loop.y[k], loop.u[k], W)
            for (xi, P), W in zip(modes, walks, strict=True)
        ]
        mu = expected * np.exp([logarithm for *_, logarithm, _ in now])
        mu /= mu.sum()
        xi, P = np.array([xi for xi, *_ in now]), np.array([P for _, P, *_ in now])
        theta[k] = mu @ xi[:, :3]
        apart = xi[:, :3] - theta[k]
        claimed = sum(
            m * (C[:3, :3] + np.outer(d, d)) for m, C, d in zip(mu, P, apart, strict=True)
        )
        expected = mu @ chain
        modes = []
        for j in range(4):
            weight = chain[:, j] * mu / expected[j]
            mixed = weight @ xi
            spread = sum(w * (C + np.outer(x - mixed, x - mixed))
                         for w, C, x in zip(weight, P, xi, strict=True))  # fmt: skip
            modes.append(now[j][3](mixed, spread))
    return theta, claimed, mu


def test_against_the_textbook(nominal, simulated):
    loop = simulated(0.5, seed=1, faults={0.2: nominal | {"f_m": 0.2}})
    N = 80
    theta, claimed, mu = textbook(nominal, loop, N)
    ours = imm_of(nominal, **OPTIONS)
    # central differences of step 1e-5 are good to some 1e-9
    np.testing.assert_allclose(ours.run(loop.u[:N], loop.y[:N]), theta, rtol=1e-6)
    np.testing.assert_allclose(ours.state["probability"], mu, rtol=1e-5, atol=1e-9)
    # ours has mixed already, which keeps mean and covariance of the mixture
    np.testing.assert_allclose(ours.theta, theta[-1], rtol=1e-6)
    np.testing.assert_allclose(ours.covariance, claimed, rtol=1e-5, atol=1e-12)
    assert mu[0] < 0.9  # the jump was noticed, so that mixing mattered


def test_modes_that_are_the_same_are_one_filter(nominal, loop):
    options = OPTIONS | {"jump": 1e-30 * TRUTH}
    mixed = imm_of(nominal, **options).run(loop.u[:2000], loop.y[:2000])
    same = {name: options[name] for name in ("P0", "drift", "period", "noise")}
    single = joint_ekf(make_design(three_mass(nominal), **same))
    np.testing.assert_allclose(mixed, single.run(loop.u[:2000], loop.y[:2000]), rtol=1e-9)


def test_a_jump_is_followed_and_named(nominal, simulated):
    loop = simulated(14.0, seed=2, faults={8.0: nominal | {"f_m": 0.075}})
    options = OPTIONS | {"drift": T * (0.002 * TRUTH) ** 2, "rate": 1e-3}
    imm = imm_of(nominal, **options)
    same = {name: options[name] for name in ("P0", "drift", "period", "noise")}
    single = joint_ekf(make_design(three_mass(nominal), **same))
    before = imm.run(loop.u[:1600], loop.y[:1600])
    assert imm.state["probability"][0] > 0.9
    seen, after = np.zeros(4), []
    for u, y in zip(loop.u[1600:1700], loop.y[1600:1700], strict=True):
        after.append(imm.step(u, y))
        seen = np.maximum(seen, imm.state["probability"])
    assert seen[3] > 0.5
    lag = abs(np.array(after)[:, 2] - 0.075).sum()
    alone = single.run(loop.u, loop.y)
    assert lag < 0.5 * abs(alone[1600:1700, 2] - 0.075).sum()
    assert before[1000:, 2].std() < 1.3 * alone[1000:1600, 2].std()


def test_the_mixture_claims_the_spread_of_its_modes(nominal, simulated):
    """ŷ and S of the mixture, by the records of its modes before the sample."""
    loop = simulated(2.0, seed=1, faults={0.2: nominal | {"f_m": 0.2}})
    imm, apart = imm_of(nominal, **OPTIONS), 0.0
    for k in range(100):
        weights, y = imm.state["predicted"].copy(), imm.state["X"][:, -1, 0].copy()
        h, P = imm.state["X"][:, -1, 1:9].copy(), imm.state["P"].copy()
        imm.step(loop.u[k], loop.y[k])
        mean = weights @ y
        S = SIGMA**2 + weights @ (np.einsum("ja,jab,jb->j", h, P, h) + (y - mean) ** 2)
        np.testing.assert_allclose(imm.prediction, mean, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(imm.innovation_variance, S, rtol=1e-9)
        apart = max(apart, weights @ (y - mean) ** 2 / S)
    assert apart > 1e-4  # so that it mattered


def test_a_gap_keeps_the_estimate_and_forgets_the_mode(nominal, loop):
    imm = imm_of(nominal, **OPTIONS)
    imm.run(loop.u[:1000], loop.y[:1000])
    theta, spread = imm.theta, imm.covariance.diagonal()
    for u in loop.u[1000:1100]:
        imm.step(u, None)
    np.testing.assert_allclose(imm.theta, theta, rtol=1e-9)
    assert (imm.covariance.diagonal() > spread).all()
    # of rate 2/s and hold 0.1 s: a sixth of the time in jumps, a third of that each
    np.testing.assert_allclose(imm.state["probability"], [5 / 6, *[1 / 18] * 3], rtol=0.02)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rate": 0.0}, "rate is 0.0"),
        ({"hold": 0.001}, "hold 0.001"),
        ({"jump": [1.0]}, "jump is"),
    ],
)
def test_wrong_options(nominal, options, words):
    with pytest.raises(EstimatorError, match=words):
        imm_of(nominal, **(OPTIONS | options))
