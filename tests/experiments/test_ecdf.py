"""The distribution of lag over bound, against one counted by hand."""

import numpy as np
import pytest

from flexaxis.experiments.comparison.ranking import ecdf


def run(estimator, seed, lag, *, scenario="s", bound=0.5, diverged=False, null=5.0):
    return {
        "scenario": scenario, "parameter": "f_m", "seed": seed, "estimator": estimator,
        "lag": lag, "lag_bound": bound, "lag_null": null, "diverged": diverged,
    }  # fmt: skip


ROWS = [
    # on s with a bound of .5: a at 2, 1 and 4 × bound; b lost, never moved, and could not be run
    run("a", 0, 1.0), run("a", 1, 0.5), run("a", 2, 2.0),
    run("b", 0, 0.5, diverged=True), run("b", 1, 5.0),
    # on t with a bound of .1: a at 2 × bound, b at 30 × bound
    run("a", 0, 0.2, scenario="t", bound=0.1), run("b", 0, 3.0, scenario="t", bound=0.1),
    run("a", 0, 1.0, scenario="no bound", bound=None),
]  # fmt: skip


def test_it_is_what_one_counts_by_hand():
    found = ecdf(ROWS, ["a", "b"])
    assert (found.problems, found.faults) == (4, 2)  # three runs on s, one on t
    x, y = found.curve("a")
    np.testing.assert_allclose(x, [1, 2, 2, 4])
    np.testing.assert_allclose(y, [0.25, 0.5, 0.75, 1.0])
    x, y = found.curve("b")
    np.testing.assert_allclose(x, [30])
    np.testing.assert_allclose(y, [0.25])  # one of four, and never more
    assert found.share("a", 1.999) == 0.25 and found.share("a", 2.0) == 0.75
    assert found.share("b", 29.0) == 0.0 and found.share("b", 1e9) == 0.25


def test_lost_runs_and_those_that_never_move_never_reach_anything():
    for lost in (run("a", 0, 0.5, diverged=True), run("a", 0, 5.0), run("a", 0, None)):
        assert ecdf([lost], ["a"]).share("a", np.inf) == 0.0
    assert ecdf([run("a", 0, 4.9)], ["a"]).share("a", np.inf) == 1.0


def test_who_did_not_run_a_problem_has_not_reached_it():
    found = ecdf(ROWS, ["a", "b", "c"])
    assert found.share("c", np.inf) == 0.0 and found.curve("c")[0].size == 0


def test_the_order_of_rows_does_not_matter():
    one, other = ecdf(ROWS, ["a"]), ecdf(ROWS[::-1], ["a"])
    np.testing.assert_array_equal(one.curve("a"), other.curve("a"))


def test_without_a_bound_there_is_none():
    assert ecdf([run("a", 0, 1.0, bound=None)], ["a"]) is None
    assert ecdf([], ["a"]) is None


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_the_unit_of_time_does_not_matter(factor):
    scaled = [
        row | {key: row[key] and row[key] * factor for key in ("lag", "lag_bound", "lag_null")}
        for row in ROWS
    ]
    np.testing.assert_allclose(ecdf(scaled, ["a"]).curve("a"), ecdf(ROWS, ["a"]).curve("a"))
