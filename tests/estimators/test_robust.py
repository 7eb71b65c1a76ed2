"""Outliers, gaps and standstill: the estimates are not thrown, and P stays bounded."""

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError, Rpem, three_mass
from flexaxis.estimators.models.axis_models import model_from_tables, one_mass

P0 = [2.97e-4, 5.19e-5, 4.69e-6]
THETA = np.array([1.0, 1.25, 0.05])


def test_outliers_do_not_throw_a_robust_filter(nominal, loop):
    """One sample in two hundred is off by 30 σ."""
    y = loop.y.copy()
    hit = np.random.default_rng(0).random(len(y)) < 0.005
    y[hit] += 3.0
    spread = {}
    for robust in (0.0, 3.0):
        theta = Rpem(three_mass(nominal), P0=P0, robust=robust, period=0.005).run(loop.u, y)
        spread[robust] = np.sqrt(np.mean((theta[4000:] / THETA - 1) ** 2, axis=0))
    clean = Rpem(three_mass(nominal), P0=P0, period=0.005).run(loop.u, loop.y)
    quiet = np.sqrt(np.mean((clean[4000:] / THETA - 1) ** 2, axis=0))
    assert np.all(spread[0.0] > 1.7 * quiet)  # outliers add 30²/200 = 4.5 times the variance
    assert np.all(spread[3.0] < 1.35 * quiet)  # three σ at one sample in 200 add 5 %


def test_a_model_from_tables_is_the_shipped_one():
    values = {"k_T": 2.0, "J_m": 0.5, "f_m": 0.3}
    own = model_from_tables(
        {
            "name": "mine",
            "states": ["speed_motor"],
            "A": [["-f_m/J_m"]],
            "B": ["k_T/J_m"],
            "C": ["1"],
            "nominal": values,
        }
    )
    shipped = one_mass(values).parametrize(["f_m", "1/J_m"])
    mine = own.parametrize(["f_m", "1/J_m"])
    np.testing.assert_array_equal(mine.blocks(mine.theta), shipped.blocks(shipped.theta))


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        ({"model": "one_mas"}, "one_mass"),
        ({"name": "x"}, "model.states: Field required"),
        ({"model": "one_mass", "nominal": {"J_m": "big"}}, r"nominal\.J_m: .* number"),
        (
            {"name": "x", "states": ["a"], "A": 3, "B": ["1"], "C": ["1"], "nominal": {}},
            r"model\.A: ",
        ),
    ],
)
def test_wrong_tables(tables, message):
    with pytest.raises(EstimatorError, match=message):
        model_from_tables(tables)
