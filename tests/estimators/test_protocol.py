"""User code reads u and y alone, and returns numbers; else an error says what it returned."""

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


@pytest.mark.parametrize("kind", [Stepping, Batching])
@pytest.mark.parametrize("answer", [["fast"], [{"f_m": 0.05}]])
def test_an_answer_without_numbers_is_refused(kind, answer):
    call = "run" if kind is Batching else "step"
    with pytest.raises(StepError, match=rf"^{call} returned no numbers: .*{__file__}:\d+"):
        run_estimator(kind(answer), U, Y)


def test_an_estimator_reads_torque_and_output_and_never_the_truth():
    received = []

    class Spy(Stepping):
        def step(self, *signals):
            received.append(signals)
            return [0.0]

    run_estimator(Spy(None), U, Y, [True, False, True])
    assert received == [(0.0, 0.0), (1.0, None), (2.0, 0.2)]
