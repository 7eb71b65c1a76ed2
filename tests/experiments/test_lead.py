"""What a report says first: sentences, standings and the mismatch track, from rows made by hand."""

import re

import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import find_scenario
from flexaxis.experiments.figures import colour, marker
from flexaxis.experiments.scoring.ranking import (
    answers,
    matrix,
    mismatch_in_words,
    mismatched,
    standings,
)


def match(estimator, lag, within, *, own=1.0):
    return {
        "scenario": "s", "parameter": "f_m", "estimator": estimator, "lag": lag,
        "lag_interval": within, "own_ratio": own, "bound": 0.1, "over_bound": lag and lag / 0.1,
    }  # fmt: skip


def row(scenario, estimator, score, *, changed=True, parameter="f_m", **more):
    return {
        "scenario": scenario, "estimator": estimator, "parameter": parameter, "changed": changed,
        "score": score, "score_interval": None if score is None else [score - 3, score + 3],
        "lag": None if score is None else 5 - score / 25, "std": 1.0, "bias": 0.1, "diverged": 0,
        "never_settled": 0, "detection": None,
    } | more  # fmt: skip


def test_the_fastest_the_next_and_the_papers_method_in_one_sentence():
    order = [
        match("rpem-forgetting", 2.0, [1.9, 2.1]),
        match("quick", 0.2, [0.1, 0.3]),
        match("middling", 0.5, [0.4, 0.6], own=4.0),
        match("out of reach", None, None),
    ]
    (text,) = answers(order, {"s": "f_m +50 % at 10 s"})
    assert text.startswith("s (f_m +50 % at 10 s): quick follows f_m fastest, lag 0.2 s (2 times")
    assert "next comes middling, lag 0.5 s (5 times the bound), with 4 times the deviation" in text
    assert "the paper's method, rpem-forgetting, lag 2 s (20 times the bound)." in text
    assert "out of reach" not in text


def test_overlapping_intervals_are_no_verdict():
    (text,) = answers([match("a", 0.2, [0.1, 0.5]), match("b", 0.3, [0.2, 0.6])], {"s": ""})
    assert "these seeds cannot tell it from b" in text


def test_standings_are_means_over_the_scenarios_all_share():
    rows = [
        row("one", "a", 80.0),
        row("two", "a", 60.0, diverged=2),
        row("two", "a", None, changed=False, parameter="k_T", diverged=1),
        row("one", "b", 90.0, detection={"false_alarms": 0.5}),
        row("two", "b", 70.0, detection={"false_alarms": 0.0}),
        row("only b", "b", -500.0, detection={"false_alarms": 1.0}),
    ]
    b, a = standings(rows)
    assert (a.estimator, a.score, a.scenarios) == ("a", 70.0, 2) and b.score == 80.0
    assert a.half_width == pytest.approx((3**2 + 3**2) ** 0.5 / 2)  # of a mean of two
    assert a.diverged == 2  # the worst parameter of a scenario, not their sum
    assert a.false_alarms is None and b.false_alarms == 0.5
    assert standings([row("one", "a", None)]) == []


def test_a_cell_is_the_changed_parameter_else_the_worst():
    rows = [
        row("s", "a", 1.0, parameter="k_T", changed=False, bias=50.0),
        row("s", "a", 2.0, parameter="f_m"),
        row("calm", "a", None, parameter="k_T", changed=False),
        row("calm", "a", None, parameter="f_m", changed=False, bias=-9.0),
    ]
    cells = matrix(rows, ["s", "calm"]).cells
    assert [cells[name, "a"]["parameter"] for name in ("s", "calm")] == ["f_m", "f_m"]


def test_the_mismatch_track_in_words():
    names = ["coulomb_fm_step-v1", "fm_step-v1"]
    assert mismatched({name: find_scenario(name) for name in names}) == names[:1]
    rows = [row("m", "a", 10.0), row("m", "b", 50.0, detection={"false_alarms": 0.25})]
    text = mismatch_in_words(rows, ["m"])
    assert re.search(r"b in 1 of 1", text) and "False alarms a run: b 0.25." in text


def test_a_short_lag_bought_with_noise_or_knowledge_wins_nothing():
    rows = [
        row("m", "rpem-forgetting", 10.0, std=1.0),
        row("m", "noisy", 90.0, std=1.6),
        row("m", "oracle-reset", 95.0, std=1.0),
        row("m", "as quiet", 50.0, std=1.4),
    ]
    assert "as quiet in 1 of 1" in mismatch_in_words(rows, ["m"])


def test_controls_give_no_answer():
    order = [match(e, lag, [lag, lag]) for e, lag in (("oracle-reset", 0.1), ("a", 0.2), ("b", 3))]
    (text,) = answers(order, {"s": ""})
    assert "a follows" in text and "oracle" not in text


def test_registered_estimators_look_different():
    looks = [(colour(name), marker(name)) for name in REGISTRY]
    assert len(set(looks)) == len(looks)
    assert colour("mine.py:Mine") == colour("mine.py:Mine")
