"""Scores that must not change unless someone means it: every estimator, every column.

`python tests/golden/make.py` writes them anew, for a change that is meant, and prints what moved.
"""

import numpy as np
import pytest

from flexaxis.estimators.protocol import run_estimator
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.sim.simulate import simulate
from tests.golden import contents

ADVICE = "if that is meant: python tests/golden/make.py scores"


OLD = contents.golden_rows()


QUICK = ("fm_step-v1",)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK)) for n in contents.SCENARIOS],
)
def test_scores_are_what_they_were(name):
    old = [row for row in OLD if row["scenario"] == name]
    moved = contents.score_moves(old, contents.score_rows(name))
    assert not moved, "\n".join([ADVICE, *moved])


@pytest.mark.slow
def test_last_bits_of_the_torque_move_no_estimate():
    """Other processors round otherwise; here the friction that is learnt falls steeply."""
    scenario = find_scenario("warming_fm_step-v1")
    (record,) = simulate(scenario, [0])
    torque = np.asarray(record.torque)
    noise = 1e-15 * np.random.default_rng(0).standard_normal(torque.shape)
    moved = {}
    for name in REGISTRY:
        one, other = (build(parse(name), scenario) for _ in range(2))
        y = getattr(record, one.output)
        old = run_estimator(one, torque, y)
        new = run_estimator(other, torque * (1 + noise), y)
        moved[name] = (np.abs(new - old) / np.abs(old).max(axis=0)).max()
    assert max(moved.values()) < 1e-8, moved
