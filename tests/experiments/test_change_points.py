"""Steps and ramps in sequences of estimates: found, placed, sized, and not made up."""

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from flexaxis.experiments.logs.trend.change_points import Series, explain, size_of
from flexaxis.experiments.logs.trend.scatter import (
    LOOK,
    Scatter,
    _restricted,
    chance_of,
    ratios,
)
from flexaxis.experiments.logs.trend.wear import CHANGED, EXPLAINED, OPEN, STEADY, verdict

N = 60
DAYS = np.arange(float(N))


def noise(rng, n=N, scatter=0.01, memory=0.0):
    e = np.empty(n)
    e[0] = rng.standard_normal()
    for k in range(1, n):
        e[k] = memory * e[k - 1] + np.sqrt(1 - memory**2) * rng.standard_normal()
    return scatter * e


def series(value, deviation=0.003, covariates=None):
    n = len(value)
    given = np.empty((n, 0)) if covariates is None else np.atleast_2d(covariates.T).T
    return Series(np.arange(float(n)), value, np.full(n, deviation), given)


def ramp(size, begin=30):
    return size * np.maximum(DAYS - begin, 0) / (N - 1 - begin)


def test_a_ramp_is_found_with_its_size_and_place():
    rng = np.random.default_rng(1)
    found = explain(series(ramp(0.12) + noise(rng)))
    (change,) = found.changes
    assert change.shape == "ramp"
    assert change.earliest <= 30 <= change.latest
    assert abs(change.size - 0.12) < 3 * change.deviation
    assert 0.002 < change.deviation < 0.02  # 1 % over 30 logs on each side
    assert 0.006 < found.scatter < 0.015  # of 60 logs, in steps of a third


def test_a_step_is_no_ramp():
    rng = np.random.default_rng(2)
    (change,) = explain(series(0.05 * (DAYS >= 40) + noise(rng))).changes
    assert (change.shape, change.place) == ("step", 40)


def test_the_places_of_a_step_are_those_that_are_nearly_as_good():
    """By sums of squares over the claimed variance: within 3.84, the 95 % point of χ² of one."""
    value = 0.02 * (DAYS >= 30) + 0.01 * np.random.default_rng(4).standard_normal(N)
    found = explain(series(value, deviation=0.01))
    (change,) = found.changes
    assert change.shape == "step" and found.scatter == 0.0

    def rest(k):
        return sum(((part - part.mean()) ** 2).sum() for part in (value[:k], value[k:])) / 0.01**2

    squares = {k: rest(k) for k in range(3, N - 2)}
    best = min(squares.values())
    near = [k for k, square in squares.items() if square - best < 3.84]
    assert (change.earliest, change.latest) == (min(near), max(near))
    assert len(near) > len([k for k, square in squares.items() if square - best < 1.92])


def test_the_size_of_a_step_is_no_surer_than_the_logs_claim():
    """They agree ten times better than that, as by an error that they share."""
    value = 0.05 * (DAYS >= 40) + noise(np.random.default_rng(2), scatter=0.0003)
    found = explain(series(value, deviation=0.003))
    (change,) = found.changes
    assert found.scatter == 0.0
    assert change.deviation == pytest.approx(0.003 * np.sqrt(1 / 40 + 1 / 20))


def test_wear_and_repair_are_two_changes():
    rng = np.random.default_rng(3)
    value = 0.2 * np.maximum(DAYS - 15, 0) / 30 * (DAYS < 45) + noise(rng)
    wear, repair = explain(series(value)).changes[:2]
    assert (wear.shape, repair.shape) == ("ramp", "step")
    assert wear.earliest <= 15 <= wear.latest + 1
    assert repair.place == 45
    assert abs(repair.size + 0.2) < 3 * repair.deviation


def test_one_log_out_of_line_is_no_change():
    rng = np.random.default_rng(4)
    value = noise(rng)
    value[25] += 0.2
    found = explain(series(value))
    assert not found.changes
    assert [c.place for c in found.outliers] == [25]


def test_noise_smaller_than_claimed_shows_nothing():
    """Estimates that are alike by a common error do not make a small change a large one."""
    rng = np.random.default_rng(5)
    value = ramp(0.003) + noise(rng, scatter=0.0003)
    assert not explain(series(value, deviation=0.003)).changes
    assert explain(series(value, deviation=0.0003)).changes


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.3])
def test_false_alarms_are_as_rare_as_said(memory):
    """200 sequences at 5 %: 10, and 19 with a chance of 1 in 300 (binomial)."""
    rng = np.random.default_rng(6)
    alarms = 0
    for _ in range(200):
        temperature = np.cumsum(rng.standard_normal(40))
        value = noise(rng, 40, 0.01, memory) + 0.001 * temperature
        alarms += bool(explain(series(value, covariates=temperature), false_alarms=0.05).changes)
    assert alarms <= 19


def test_ratios_are_those_of_two_fits():
    """Against residual sums of squares by numpy's least squares."""
    rng = np.random.default_rng(7)
    x, Z, h = rng.standard_normal(30), rng.standard_normal((30, 3)), rng.standard_normal((30, 2))

    def rest(design):
        return np.linalg.lstsq(design, x)[1][0]

    found, gain = ratios(x, Z, h)
    for j in range(2):
        more = rest(np.column_stack([Z, h[:, j]]))
        assert gain[j] == pytest.approx(rest(Z) - more)
        assert found[j] == pytest.approx((rest(Z) - more) / (more / 26))


@pytest.mark.parametrize("n", [12, 40])
def test_chances_are_those_of_many_draws_and_at_most_too_large(n):
    """A chance of 1 % is told within a third; a rare one is bounded, and may be told too large."""
    rng = np.random.default_rng(12)
    design = np.column_stack([np.ones(n), rng.standard_normal(n)])
    number = np.arange(n)
    steps = (number[:, None] >= np.arange(3, n - 2)).astype(float)
    ramps = np.maximum(number[:, None] - np.arange(n - 3), 0.0)
    courses = np.column_stack([steps, ramps, np.eye(n)])
    many = np.concatenate(
        [ratios(rng.standard_normal((n, LOOK)), design, courses)[0].max(axis=0) for _ in range(100)]
    )
    largest = float(np.quantile(many, 0.99))
    assert chance_of(largest, design, courses, rng) == pytest.approx(0.01, rel=0.3)
    rare = float(np.quantile(many, 0.9999))
    assert 7e-5 < chance_of(rare, design, courses, rng) < 4e-4
    assert chance_of(1e3 * largest, design, courses, rng) < 1e-6


def test_a_low_rate_of_false_alarms_does_not_hide_a_large_change():
    rng = np.random.default_rng(13)
    value = series(0.29 * (DAYS >= 40) + noise(rng))
    (change,) = explain(value, false_alarms=1e-4 / 12).changes
    assert change.place == 40
    assert change.chance < 1e-5


def test_estimates_scatter_by_what_they_claim_at_least():
    """The covariance that is made white is that of the formula, with each log's own variance."""
    rng = np.random.default_rng(14)
    deviation = np.where(np.arange(60) % 2, 0.5, 3.0)
    x = deviation * rng.standard_normal(60)
    scatter = Scatter(np.arange(60.0), deviation)
    np.testing.assert_allclose(scatter.white(x), x / deviation)
    scatter.fit(x, np.ones((60, 1)))
    assert scatter.size < 1.0  # all there is, 2 of it, is claimed
    white = scatter.white(np.eye(60))
    lags = abs(np.subtract.outer(np.arange(60), np.arange(60)))
    formula = np.diag(deviation**2) + scatter.size**2 * scatter.memory**lags
    np.testing.assert_allclose(np.linalg.inv(white.T @ white), formula, atol=1e-9)


def test_the_likelihood_is_that_of_what_the_design_leaves():
    """Of contrasts that no column of it moves, but for what is the same at every covariance."""
    rng = np.random.default_rng(15)
    x, Z, root = rng.standard_normal(8), rng.standard_normal((8, 3)), rng.standard_normal((8, 8))
    contrasts = null_space(Z.T)
    found, wanted = [], []
    for covariance in (np.eye(8), 3.0 * np.eye(8), root @ root.T + np.eye(8)):
        found.append(_restricted(x, Z, np.linalg.cholesky(covariance)))
        density = multivariate_normal(cov=contrasts.T @ covariance @ contrasts)
        wanted.append(density.logpdf(contrasts.T @ x))
    np.testing.assert_allclose(np.diff(found), np.diff(wanted))


def test_memory_is_over_the_usual_step_whatever_the_first():
    """A pause of ten days after the first log: the memory is from day to day all the same."""
    time = np.r_[0.0, 10.0 + np.arange(79.0)]
    x = noise(np.random.default_rng(8), 80, 4.0, 0.6)
    scatter = Scatter(time, np.ones(80))
    scatter.fit(x, np.ones((80, 1)))
    white = scatter.white(np.eye(80))
    formula = np.eye(80) + scatter.size**2 * scatter.memory ** abs(np.subtract.outer(time, time))
    np.testing.assert_allclose(np.linalg.inv(white.T @ white), formula, atol=1e-9)
    assert scatter.memory > 0


def temperature(rng):
    return 12 * np.sin(2 * np.pi * DAYS / N) + rng.standard_normal(N)


def judged(value, covariates):
    deviation = np.full(N, 0.003) * value
    return verdict("f_c", DAYS, value, deviation, covariates, false_alarms=0.01)


def test_wear_is_told_from_warmth():
    rng = np.random.default_rng(9)
    warm = temperature(rng)
    friction = np.exp(-0.01 * warm + noise(rng))
    none = np.empty((N, 0))
    assert judged(friction, none).kind == CHANGED  # of whatever cause
    alone = judged(friction, warm[:, None])
    assert alone.kind == EXPLAINED
    assert alone.found.slopes[0] == pytest.approx(-0.01, rel=0.1)
    worn = judged(friction * (1 + ramp(0.12)), warm[:, None])
    assert worn.kind == CHANGED
    (change,) = worn.found.changes
    assert float(worn.percent(change.size)) == pytest.approx(12, abs=3)
    assert judged(np.exp(noise(rng)), warm[:, None]).kind == STEADY


def test_what_moves_together_stays_open():
    rng = np.random.default_rng(10)
    warm = ramp(10.0) + 0.1 * rng.standard_normal(N)
    found = judged(np.exp(ramp(0.12) + noise(rng)), warm[:, None])
    assert found.kind == OPEN
    assert found.change.deviation > 0.05


def test_the_size_beside_a_covariate():
    rng = np.random.default_rng(11)
    warm = temperature(rng)
    given = series(0.01 * warm + noise(rng), covariates=warm)
    bare = explain(series(given.value)).changes[0]
    beside = size_of(given, bare)
    assert abs(beside.size) < 3 * beside.deviation < abs(bare.size)
