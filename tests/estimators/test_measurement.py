"""One measurement: projection, clipping, the level of noise, and the ceiling on P."""

import numpy as np
import pytest
from acceptance.axes import AXES, NAMES, simulate
from acceptance.disturbances import drive_off

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


def test_a_state_that_is_given_is_where_it_starts(minute):
    """In mid-motion, at the truth: what is predicted is what a filter from rest predicts."""
    sure = {"P0": [1e-20] * 3}
    from_rest = rpem(**sure)
    from_rest.run(minute.u[:1000], minute.y[:1000])
    x = from_rest.state["X"][:5, 0].copy()
    late = rpem(x0=x, **sure)
    given = minute.u[1000:1400], minute.y[1000:1400]
    late.run(*given), from_rest.run(*given)
    expected = from_rest.innovations[:, 0]
    np.testing.assert_allclose(late.innovations[:, 0], expected, rtol=0, atol=1e-9)
    assert np.std(late.innovations[:, 0]) == pytest.approx(0.1, rel=0.1)


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


@pytest.mark.parametrize("clip", [1.0, 1.345, 2.0, 3.0])
def test_clipping_leaves_the_level_of_noise_as_it_is(minute, clip):
    estimator = rpem(robust=clip)
    levels = []
    for start in range(0, len(minute.u), 400):
        part = slice(start, start + 400)
        estimator.run(minute.u[part], minute.y[part])
        levels.append(estimator.noise_variance)
    # 11600 samples, and at a clip of one a third of what they tell
    assert np.mean(levels[1:]) == pytest.approx(0.01, rel=0.07)


def test_the_level_of_noise_is_kept_at_rest():
    """The drive is off for 20 s; a second later nothing moves, and the sensor reads zero."""
    given = drive_off(N1, 20.0)
    first, stop = given.rest
    estimator = rpem()
    levels = []
    for part in (slice(0, first), slice(first, stop)):
        estimator.run(given.run.u[part], given.run.y[part])
        levels.append(estimator.noise_variance)
    # it still learns while the model comes to rest, a memory long; e⁻¹⁰ if it went on
    assert 0.2 * levels[0] < levels[1] < 1.5 * levels[0]


def test_the_ceiling_does_nothing_until_it_is_reached(minute):
    """To the last bit, though P grows twentyfold in a gap of three seconds."""
    k = np.arange(5000)
    given = minute.u[k], minute.y[k], (k < 4000) | (k >= 4600)
    ours, free = rpem(), rpem(ceiling=np.inf)
    np.testing.assert_array_equal(ours.run(*given), free.run(*given))
    ours.reset()
    ours.run(*(signal[:4600] for signal in given))
    assert (np.diag(ours.P) > 10 * P0).all()


def test_at_rest_no_parameter_is_more_uncertain_than_by_its_size(minute):
    estimator = rpem()
    estimator.run(minute.u[:4000], minute.y[:4000])
    estimator.run(np.zeros(20_000), np.zeros(20_000))
    theta0 = three_mass(N1).parametrize(NAMES).theta
    claimed = estimator.noise_variance * np.diag(estimator.P) / theta0**2
    np.testing.assert_allclose(claimed, 1.0, rtol=1e-9)
    free = rpem(ceiling=np.inf)
    free.run(minute.u[:4000], minute.y[:4000])
    free.run(np.zeros(3_000), np.zeros(3_000))
    assert (free.noise_variance * np.diag(free.P) / theta0**2).max() > 1.0


def test_a_ceiling_scales_rows_and_columns(minute):
    """P stays a covariance: its correlations are those of before."""
    estimator, theta0 = rpem(), three_mass(N1).parametrize(NAMES).theta
    estimator.run(minute.u[:4000], minute.y[:4000])
    A = np.array([[2.0, 0.3, 0.0], [0.0, 0.4, 0.1], [0.2, 0.0, 3.0]]) * 20
    estimator.P = A @ A.T * np.outer(theta0, theta0)
    expected = correlations(A @ A.T)
    estimator.step(0.0, None)
    np.testing.assert_allclose(correlations(estimator.P), expected, rtol=1e-9)


def correlations(P):
    d = np.sqrt(np.diag(P))
    return P / np.outer(d, d)
