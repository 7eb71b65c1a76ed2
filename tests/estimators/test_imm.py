"""Interacting multiple models against a textbook loop, and after a jump."""

from functools import partial

import numpy as np
from acceptance.textbook import sampled

from flexaxis.estimators import three_mass
from flexaxis.estimators.filters.design import make_design
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
