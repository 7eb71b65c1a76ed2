"""Lost runs: what a candidate may lose before the gate says so."""

import numpy as np
import pytest
from scipy import stats

from flexaxis.experiments.gate.decide import judge_lost, levels, runs_needed
from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import pair, table
from flexaxis.experiments.gate.verdicts import judge
from flexaxis.experiments.gate.wording import headline, meaning
from flexaxis.experiments.scoring.score_table import MARGINS

SCENARIOS, SEEDS = ("s", "t", "u", "v"), range(1000, 1008)
RUNS = [(scenario, seed) for scenario in SCENARIOS for seed in SEEDS]


def rows(*, diverged=(), never_settled=()):
    """An estimator on 4 × 8 runs; one that is lost sits at the edge of the box from then on."""
    return [
        {
            "scenario": scenario,
            "seed": seed,
            "parameter": parameter,
            "lag": 400.0 if (scenario, seed) in diverged else 1.0,
            "std": 0.1,
            "diverged": (scenario, seed) in diverged,
            "never_settled": (scenario, seed) in {*diverged, *never_settled},
        }
        for scenario, seed in RUNS
        for parameter in ("k_T", "f_m")
    ]


def compared(base, candidate):
    found = judge(pair(table(base), table(candidate), MARGINS), MARGINS)
    return Comparison("a", "b", list(SEEDS), 1, 1, 0.01, found)


def chosen(number, seed=0):
    """So many runs, at random."""
    order = np.random.default_rng(seed).permutation(len(RUNS))
    return [RUNS[i] for i in order[:number]]


def of(found, metric):
    return next(v for v in found.verdicts if v.metric == metric)


@pytest.mark.parametrize(
    ("number", "word", "status"),
    [
        (22, "worse", 1),
        (10, "worse", 1),  # p = 2⁻¹⁰ = .00098, and the level is .0015
        (9, "undecided", 3),  # p = .00195
        (2, "undecided", 3),
        (1, "undecided", 0),
        (0, "same", 0),
    ],
)
@pytest.mark.parametrize("way", ["diverged", "never_settled"])
def test_runs_lost_at_random(way, number, word, status):
    found = compared(rows(), rows(**{way: chosen(number)}))
    assert (found.verdict, found.status()) == (word, status)
    assert found.newly_lost == number == of(found, way).candidate
    assert found.status(strict=True) == (3 if word == "undecided" else status)


def test_levels_share_the_error():
    """Scores .5 %, guards .1 %, each test of lost runs .15 % worse and .05 % better: 1 % in all."""
    from flexaxis.experiments.gate.decide import SHARES

    both = [level for way in ("diverged", "never_settled") for level in levels(way, 0.01)]
    assert both == pytest.approx([0.0015, 0.0005] * 2)
    apart = 0.01 * (SHARES["scores"] + SHARES["guards"])
    assert sum(both) + apart == pytest.approx(0.01)


@pytest.mark.parametrize("number", [5, 10, 11, 14, 20, 40, 100])
def test_an_equal_chance_is_called_worse_or_better_seldom(number):
    """The exact chance over all ways in which so many one-sided losses fall, up to the level."""
    newly = np.arange(number + 1)
    said = judge_lost(newly, number - newly, "diverged")
    chance = stats.binom.pmf(newly, number, 0.5)
    worse, better = levels("diverged")
    assert chance[said == "worse"].sum() <= worse and chance[said == "better"].sum() <= better
    if number >= 11:
        assert (said == "worse").any() and (said == "better").any()


def test_a_lost_run_is_counted_once():
    """Who diverges never settles either; and what the base never settles is not won by that."""
    twenty = chosen(20)
    found = compared(rows(), rows(diverged=twenty))
    assert of(found, "never_settled").candidate == 0 and found.newly_lost == 20
    found = compared(rows(never_settled=twenty), rows(diverged=twenty))
    assert (of(found, "never_settled").base, of(found, "diverged").candidate) == (0, 20)
    assert found.verdict == "worse"


def test_a_run_is_lost_that_is_so_in_one_parameter():
    ten = rows(never_settled=chosen(10))
    for row in ten:
        row["never_settled"] &= row["parameter"] == "f_m"
    found = compared(rows(), ten)
    assert of(found, "never_settled").candidate == 10 and found.verdict == "worse"


def test_the_same_runs_lost_on_both_sides_are_no_difference_but_said():
    lost = chosen(6)
    found = compared(rows(diverged=lost), rows(diverged=lost))
    assert of(found, "diverged").verdict == "not more" and found.verdict == "same"
    assert "the same 6 of 32 runs diverge on both sides" in headline(found)


def test_without_a_run_that_both_finished_nothing_is_the_same():
    found = compared(rows(diverged=RUNS), rows(diverged=RUNS))
    assert found.verdict == "undecided" and of(found, "lag").pairs == 0
    assert "Hardly a run is left" in meaning(found)
    half = [run for run in RUNS if run[1] < 1004]
    other = [run for run in RUNS if run[1] >= 1004]
    found = compared(rows(diverged=half), rows(diverged=other))
    assert found.verdict == "undecided" and found.status(strict=True) == 3


def test_as_many_won_as_lost_is_never_better_or_same():
    found = compared(rows(diverged=chosen(1, seed=1)), rows(diverged=chosen(1, seed=2)))
    assert found.verdict == "undecided" and found.newly_lost == 0 and found.status() == 0


def test_fewer_lost_is_better_where_it_is_sure():
    assert compared(rows(diverged=chosen(11)), rows()).verdict == "better"
    assert compared(rows(diverged=chosen(10)), rows()).verdict == "same"


def test_one_of_each_way_are_two():
    found = compared(rows(), rows(diverged=RUNS[:1], never_settled=RUNS[1:2]))
    assert found.newly_lost == 2 and found.status() == 3
    assert headline(found).startswith("undecided: 1 of 32 runs newly diverge, 1 of 32 runs newly")


def test_where_runs_are_lost():
    found = of(compared(rows(), rows(diverged=[("t", 1003), ("v", 1001)])), "diverged")
    assert found.by_scenario == {"t": (1, 0), "v": (1, 0)}
    assert (found.worst_scenario, found.worst_seed) == ("t", 1003)


def test_the_number_of_runs_that_would_decide():
    """2 of 32 lost: the first number of which so many are ten."""
    needed = runs_needed(2, 0, 32, 0.0015)
    assert round(2 * needed / 32) == 10 and round(2 * (needed - 1) / 32) == 9
