"""The series of the filters against the paper word for word, and against longer arithmetic."""

import numpy as np
import pytest
from acceptance.literal import LiteralRpem

from flexaxis.estimators import Rpem, increment, three_mass

P0 = [2.97e-4, 5.19e-5, 4.69e-6]
DRIFT = [5e-8, 50e-8, 500e-8]
SUBSETS = [
    ("k_T",),
    ("f_m", "1/J_a"),
    ("k_T", "1/J_a", "f_m", "k_a", "d_g"),
    ("J_a", "k_g", "1/k_a", "d_a"),
]


def both(model, u, y, valid=None, *, identify=("k_T", "1/J_a", "f_m"), output="speed", **options):
    """The compiled method and the literal one, and θ (N, p) of both."""
    read = increment(model, 0.005) if output == "increment" else model
    options = {"forgetting": 0.995} | options if "drift" not in options else options
    literal = LiteralRpem(read.parametrize(identify), period=0.005, **options)
    fast = Rpem(model, identify=identify, output=output, ceiling=np.inf, period=0.005, **options)
    return fast, literal, fast.run(u, y, valid), literal.run(u, y, valid)


def gaps(N: int) -> np.ndarray:
    valid = np.random.default_rng(5).random(N) > 0.1
    valid[700:1100] = False
    return valid


@pytest.mark.parametrize(
    ("options", "missing"),
    [
        ({"forgetting": 0.995}, False),
        ({"forgetting": 0.99, "regularization": 0.3, "output": "increment"}, True),
        ({"drift": DRIFT}, True),
        ({"drift": np.diag(DRIFT) + 5e-8, "regularization": 1.0, "output": "increment"}, False),
    ],
)
def test_run_is_the_paper_word_for_word(nominal, loop, options, missing):
    u, y = loop.u[:1500], (loop.increment if "output" in options else loop.y)[:1500]
    valid = gaps(1500) if missing else None
    given = dict(theta0=np.array([1.2, 1.5, 0.06]), P0=P0, **options)
    fast, literal, ours, theta = both(three_mass(nominal), u, y, valid, **given)
    # rounding only: 2e-14 to 1e-13 is what is seen, mostly that of the matrix exponential
    np.testing.assert_allclose(ours, theta, rtol=1e-12)
    np.testing.assert_allclose(fast.P, literal.P, rtol=1e-10, atol=1e-12 * literal.P.max())
    np.testing.assert_allclose(fast.psi, literal.psi, rtol=1e-9)


def test_every_choice_of_parameters_is_the_paper(nominal, loop):
    model = three_mass(nominal)
    for identify in SUBSETS:
        theta = model.parametrize(identify).theta
        given = dict(identify=identify, theta0=1.05 * theta, P0=1e-6 * theta**2)
        *_, ours, expected = both(model, loop.u[:400], loop.y[:400], **given)
        np.testing.assert_allclose(ours, expected, rtol=1e-9, err_msg=str(identify))


def transition(F, period):
    """exp(F T) in extended precision: a Taylor series of small steps, squared."""
    halvings = 16
    small = F * np.longdouble(period) / 2**halvings
    total = term = np.eye(len(F), dtype=np.longdouble)
    for k in range(1, 16):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision here")
@pytest.mark.parametrize(
    "stiff", [{}, {"k_g": 1e3}, {"d_g": 1e2}, {"k_a": 1e3}, {"k_g": 1e3, "d_g": 1e2}, {"f_m": 1e3}]
)
def test_series_is_exact_on_stiff_models(nominal, loop, stiff):
    model = three_mass({name: value * stiff.get(name, 1) for name, value in nominal.items()})
    theta = model.parametrize(("k_T", "1/J_a", "f_m")).theta
    fast = Rpem(model, P0=np.full(3, 1e-300), bounds=(0.2 * theta, 5 * theta), period=0.005)
    literal = LiteralRpem(fast._design.model, fast._design.theta0, np.ones(3), period=0.005)
    F = np.pad(np.column_stack(literal.extended()), ((0, 1), (0, 0))).astype(np.longdouble)
    Phi = transition(F, 0.005)
    X = np.zeros(len(Phi), np.longdouble)
    largest = np.zeros(4)  # of each lane; a state that happens to cross zero is no measure
    for k in range(50):
        fast.step(loop.u[k], None)
        X[-1] = loop.u[k]
        X = Phi @ X
        expected = np.roll(X[:-1].reshape(4, 5), 1, axis=0).T  # the literal x is the last
        largest = np.maximum(largest, np.abs(expected).max(axis=0))
    error = np.abs(fast.state["X"][:5, :4] - expected).max(axis=0)
    assert (error / largest).max() < 1e-12
