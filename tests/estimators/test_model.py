import numpy as np
import pytest
from acceptance.axes import held

from flexaxis.estimators import EstimatorError, increment, three_mass, two_mass
from flexaxis.estimators.models.axis_models import MODELS
from flexaxis.estimators.models.formula import multiply_out

EVERY = ("k_T", "J_m", "J_g", "1/J_a", "k_g", "1/k_a", "d_g", "d_a", "f_m", "f_g", "1/f_a", "r")


def test_formula_is_multiplied_out():
    assert multiply_out("-(2*a + 1)/b^2") == ((-2.0, {"a": 1, "b": -2}), (-1.0, {"b": -2}))
    assert multiply_out("a*b/(2*a) - 1e-3") == ((0.5, {"b": 1}), (-0.001, {}))
    assert multiply_out("0") == ()


@pytest.mark.parametrize(
    "entry",
    ["a +", "1/(a + b)", "sin(a)", "a^b", "a^0.5", "'a'", "a if b else c",
     "1/0", "a/0", "a/(b-b)", "0^-1", "(0*a)^-2", "a*10.0^400"],
)  # fmt: skip
def test_formula_that_is_none(entry):
    with pytest.raises(EstimatorError, match="cannot read the formula"):
        multiply_out(entry)


def test_three_mass_is_the_paper(nominal, by_hand):
    A, B, C = three_mass(nominal).parametrize(["k_T"]).matrices([1.0])
    hand_A, hand_B = by_hand(nominal)
    np.testing.assert_allclose(A, hand_A[:5, :5], rtol=1e-14)
    np.testing.assert_allclose(B[:, 0], hand_B[:5], rtol=1e-14)
    np.testing.assert_array_equal(C, [[0, 0, 1, 0, 0]])


def test_derivatives_are_finite_differences(nominal):
    chosen = three_mass(nominal).parametrize(EVERY)
    for i, value in enumerate(chosen.theta):
        # a central difference of monomials with |e| ≤ 2 is off by about h² = 1e-8 relatively
        step = np.zeros(len(EVERY))
        step[i] = 1e-4 * value
        above, below = (chosen.blocks(chosen.theta + side * step)[0] for side in (1, -1))
        error = (above - below) / (2 * step[i]) - chosen.blocks(chosen.theta)[1 + i]
        assert np.all(np.abs(error) <= 1e-7 * np.abs(above / value))


def test_increment_is_the_mean_speed_exactly(nominal, loop):
    period = 0.005
    model = increment(three_mass(nominal), period)
    A, B, C = model.parametrize(["k_T"]).matrices([1.0])
    step = held(A, B, period)
    x, y = np.zeros(6), []
    for u in loop.u[:2000]:
        y.append(C[0] @ x)
        x[5] = 0.0
        x = step[:6, :6] @ x + step[:6, 6] * u
    # the encoder's increment comes from differences of an angle of about 1 rad: 1e-16/T
    np.testing.assert_allclose(y, loop.increment[:2000], atol=1e-11)
    assert model.reset == ("angle_increment",)


def test_two_mass_is_newton():
    q = {"k_T": 2.0, "J_m": 4.0, "J_l": 5.0, "k": 500.0, "d": 0.3, "f_m": 0.06, "f_l": 0.07}
    A, B, C = two_mass(q).parametrize(["k"]).matrices([500.0])
    twist, motor, load, u = 0.1, 2.0, -3.0, 1.5
    x = np.array([twist, motor, load])
    shaft = 500.0 * twist + 0.3 * (motor - load)
    expected = [motor - load, (2.0 * u - shaft - 0.06 * motor) / 4, (shaft - 0.07 * load) / 5]
    np.testing.assert_allclose(A @ x + B[:, 0] * u, expected, rtol=1e-14)
    assert C @ x == motor


@pytest.mark.parametrize(
    ("identify", "message"),
    [
        (["f_n"], "no parameter 'f_n'.*did you mean 'f_g'|did you mean 'f_m'"),
        (["1/Ja"], "no parameter '1/Ja'.*did you mean 'J_a'"),
        (["J_a", "1/J_a"], "contains 'J_a' twice"),
        ([], "identify is empty"),
    ],
)
def test_choices_that_cannot_be_made(nominal, identify, message):
    with pytest.raises(EstimatorError, match=message):
        three_mass(nominal).parametrize(identify)


@pytest.mark.parametrize(
    ("model", "name", "value", "words"),
    [
        (name, parameter, value, words)
        for name, shipped in MODELS.items()
        for parameters, values, words in (
            (shipped.factory(shipped.rough).positive, (-1e-3, 0.0), "above 0"),
            (shipped.factory(shipped.rough).nonnegative, (-1e-3,), "at least 0"),
            (shipped.factory(shipped.rough).nonzero, (0.0,), "other than 0"),
        )
        for parameter in parameters
        for value in values
    ],
)
def test_impossible_values_are_refused(model, name, value, words):
    shipped = MODELS[model]
    with pytest.raises(EstimatorError, match=f"{name} is .*, but must be {words} in"):
        shipped.factory(dict(shipped.rough) | {name: value})
