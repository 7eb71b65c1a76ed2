"""One change in a sequence of estimates: found, placed and sized, and not invented."""

import numpy as np
import pytest

from flexaxis.experiments.logs.changes import changes_along, explain

N = 60
K = np.arange(float(N))


def explained(value, covariates=(), *, false_alarms=0.01):
    beside = np.reshape(covariates, (len(value), -1))
    return explain(value, np.full(len(value), 0.003), beside, false_alarms=false_alarms)


@pytest.mark.parametrize(
    ("shape", "kind", "ends"),
    [
        (0.1 * (K >= 40), "step", (0, 40)),
        (0.12 * np.maximum(K - 30, 0) / 29, "drift", (15, 59)),
        (0.12 * K / (N - 1), "drift", (0, 59)),
        (0.12 * (1 - np.exp(-K / 15)), "drift", (0, 59)),
        (0.06 * np.sin(2 * np.pi * K / N), "drift", (15, 45)),
        (0.1 * np.sin(np.pi * K / 40), "drift", (20, 59)),
    ],
    ids=["step", "from the middle", "ramp", "exponential", "sine", "half a sine"],
)
def test_a_change_has_its_kind_its_place_and_its_size(shape, kind, ends):
    value = 1 + shape + 0.005 * np.random.default_rng(1).standard_normal(N)
    one = explained(value)
    assert one.kind == kind
    np.testing.assert_allclose((one.begin, one.end), ends, atol=1 if kind == "step" else 6)
    assert abs(one.size) == pytest.approx(np.ptp(shape), rel=0.2)


def test_false_alarms_are_as_rare_as_stated():
    """200 sequences at 5 %: 10, and 21 with a chance below 1 in 1000 (binomial)."""
    rng, alarms = np.random.default_rng(6), 0
    for _ in range(200):
        temperature = np.cumsum(rng.standard_normal(40))
        value = 0.01 * rng.standard_normal(40) + 0.001 * temperature
        one = explained(value, temperature, false_alarms=0.05)
        alarms += one.kind != "constant"
    assert alarms <= 21


def test_a_covariate_explains_what_looks_like_a_change():
    rng = np.random.default_rng(2)
    temperature = 20 + 5 * (K >= 30) + rng.standard_normal(N)
    one = explained(1 - 0.01 * temperature + 0.003 * rng.standard_normal(N), temperature)
    assert one.kind == "constant"
    assert one.slopes[0] == pytest.approx(-0.01, abs=4 * one.slope_deviations[0])


TIME = np.arange(8000.0)
X, Z = np.random.default_rng(1).standard_normal((2, 8000))


def look_of(a, b, noise=0.05):
    """Return what y = x/a + b z shows from other values, as friction acts."""
    y = X / a + b * Z + noise * np.random.default_rng(2).standard_normal(len(X))

    def look(theta):
        return y - X / theta[0] - theta[1] * Z, np.column_stack([-X / theta[0] ** 2, Z])

    return look


def test_a_change_along_a_record_has_its_size_however_large():
    """Seen from a = 1.5, to first order, half is a third."""
    look = look_of(np.where(TIME < 3000, 1.0, 1.5), 1.0)
    (change,), _ = changes_along(look, TIME, np.array([1.5, 1.0]), ("a", "b"))
    assert (change.name, change.kind) == ("a", "step") and abs(change.time - 3000) <= 200
    assert change.relative == pytest.approx(0.5, abs=0.01)


def test_constant_records_have_no_changes():
    """Two hundred parameters at 0.1 %: none, or one."""
    rng, count = np.random.default_rng(3), 0
    for _ in range(100):
        noise, J = rng.standard_normal(4000), rng.standard_normal((4000, 2))
        look = lambda theta, n=noise, J=J: (n, J)  # noqa: E731
        count += len(changes_along(look, TIME[:4000], np.ones(2), "ab")[0])
    assert count <= 2


def test_a_log_that_shows_too_little_is_no_proof_of_constancy():
    few = slice(0, 200)  # windows of five samples
    look = look_of(1.0, 1.0)
    assert changes_along(
        lambda theta: tuple(signal[few] for signal in look(theta)),
        TIME[few], np.array([1.0, 1.0]), ("a", "b"),
    ) == ([], ["a", "b"])  # fmt: skip
