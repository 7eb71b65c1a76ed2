"""Which cases are run again, and what counts as a difference."""

from collections import Counter
from random import Random

import pytest

from flexaxis.experiments.running.verify import _sample, differences


def test_every_case_is_as_likely_to_be_run_again_as_any_other(stored, tmp_path):
    """Three of ten, 400 times: each 120 times, give or take 9; five times that is allowed."""
    cases = [{"case": str(case), "seed": case} for case in range(10)]
    stored(tmp_path, [case | {"parameter": name} for case in cases for name in ("k_T", "f_m")])
    times: Counter = Counter()
    for seed in range(400):
        chosen = _sample(tmp_path, 3, Random(seed))
        assert all(len(rows) == 2 and rows[0]["case"] == rows[1]["case"] for rows in chosen)
        cases = {rows[0]["case"] for rows in chosen}
        assert len(cases) == 3
        times.update(cases)
    assert len(times) == 10 and all(abs(count - 120) < 46 for count in times.values())
    assert len(_sample(tmp_path, 20, Random(0))) == 10  # all, if there are fewer


@pytest.mark.parametrize(
    ("row", "other", "exact", "elsewhere"),
    [
        ({"lag": 1.0}, {"lag": 1.0 + 1e-15}, 1, 0),
        ({"lag": 1.0}, {"lag": 1.0 + 5e-7}, 1, 0),
        ({"lag": 1.0}, {"lag": 1.0 + 2e-6}, 1, 1),
        ({"lag": 0.0}, {"lag": 2e-9}, 1, 1),
        ({"lag": 1.0}, {"lag": None}, 1, 1),
        ({"lag": 1.0}, {}, 1, 1),  # on either side
        ({}, {"lag": 1.0}, 1, 1),
        ({"bound": {"20": 0.1, "50": 0.2}}, {"bound": {"20": 0.3, "50": 0.4}}, 2, 2),
        ({"cost": {"host": "a"}}, {"cost": {"host": "b"}}, 0, 0),
        ({"estimator": "ekf"}, {"estimator": "ukf"}, 1, 1),
    ],
)
def test_what_counts_as_a_difference(row, other, exact, elsewhere):
    """Here to the last bit, elsewhere within 1e-6 of the value or 1e-9."""
    assert len(list(differences(row, other, exact=True))) == exact
    assert len(list(differences(row, other, exact=False))) == elsewhere
