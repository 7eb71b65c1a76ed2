"""Interacting multiple models against a textbook loop, and after a jump."""

from functools import partial

import numpy as np
from acceptance.textbook import measured, predicted, sampled

from flexaxis.estimators import three_mass
from flexaxis.estimators.filters.design import make_design
from flexaxis.estimators.methods.imm import joint_imm

TRUTH = np.array([1.0, 1.25, 0.05])
T, SIGMA = 0.005, 0.1
DESIGN = {"P0": (0.05 * TRUTH) ** 2, "drift": (1e-4 * TRUTH) ** 2, "period": T, "noise": SIGMA}
MODES = {"jump": (0.02 * TRUTH) ** 2, "rate": 2.0, "hold": 0.1}


def textbook(nominal, loop, N):
    """θ (N, 3), covariance (3, 3) and probabilities (4,) at the last sample."""
    walks = [DESIGN["drift"] + MODES["jump"] * (np.arange(3) == i - 1) for i in range(4)]
    stay, quiet = 1 - T / MODES["hold"], 1 - MODES["rate"] * T
    chain = np.diag([quiet, stay, stay, stay])
    chain[0, 1:], chain[1:, 0] = (1 - quiet) / 3, 1 - stay
    start = np.r_[TRUTH, np.zeros(5)]
    modes = [(start, np.diag(np.r_[DESIGN["P0"] + W, np.zeros(5)])) for W in walks]
    expected, theta = np.array([1.0, 0, 0, 0]), np.empty((N, 3))
    for k in range(N):
        now = [measured(xi, P, np.eye(8)[5], loop.y[k], SIGMA) for xi, P in modes]
        xi, P, logarithms = map(np.array, zip(*now, strict=True))
        mu = expected * np.exp(logarithms)
        mu /= mu.sum()
        theta[k] = mu @ xi[:, :3]
        apart = xi[:, :3] - theta[k]
        claimed = sum(
            m * (C[:3, :3] + np.outer(d, d)) for m, C, d in zip(mu, P, apart, strict=True)
        )
        expected = mu @ chain
        step, modes = partial(sampled, nominal, u=loop.u[k]), []
        for j in range(4):
            weight = chain[:, j] * mu / expected[j]
            mixed = weight @ xi
            spread = sum(w * (C + np.outer(x - mixed, x - mixed))
                         for w, C, x in zip(weight, P, xi, strict=True))  # fmt: skip
            modes.append(predicted(step, mixed, spread, walks[j]))
    return theta, claimed, mu


def test_against_the_textbook(nominal, simulated):
    loop = simulated(0.5, seed=1, faults={0.2: nominal | {"f_m": 0.2}})
    N = 80
    theta, claimed, mu = textbook(nominal, loop, N)
    ours = joint_imm(make_design(three_mass(nominal), **DESIGN), **MODES)
    # central differences of step 1e-5 are good to some 1e-9
    np.testing.assert_allclose(ours.run(loop.u[:N], loop.y[:N]), theta, rtol=1e-6)
    np.testing.assert_allclose(ours.state["probability"], mu, rtol=1e-5, atol=1e-9)
    # ours has mixed already, which keeps mean and covariance of the mixture
    np.testing.assert_allclose(ours.theta, theta[-1], rtol=1e-6)
    np.testing.assert_allclose(ours.covariance, claimed, rtol=1e-5, atol=1e-12)
    assert mu[0] < 0.9  # the jump was noticed, so that mixing mattered
