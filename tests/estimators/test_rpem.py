"""What the method does: the paper's properties, the known traps, and every refusal."""

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError, Frozen, Rpem, three_mass

P0 = [2.97e-4, 5.19e-5, 4.69e-6]
DRIFT = np.diag([5e-8, 50e-8, 500e-8])
THETA = np.array([1.0, 1.25, 0.05])


def test_forgetting_converges_and_has_the_theoretical_P(nominal, loop):
    filter_ = Rpem(three_mass(nominal), theta0=1.2 * THETA, P0=P0, forgetting=0.995, period=0.005)
    trace = filter_.trace(loop.u, loop.y)
    late = trace.theta[-4000:]
    np.testing.assert_allclose(late.mean(axis=0), THETA, rtol=0.005)
    Q = trace.psi[-4000:].T @ trace.psi[-4000:] / 4000
    theory = 0.005 * np.diag(np.linalg.inv(Q))  # (29)
    measured = np.diagonal(trace.P[-4000:], axis1=1, axis2=2).mean(axis=0)
    np.testing.assert_allclose(measured, theory, rtol=0.15)
    assert measured.max() / measured.min() > 20  # Fig. 7


def test_the_claim_is_the_covariance_of_the_recursion(nominal, loop):
    """Σ ← (I − Kψᵀ) Σ (I − Kψᵀ)ᵀ + K Kᵀ from P(0), and R̂ the mean of 2 s of ε²/(1 + ψᵀΣψ)."""
    trace = Rpem(three_mass(nominal), P0=P0, period=0.005).trace(loop.u[:3000], loop.y[:3000])
    P = np.concatenate([[np.diag(P0)], trace.P[:-1]])
    claim, mean, count, expected = np.diag(P0), 1.0, 0, []
    for psi, epsilon, before in zip(trace.psi, trace.epsilon, P, strict=True):
        K = before @ psi / (1 + psi @ before @ psi)
        square = epsilon**2 / (1 + psi @ claim @ psi)
        rest = np.eye(3) - np.outer(K, psi)
        claim = rest @ claim @ rest.T + np.outer(K, K)
        if np.any(psi):  # nothing is excited by the first sample, at rest
            count += 1
            mean += (square - mean) / min(count, 400)
        expected.append(mean * np.diag(claim))
    np.testing.assert_allclose(trace.covariance, expected, rtol=1e-9)


def test_increments_are_modelled_exactly(nominal, loop):
    filter_ = Rpem(three_mass(nominal), P0=P0, theta0=1.2 * THETA, output="increment", period=0.005)
    estimates = filter_.run(loop.u, loop.increment)
    np.testing.assert_allclose(estimates[-1], THETA, rtol=1e-6)


def test_one_sample_of_delay_ruins_the_estimates(nominal, loop):
    late = np.concatenate([[0.0], loop.u[:-1]])
    k_T, _, f_m = (
        Rpem(three_mass(nominal), P0=P0, period=0.005).run(late, loop.y)[-4000:].mean(axis=0)
        / THETA
    )
    assert k_T > 1.5
    assert f_m > 3


def test_regularization_bounds_P_in_a_pause(nominal, simulated):
    run = simulated(30.0, pause=(10.0, 30.0))
    plain = Rpem(three_mass(nominal), P0=P0, period=0.005).trace(run.u, run.y).P
    assert plain[:, 0, 0].max() > 50  # winds up, to its ceiling: a deviation of 100 %
    for mu in (0.01, 0.3):
        P = Rpem(three_mass(nominal), P0=P0, regularization=mu, period=0.005).trace(run.u, run.y).P
        assert np.linalg.eigvalsh(P).max() <= 0.005 / mu * (1 + 1e-9)
    drifting = Rpem(three_mass(nominal), P0=P0, drift=DRIFT, regularization=1.0, period=0.005)
    P = drifting.trace(run.u, run.y).P
    assert np.linalg.eigvalsh(P).max() <= np.sqrt(5e-6) + 5e-6


def test_divergence_is_a_result(nominal, loop):
    filter_ = Rpem(three_mass(nominal), P0=P0, bounds=(0.9 * THETA, 1.1 * THETA), period=0.005)
    estimates = filter_.run(loop.u, -10 * loop.y)
    assert np.all(np.isfinite(estimates))
    assert np.all(estimates >= 0.9 * THETA)
    assert np.all(estimates <= 1.1 * THETA)
    huge = Rpem(three_mass(nominal), P0=P0, period=0.005).run(
        loop.u[:50] * 1e200, loop.y[:50] * 1e200
    )
    assert huge.shape == (50, 3)  # not a number, but no exception


REFUSALS = [
    ({"identify": ("k_T", "fm")}, "no parameter 'fm'.*did you mean 'f_m'"),
    ({"output": "sped"}, "unknown output 'sped': did you mean 'speed'"),
    ({"forgetting": 0.0}, r"forgetting is 0.0, but the factor λ must lie in \(0, 1\]"),
    ({"forgetting": 1.01}, "forgetting is 1.01"),
    ({"forgetting": 0.99, "drift": DRIFT}, "not both"),
    ({"drift": -DRIFT}, "drift must be symmetric positive definite"),
    ({"P0": [1.0, 1.0]}, r"P0 has the shape \(2,\)"),
    ({"P0": [[1, 2, 0], [2, 1, 0], [0, 0, 1]]}, "P0 must be symmetric positive definite"),
    ({"P0": [1.0, np.nan, 1.0]}, "P0 must be symmetric positive definite"),
    ({"theta0": [1.0, 1.0]}, "theta0 is .*; give 3 finite values"),
    ({"theta0": [1.0, 0.0, 1.0]}, "contain zero"),
    ({"bounds": (THETA * 1.1, THETA * 2)}, "do not enclose theta0"),
    ({"bounds": (THETA[:2], THETA * 2)}, "bounds is .*; give 3 finite values"),
    ({"regularization": -1.0}, "regularization is -1.0, but the weight μ must be finite and ≥ 0"),
    ({"period": 0.0}, "period is 0.0"),
    ({"noise": 0.0}, "noise is 0.0"),
    ({"noise": -1.0}, "noise is -1.0"),
    ({"noise": np.nan}, "noise is nan"),
]


@pytest.mark.parametrize(("options", "message"), REFUSALS)
def test_options_that_are_refused(nominal, options, message):
    with pytest.raises(EstimatorError, match=message):
        Rpem(three_mass(nominal), **({"P0": P0, "period": 0.005} | options))


SIGNALS = [
    (([0.0, 1.0], [0.0]), "u has 2 samples and y has 1"),
    (([0.0, 1.0], [0.0, np.nan]), "y is nan at sample 1"),
    (([np.inf, 1.0], [0.0, 0.0]), "u is inf at sample 0"),
    (([[0.0], [1.0]], [0.0, 1.0]), r"u has the shape \(2, 1\)"),
    (([0.0, 1.0], [0.0, 1.0], [True]), "u has 2 samples and valid has 1"),
]


@pytest.mark.parametrize(("signals", "message"), SIGNALS)
def test_signals_that_are_refused(nominal, signals, message):
    model = three_mass(nominal)
    for filter_ in (
        Rpem(model, P0=P0, period=0.005),
        Frozen(model),
    ):
        with pytest.raises(EstimatorError, match=message):
            filter_.run(*signals)
        with pytest.raises(EstimatorError, match="y is nan"):
            filter_.step(0.0, float("nan"))
        with pytest.raises(EstimatorError, match="u is inf"):
            filter_.step(float("inf"), None)
