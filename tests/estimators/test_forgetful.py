"""Other rules of forgetting against textbook loops, and the control that is told the time."""

from functools import partial

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError, Rpem, three_mass
from flexaxis.estimators.methods.controls import OracleReset
from flexaxis.estimators.models.discretisation import discretize, extended_system
from flexaxis.estimators.offline.priors import known_P
from flexaxis.estimators.registry import REGISTRY

NAMES = ("k_T", "1/J_a", "f_m")
P0 = known_P(NAMES, forgetting=0.995)
LAMBDA = 0.995


def forgetful_rpem(nominal, rule, **options):
    name = next(name for name in REGISTRY if name.startswith(rule))
    given = dict(forgetting=LAMBDA, robust=0.0) | options
    return REGISTRY[name].factory(three_mass(nominal), 0.005, P0=P0, **given)


def textbook(nominal, loop, N, rule):
    """θ (N, 3): matrix exponentials, and ``rule(P, psi, R)`` as the time update of P."""
    model = three_mass(nominal).parametrize(NAMES)
    theta, P = model.theta * [1.05, 1, 1], np.diag(P0)
    X, H = np.zeros(20), extended_system(model, theta)[2]
    found = np.empty((N, 3))
    for k in range(N):
        psi, epsilon = H[:-1] @ X, loop.y[k] - H[-1] @ X
        gain = P @ psi / (1 + psi @ P @ psi)
        theta = theta + gain * epsilon
        P = rule(P - np.outer(gain, psi @ P), psi)
        found[k] = theta
        F, G, H = extended_system(model, theta)
        transition, step = discretize(F, G, 0.005)
        X = transition @ X + step[:, 0] * loop.u[k]
    return found


def vector(P, psi):
    L = np.diag(np.array([0.99, 0.995, 0.998]) ** -0.5)
    return L @ P @ L


def directional(P, psi):
    R = np.linalg.inv(P)
    size = psi @ R @ psi
    if size < 1e-9:
        return P
    v = R @ psi  # eq. (9) in the information form, on the part of R that the data excite
    return np.linalg.inv(R - (1 - LAMBDA) * np.outer(v, v) / size) if psi @ psi > 1e-6 else P


def directional_small(P, psi, unit=(1, 1, 1)):
    along = np.array(unit) * psi  # ψ is a slope, P ψ a step
    if along @ along == 0:
        return P
    size = along @ np.linalg.inv(P) @ along
    return P + (1 / LAMBDA - 1) * np.outer(along, along) / size


def efra(P, psi):
    nu, S = 1 / LAMBDA - 1, 10 * np.diag(P0)
    return P / LAMBDA + 0.1 * nu * (S - P @ np.linalg.inv(S) @ P)


@pytest.mark.parametrize(
    ("rule", "update", "options"),
    [
        ("vector", vector, {"rates": [2.0, 1.0, 0.4]}),
        ("directional", partial(directional_small, unit=P0), {}),
        ("efra", efra, {}),
    ],
)
def test_against_the_textbook(nominal, loop, rule, update, options):
    ours = forgetful_rpem(dict(nominal) | {"k_T": 1.05 * nominal["k_T"]}, rule, **options)
    expected = textbook(nominal, loop, 300, update)
    # the kernel is good to 1e-12 a sample; ψᵀP⁻¹ψ costs some digits
    np.testing.assert_allclose(ours.run(loop.u[:300], loop.y[:300]), expected, rtol=1e-7)


def test_the_directional_update_is_partial_forgetting_of_the_information():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((3, 3))
    P, psi = A @ A.T, rng.standard_normal(3)
    np.testing.assert_allclose(directional(P, psi), directional_small(P, psi), rtol=1e-8)


def test_equal_factors_and_no_alarm_are_the_paper(nominal, loop):
    plain = Rpem(three_mass(nominal), P0=P0, period=0.005).run(loop.u[:2000], loop.y[:2000])
    equal = forgetful_rpem(nominal, "vector", rates=[1, 1, 1])
    np.testing.assert_allclose(equal.run(loop.u[:2000], loop.y[:2000]), plain, rtol=1e-10)
    corrected = Rpem(three_mass(nominal), P0=P0, state_correction=True, period=0.005)
    silent = forgetful_rpem(nominal, "cusum", level=1e9)
    expected = corrected.run(loop.u[:2000], loop.y[:2000])
    np.testing.assert_allclose(silent.run(loop.u[:2000], loop.y[:2000]), expected, rtol=1e-10)


@pytest.mark.parametrize("rule", ["variable", "cusum"])
def test_a_jump_is_followed_faster_and_rest_is_as_quiet(nominal, simulated, rule):
    run = simulated(14.0, seed=2, faults={8.0: nominal | {"f_m": 0.1}})
    plain = Rpem(three_mass(nominal), P0=P0, period=0.005).run(run.u, run.y)[:, 2]
    quick = forgetful_rpem(nominal, rule).run(run.u, run.y)[:, 2]
    lag = [abs(theta[1600:] - 0.1).sum() for theta in (plain, quick)]
    assert lag[1] < 0.6 * lag[0]
    assert quick[1000:1600].std() < 1.2 * plain[1000:1600].std()


def test_directional_forgetting_does_not_wind_up_at_rest(nominal, simulated):
    run = simulated(40.0, pause=(10.0, 30.0))
    plain, ours = Rpem(three_mass(nominal), P0=P0, period=0.005), None
    ours = forgetful_rpem(nominal, "directional")
    for filter_ in (plain, ours):
        filter_.run(run.u[:5900], run.y[:5900])
    assert np.linalg.eigvalsh(plain.P)[-1] > 1.0  # its ceiling: a deviation of 100 %
    assert np.linalg.eigvalsh(ours.state["P"][0])[-1] < 0.02


def test_the_oracle_restarts_where_it_is_told(nominal, simulated):
    run = simulated(10.0, seed=3, faults={6.0: nominal | {"f_m": 0.075}})

    def make(onsets):
        return OracleReset(
            Rpem(three_mass(nominal), P0=P0, state_correction=True, period=0.005), onsets=onsets
        )

    told, untold = make([1200]), make([])
    theta, plain = told.run(run.u, run.y), untold.run(run.u, run.y)
    np.testing.assert_array_equal(theta[:1200], plain[:1200])
    assert abs(theta[1260:, 2] - 0.075).max() < 0.1 * 0.025 < abs(plain[1260, 2] - 0.075)
    told.reset()
    parts = [told.run(run.u[a:b], run.y[a:b]) for a, b in ((0, 1200), (1200, 1201), (1201, 2000))]
    np.testing.assert_array_equal(np.concatenate(parts), theta)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rule": "vector", "rates": [-1, 1, 1]}, "rates are"),
        ({"rule": "cusum", "reset": 0.0}, "reset is 0.0"),
    ],
)
def test_wrong_options(nominal, options, words):
    with pytest.raises(EstimatorError, match=words):
        forgetful_rpem(nominal, **options)
