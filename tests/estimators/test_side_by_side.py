"""Runs side by side: each to the last bit what it is alone, whoever runs beside it."""

import numpy as np
import pytest

from flexaxis.estimators import EstimatorError, Frozen, Rpem, one_mass, three_mass, two_mass
from flexaxis.estimators.methods import beside
from flexaxis.estimators.methods.beside import kind_of, registers
from flexaxis.estimators.recursion.astray import PATIENCE
from flexaxis.estimators.side_by_side import run_together, worth_together

N = 1500
TWO = {"k_T": 1.0, "J_m": 4.8e-3, "J_l": 4.8e-3, "k": 547.0, "d": 0.01, "f_m": 0.06, "f_l": 0.07}
ONE = {"k_T": 1.0, "J_m": 9.6e-3, "f_m": 0.13}
P0 = np.array([2.97e-4, 5.19e-5, 4.69e-6])
TUNINGS = [
    {"forgetting": 0.995},
    {"forgetting": 0.98, "robust": 3.0},
    {"drift": 1e-3, "robust": 4.0},
    {"forgetting": 0.99, "regularization": 1.0, "state_correction": True},
    {"drift": 1e-2, "regularization": 1e-3, "noise": 0.1, "robust": 4.0},
    {"forgetting": 0.9, "ceiling": 1e-6},
    {"forgetting": 0.995, "ceiling": np.inf, "state_correction": True},
]


def filters(model, output="speed", identify=None, count=11):
    """Return so many filters, each with a tuning, a start and a P(0) of its own."""
    theta = model.parametrize(identify).theta
    made = []
    for i in range(count):
        options = dict(TUNINGS[i % len(TUNINGS)])
        P = 1e-4 * (1 + 0.3 * i) * theta**2
        for name, size in (("drift", P), ("regularization", 1e-2 / P)):
            if name in options:
                options[name] = options[name] * size
        made.append(
            Rpem(model, identify=identify, theta0=(0.9 + 0.02 * i) * theta, P0=P, period=0.005,
                 output=output, bounds=(0.05 * theta, 20.0 * theta), **options)
        )  # fmt: skip
    return made


def signals(loop, count, output="speed"):
    """Return u, y, valid of so many runs: noise, outliers, a sensor that sticks, gaps."""
    rng = np.random.default_rng(3)
    start = [37 * i for i in range(count)]
    u = [loop.u[k : k + N].copy() for k in start]
    clean = loop.increment if output == "increment" else loop.clean
    y = [clean[k : k + N] + 0.1 * rng.standard_normal(N) for k in start]
    valid = [None if i % 3 else rng.random(N) > 0.1 for i in range(count)]
    y[1][::101] += 30.0
    y[-3][700:760] = y[-3][700]
    y[4][:] = np.minimum(y[4], np.quantile(y[4], 0.9))
    valid[3][400:600] = False
    return u, y, valid


def words(estimator):
    return estimator.state.view(float)


def assert_as_alone(several, u, y, valid):
    """Run several together, and copies of them each alone."""
    alone = [each.copy() for each in several]
    found = run_together(several, u, y, valid)
    for i, (own, other) in enumerate(zip(alone, several, strict=True)):
        expected = own.run(u[i], y[i], None if valid is None else valid[i])
        np.testing.assert_array_equal(found[i], expected, err_msg=str(i))
        np.testing.assert_array_equal(other.innovations, own.innovations)
        np.testing.assert_array_equal(words(other), words(own))
        np.testing.assert_array_equal(other.prediction, own.prediction)


@pytest.mark.parametrize(
    ("model", "output", "identify"),
    [
        ("three_mass", "speed", None),
        ("three_mass", "increment", ("J_a", "k_g", "1/k_a", "d_a")),
        ("two_mass", "increment", ("k_T", "1/J_l")),
        ("one_mass", "speed", ("f_m",)),
    ],
)
def test_each_run_is_what_it_is_alone(nominal, loop, model, output, identify):
    made = {"three_mass": three_mass(nominal), "two_mass": two_mass(TWO), "one_mass": one_mass(ONE)}
    several = filters(made[model], output, identify)
    u, y, valid = signals(loop, len(several), output)
    kinds = {kind_of(each) for each in several}
    assert len(kinds) == 1 and None not in kinds
    assert_as_alone(several, u, y, valid)
    assert_as_alone(several, u, y, valid)  # from where they are
    kept = [each for each in several if each.state["patience"][0] == PATIENCE]  # some began anew
    assert {int(each.state["taken"][0]) for each in kept} == {2 * N}
    assert len(kept) > 8
    if output == "speed" and model == "three_mass":  # else nothing of the sensor was tried
        assert several[4].state["rails"][0, 1] == max(y[4])
        assert several[8].state["rails"][0].tolist() != several[0].state["rails"][0].tolist()


def test_what_does_not_fit_runs_alone(nominal, loop):
    class Own(Rpem):
        def run(self, u, y, valid=None):
            return super().run(u, y, valid) + 1.0

    model = three_mass(nominal)
    own = Own(model, P0=P0, period=0.005)
    several = [*filters(model, count=5), own, Frozen(model), Rpem(model, P0=P0, period=0.02)]
    u, y, _ = signals(loop, len(several))
    u[4], y[4] = u[4][:700], y[4][:700]  # another length
    alone = [each.copy() for each in several]
    found = run_together(several, u, y)
    for i, each in enumerate(alone):
        np.testing.assert_array_equal(found[i], each.run(u[i], y[i]))
    assert [kind_of(each) is None for each in several[5:]] == [True, True, False]
    assert kind_of(several[0]) != kind_of(several[7])


def test_a_run_that_goes_astray_takes_no_other_with_it(nominal, loop):
    several = filters(three_mass(nominal), count=8)
    u, y, valid = signals(loop, 8)
    u[5][300] = 1e300  # its sensitivities overflow, ŷ is no number
    alone = [each.copy() for each in several]
    found = run_together(several, u, y, valid)
    for i, each in enumerate(alone):
        np.testing.assert_array_equal(found[i], each.run(u[i], y[i], valid[i]))
        np.testing.assert_array_equal(words(several[i]), words(each))
    assert not np.isfinite(found[5]).all()
    assert all(np.isfinite(found[i]).all() for i in range(8) if i != 5)


def test_what_is_infinite_spreads_as_it_does_alone(nominal):
    several = filters(three_mass(nominal), count=4)
    several[2].state["X"][0, :, 0] = 1e308  # zero times infinite is no number, where it is taken
    assert_as_alone(several, [np.ones(1)] * 4, [np.ones(1)] * 4, None)
    assert np.isnan(several[2].state["X"]).any()


def test_wrong_use_is_refused(nominal):
    one = Rpem(three_mass(nominal), P0=P0, period=0.005)
    with pytest.raises(EstimatorError, match="1 estimators got 2 u"):
        run_together([one], [[0.0]] * 2, [[0.0]])
    with pytest.raises(EstimatorError, match="given twice"):
        run_together([one, one], [[0.0]] * 2, [[0.0]] * 2)
    with pytest.raises(EstimatorError, match="finite"):
        run_together([one], [[np.nan]], [[0.0]])
    assert run_together([], [], []) == []
    assert run_together([one], [[]], [[]])[0].shape == (0, 3)


@pytest.mark.skipif(not registers(), reason="nothing is compiled here")
def test_code_is_compiled_when_it_pays(nominal, monkeypatch):
    several = filters(three_mass(nominal), count=4)
    beside._came.clear()
    monkeypatch.setattr(beside, "PAYS", dict.fromkeys(beside.PAYS, 10_000))
    monkeypatch.setattr("flexaxis.estimators.sampling.compiler.Compiled.kept", lambda *_: False)
    assert worth_together([*several, Frozen(three_mass(nominal))], 1000) == [False] * 5
    assert worth_together(several[:3], 100_000) == [False] * 3  # too few for a register
    assert worth_together(several, 1000) == [False] * 4
    assert worth_together(several[:1], 1000, runs=4) == [True]
    monkeypatch.undo()
    beside._came.clear()
    assert worth_together(several, 1) == [True] * 4  # it is in the cache by now
