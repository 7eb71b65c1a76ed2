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
