"""Off-line identification: right, as uncertain as it says, and honest about what went wrong."""

import numpy as np
import pytest
from acceptance.differences import central

from flexaxis.estimators import three_mass
from flexaxis.estimators.offline.output_error import output_error
from flexaxis.estimators.offline.predictor import predict

NAMES = ("k_T", "1/J_a", "f_m")
THETA = np.array([1.0, 1.25, 0.05])


def identified(nominal, loop, start=1.2, **options):
    return output_error(
        three_mass(nominal),
        loop.u,
        loop.y,
        identify=NAMES,
        start=start * THETA,
        period=0.005,
        **options,
    )


@pytest.mark.parametrize("start", [1.2, 1.5])
def test_finds_the_parameters_within_its_own_deviations(nominal, loop, start):
    result = identified(nominal, loop, start)
    assert not result.warnings
    assert np.all(np.abs(result.theta - THETA) < 4 * result.standard_deviations)
    np.testing.assert_allclose(result.theta, THETA, rtol=0.003)


def test_covariance_is_that_of_linear_regression(nominal, loop):
    """σ² (ΨᵀΨ)⁻¹ with the gradient by central differences, a variance by eye of the data."""
    result = identified(nominal, loop)
    model = three_mass(nominal).parametrize(NAMES)
    psi = central(
        lambda theta: predict(model, theta, loop.u, period=0.005)[0], result.theta, 1e-5
    ).T
    np.testing.assert_allclose(result.covariance, 0.01 * np.linalg.inv(psi.T @ psi), rtol=0.05)


def test_deviations_are_those_of_repeated_experiments(nominal, simulated):
    errors = []
    for seed in range(12):
        result = identified(nominal, simulated(10.0, seed=seed), 1.1)
        errors.append((result.theta - THETA) / result.standard_deviations)
    # 36 normalised errors: their rms is 1 with a standard deviation of 0.12
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.4


def test_says_so_in_a_local_minimum(nominal, loop):
    result = identified(nominal, loop, 0.7, max_evaluations=30)
    assert "local minimum" in " ".join(result.warnings)
    early = identified(nominal, loop, max_evaluations=1).warnings
    assert "did not converge in 1 " in early[0]


def test_names_the_scale_that_the_data_leave_open(nominal, loop):
    free = [name for name in three_mass(nominal).parameters if name != "r"]
    start = three_mass(nominal).parametrize(free).theta
    result = output_error(
        three_mass(nominal), loop.u, loop.y, identify=free, start=start, period=0.005
    )
    assert result.condition > 1e10
    # the same relative change of all of them
    assert all(f"{name} +1.0 %" in result.warnings[-1] for name in free)
