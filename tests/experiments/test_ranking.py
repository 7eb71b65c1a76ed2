"""Which estimators lead, and which are tied: from paired values made by hand."""

import numpy as np
import pytest

from flexaxis.experiments.comparison.ranking import leaders, mark, overall

RECORD = np.random.default_rng(0).standard_normal(16)
"""What the record does to every estimator alike."""


def values(lag, *, own=0.02, seed=1, common=0.5):
    """ln of lags that share what the record does; `own` is what each adds to it."""
    noise = own * np.random.default_rng(seed).standard_normal(16)
    return (np.log(lag) + common * RECORD + noise - noise.mean()).tolist()


def match(estimator, lag, *, how="matched", scenario="s", score=None):
    return {
        "scenario": scenario, "parameter": "f_m", "estimator": estimator, "how": how,
        "lag": lag, "bound": 0.1,
        "values": {
            "lag": values(lag, seed=len(estimator)),
            "score": None if score is None else (score + RECORD).tolist(),
        },
    }  # fmt: skip


def test_pairs_tell_apart_what_intervals_that_overlap_do_not():
    lags = {"a": values(0.20, seed=1), "b": values(0.24, seed=2)}  # each ±25 %, together ±2 %
    assert leaders(lags) == ["a"]
    assert leaders({"a": lags["a"], "b": values(0.201, own=0.1, seed=2)}) == ["a", "b"]


def test_the_whole_set_is_compared_not_only_the_second():
    lags = {"a": values(0.20), "b": values(0.24, seed=2), "c": values(0.25, own=0.5, seed=3)}
    assert leaders(lags) == ["a", "c"]  # c is behind b, but cannot be told from a


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 17])
def test_the_best_is_wrongly_told_from_its_equals_in_one_of_twenty_at_most(number):
    """Estimators that are all alike: the best of them is the best by luck."""
    rng, wrong, draws = np.random.default_rng(number), 0, 1000
    for _ in range(draws):
        scores = {str(i): rng.standard_normal(16).tolist() for i in range(number)}
        wrong += len(leaders(scores)) < number
    assert wrong / draws <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / draws)


def test_controls_and_those_that_are_noisier_everywhere_do_not_lead():
    rows = mark(
        [match("oracle-reset", 0.1), match("loud", 0.12, how="noisier"), match("slow", 2.0),
         match("quiet", 0.2, how="quieter")]
    )  # fmt: skip
    assert [r["estimator"] for r in rows if r["leads"]] == ["quiet"]


def test_who_is_quieter_at_every_setting_is_never_called_slower():
    """Its lag at equal noise is at most what is shown, and may be less than the best's."""
    rows = mark([match("a", 0.2), match("b", 0.9), match("quiet", 0.4, how="quieter")])
    assert [r["estimator"] for r in rows if r["leads"]] == ["a"]
    scores = [match("a", 1, score=80.0), match("quiet", 1, score=70.0, how="quieter")]
    assert [r["leads"] for r in overall(scores)] == [True, False]


def test_one_number_over_all_faults_has_a_fixed_set_and_no_score_is_zero():
    rows = [
        match("a", 1, scenario="one", score=80.0), match("a", 1, scenario="two", score=60.0),
        match("b", 1, scenario="one", score=90.0), match("b", 1, scenario="two"),
        match("c", 1, scenario="one", score=100.0, how="noisier"),
        match("c", 1, scenario="two", score=100.0),
    ]  # fmt: skip
    c, a, b = overall(rows)
    mean = RECORD.mean()
    assert (c["estimator"], c["how"], c["leads"]) == ("c", "noisier", False)  # at most so much
    assert a["score"] == pytest.approx(70 + mean) and a["leads"]
    assert b["score"] == pytest.approx(45 + mean / 2) and not b["leads"]
    assert a["faults"] == b["faults"] == 2
    low, high = a["score_interval"]
    assert low < a["score"] < high
    assert overall([match("a", 1) | {"bound": None}]) == []
    assert overall([match("a", 1)]) == []  # nobody has a score
    unbounded = match("only elsewhere", 1, scenario="three") | {"bound": None}
    assert {r["estimator"]: r["score"] for r in overall([*rows, unbounded])}[
        "only elsewhere"
    ] == 0.0
