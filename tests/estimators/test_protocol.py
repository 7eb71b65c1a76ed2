"""What comes back from code of a user: numbers, or an error that says what was there instead."""

import numpy as np
import pytest

from flexaxis.estimators.protocol import StepError, run_estimator

U, Y = np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.1, 0.2])


class Stepping:
    names, output = ("f_m",), "speed"

    def __init__(self, answer):
        self.answer = answer

    def step(self, u, y):
        return self.answer


class Batching(Stepping):
    def run(self, u, y):
        return [self.answer for _ in u]


ODD = [
    (["0.05"], "texts"), ([True], "truths"), (np.array([1 + 1j]), "complex numbers"),
    ([b"1"], "bytes"), (np.array(["1"], object), "texts"), (np.array([0], "M8[s]"), "dates"),
]  # fmt: skip


@pytest.mark.parametrize("kind", [Stepping, Batching])
@pytest.mark.parametrize(("answer", "said"), ODD)
def test_what_only_looks_like_numbers_is_refused(kind, answer, said):
    call = "run" if kind is Batching else "step"
    with pytest.raises(StepError, match=rf"^{call} returned {said}, and numbers .*{__file__}:\d+"):
        run_estimator(kind(answer), U, Y)


def test_what_is_masked_is_missing():
    found = run_estimator(Stepping(np.ma.array([0.5], mask=[True])), U, Y)
    assert np.isnan(found).all() and found.shape == (3, 1)


def test_an_array_that_is_masked_in_part_is_missing_there():
    class Half(Stepping):
        def run(self, u, y):
            return np.ma.array([[1.0], [2.0], [3.0]], mask=[[False], [True], [False]])

    np.testing.assert_array_equal(run_estimator(Half(None), U, Y), [[1.0], [np.nan], [3.0]])


@pytest.mark.parametrize("answer", [2, [2], (2.0,), np.float32(2), np.array([[2.0]])])
def test_any_numbers_do(answer):
    np.testing.assert_array_equal(run_estimator(Stepping(answer), U, Y), np.full((3, 1), 2.0))
