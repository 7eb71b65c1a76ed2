"""One measurement: projection, clipping, the level of noise, and the ceiling on P."""

import numpy as np
import pytest
from acceptance.axes import AXES, NAMES, simulate

from flexaxis.estimators import Rpem, three_mass
from flexaxis.estimators.offline.priors import known_P

P0 = known_P(NAMES, forgetting=0.995)
N1 = AXES["n1"]


@pytest.fixture(scope="module")
def minute():
    """60 s of the nominal axis."""
    return simulate(N1, 60.0)


def rpem(axis=N1, **options):
    given = {"identify": NAMES, "P0": P0, "period": 0.005} | options
    return Rpem(three_mass(axis), **given)


def test_a_corrected_state_goes_no_further_than_its_parameters():
    """k_T is stopped by its box at 1.2; the axis is linear in it, so x = 1.2 x₁ exactly."""
    exact = simulate(N1, 2.0, sigma=0.0)
    wrong = N1 | {"k_T": 1.5}
    stopped = rpem(wrong, identify=["k_T"], P0=[1.0], bounds=([1.2], [2.0]), state_correction=True)
    theta = stopped.run(exact.u, exact.y)
    assert theta[-1] == 1.2
    np.testing.assert_allclose(
        (exact.y - stopped.innovations[:, 0])[10:], 1.2 * exact.y[10:], rtol=1e-9, atol=1e-9
    )


def test_an_innovation_claims_noise_and_what_is_not_known(minute):
    """R̂ + ψᵀ C ψ, with R̂ and the claimed covariance C of the sample before."""
    estimator = rpem()
    estimator.run(minute.u[:400], minute.y[:400])
    estimator.P = np.diag([0.3, 0.1, 0.01])
    known, C = estimator.noise_variance, estimator.covariance
    estimator.step(minute.u[400], minute.y[400])
    expected = known + estimator.psi @ C @ estimator.psi
    assert expected > 2 * known
    assert estimator.innovation_variance == pytest.approx(expected, rel=1e-12)
