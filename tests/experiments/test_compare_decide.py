"""The rules of the verdict on ratios with a known truth, many comparisons at a time."""

import math

import numpy as np
import pytest
from scipy import stats

from flexaxis.experiments.gate import decide as rules
from flexaxis.experiments.gate.decide import Family, decide, far_pairs, overall

STEP = -math.log(0.95)


def family(scenarios=4, metric="lag"):
    names = [str(i) for i in range(scenarios)]
    return Family.of(names, [metric] * scenarios, [0.02] * scenarios)


def normal(mean, sd, *, scenarios=4, seeds=32, comparisons=1, seed=0):
    random = np.random.default_rng(seed)
    return random.normal(mean, sd, (comparisons, scenarios, seeds))


def words(ratios, **options):
    return decide(ratios, family(ratios.shape[1]), **options).words


@pytest.mark.parametrize(
    ("mean", "sd", "word"),
    [
        (0.05, 0.01, "worse"),
        (-0.05, 0.01, "better"),
        (0.01, 0.002, "slight"),  # surely there, surely less than what matters
        (-0.01, 0.002, "slight"),
        (0.0, 0.01, "same"),
        (0.02, 0.01, "undecided"),  # surely there, but perhaps less than what matters
        (0.05, 0.2, "undecided"),
    ],
)
def test_five_words(mean, sd, word):
    ratios = normal(mean, sd)
    ratios += mean - ratios.mean(axis=2, keepdims=True)
    assert set(words(ratios)[0]) == {word}


def textbook(ratios, alpha, margin):
    """One comparison: SciPy's t test, Holm by sorting, SciPy's interval at the level found."""
    tests = [stats.ttest_1samp(score, 0.0) for score in ratios]
    order = sorted(range(len(tests)), key=lambda i: tests[i].pvalue)
    said, level = {}, 0.0
    going = True
    for rank, i in enumerate(order):
        level = alpha / (len(order) - rank) if going else level
        going = going and tests[i].pvalue <= level
        low, high = tests[i].confidence_interval(1 - level)
        if low > margin:
            said[i] = "worse"
        elif high < -margin:
            said[i] = "better"
        elif -margin < low and high < margin:
            said[i] = "same" if low <= 0 <= high else "slight"
        else:
            said[i] = "undecided"
    return [said[i] for i in range(len(tests))]


def test_words_are_those_of_the_textbook():
    """500 comparisons of scores of all kinds, so many pairs that none are too few."""
    random = np.random.default_rng(3)
    means = random.choice([0.0, 0.01, 0.02, 0.03, -0.03, 0.06], (500, 5, 1))
    ratios = means + random.choice([0.005, 0.03], (500, 5, 1)) * random.normal(size=(500, 5, 200))
    found = decide(ratios, family(5))
    margin, alpha = math.log(1.02), rules.SHARES["scores"] * rules.ALPHA
    assert not found.few.any() and not found.far.any()
    assert np.array_equal(found.words, [textbook(one, alpha, margin) for one in ratios])
    assert set(found.words.ravel()) == {"worse", "better", "slight", "same", "undecided"}


def test_what_is_equal_on_every_seed_costs_the_others_nothing():
    """The encoder scenario has no noise: its scores cannot differ, and are no members."""
    ratios = normal(0.05, 0.06, scenarios=3)
    padded = np.concatenate([ratios, np.zeros((1, 20, 32))], axis=1)
    alone, together = decide(ratios, family(3)), decide(padded, family(23))
    np.testing.assert_array_equal(alone.level, together.level[:, :3])
    assert set(together.words[0, 3:]) == {"same"}


def test_guards_cost_the_scores_nothing():
    """A bias has a say where it is worse, and an error of its own: as many as there are scores."""
    scores = normal(0.05, 0.06, scenarios=3)
    with_biases = Family.of(list("abc") * 2, ["lag"] * 3 + ["bias"] * 3, [0.02] * 3 + [0.2] * 3)
    ratios = np.concatenate([scores, normal(0.0, 0.06, scenarios=3)], axis=1)
    np.testing.assert_array_equal(
        decide(ratios, with_biases).level[:, :3], decide(scores, family(3)).level
    )
    assert sum(rules.SHARES.values()) == pytest.approx(1)


def test_a_small_change_needs_many_runs():
    """5 % on each of 32 runs: on .9³² = 3.4 % of such, a failure of every tenth run is not seen."""
    one = np.full((1, 1, 32), -STEP)
    assert decide(one, family(1)).few.all() and words(one)[0, 0] == "undecided"
    assert words(np.full((1, 1, 64), -STEP))[0, 0] == "better"
    assert set(words(np.full((1, 4, 32), -STEP))[0]) == {"better"}  # 128 runs say so
    assert words(np.full((1, 1, 8), -0.5))[0, 0] == "better"  # a large one does not


def test_runs_count_once_for_all_parameters_and_only_where_they_agree():
    two = Family.of(["a", "a"], ["std", "std"], [0.02, 0.02])
    assert decide(np.full((1, 2, 8), 0.3), two).support.tolist() == [[8, 8]]
    mixed = np.stack([np.full(8, 0.3), np.full(8, -0.3), np.full(8, 0.3)])[None]
    found = decide(mixed, family(3))
    assert found.support.tolist() == [[16, 8, 16]] and found.choices.tolist() == [[3, 3, 3]]


def test_no_better_with_a_run_far_on_the_other_side():
    ratios = normal(-0.1, 0.01, seeds=64)
    assert set(words(ratios)[0]) == {"better"}
    ratios[0, 2, 5] = math.log(1.5)
    found = decide(ratios, family())
    assert set(found.words[0]) == {"undecided"} and found.far.all()  # in the whole metric
    assert far_pairs(ratios, found.n).sum() == 1
    assert set(words(-ratios)[0]) == {"worse"}  # one gain among so many failures hides none
    ratios = -normal(-0.1, 0.01, seeds=64)
    ratios[0, 2, 5] = 1.0
    assert set(words(ratios)[0]) == {"worse"}  # nor does a worse one among the worse


def test_far_is_told_from_the_scatter():
    """Among scores that scatter by 30 %, a pair at +50 % is one of them."""
    ratios = normal(-0.3, 0.3, seeds=128, seed=1)
    assert (ratios > rules.FAILED).any() and set(words(ratios)[0]) == {"better"}


def test_far_pairs_are_those_of_numpys_median():
    """Of few pairs, odd and even in number, where the two middle ones are far apart."""
    ratios = normal(0.0, 0.5, seeds=6, comparisons=500) ** 3
    ratios[:, ::2, 4] = np.nan
    off = ratios - np.nanmedian(ratios, axis=2, keepdims=True)
    scatter = np.nanmedian(abs(off), axis=2, keepdims=True)
    textbook = (ratios > 0.2) & (off > 4 * 1.4826 * scatter)
    np.testing.assert_array_equal(far_pairs(ratios, np.isfinite(ratios).sum(axis=2)), textbook)


def rare(sign, shape, seed=0):
    """Mean zero: 5 % quicker on nine runs of ten, and so much slower on one (or the mirror)."""
    failed = np.random.default_rng(seed).random(shape) < 0.1
    ratios = np.where(failed, 9 * STEP, -STEP)
    return sign * ratios


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("scenarios", [1, 4])
@pytest.mark.parametrize("seeds", [8, 16, 24, 30, 32, 48, 64])
def test_rare_failures_seldom_deceive(sign, scenarios, seeds):
    """2000 comparisons without a true change: ≤ 2 %; the t test alone errs in up to 43 %."""
    found = words(rare(sign, (2000, scenarios, seeds)))
    assert np.isin(found, ["worse", "better"]).any(axis=1).mean() <= 0.02


def test_a_true_change_within_the_margin_is_seldom_called_worse():
    """Of 2000 comparisons, 1.5 % where 2 % matters; by the point estimate it is half of them."""
    ratios = normal(math.log(1.015), 0.02, seeds=8, comparisons=2000)
    point = (np.mean(ratios, axis=2) > math.log(1.02)).any(axis=1)
    assert point.mean() > 0.4 and (words(ratios) == "worse").any(axis=1).mean() <= 0.01


def test_false_alarms_of_scores_keep_their_share():
    """4000 families without a change and a margin of next to nothing: 0.6 %, with 95 % ≤ 0.9."""
    ratios = normal(0.0, 1.0, scenarios=8, comparisons=4000)
    tiny = Family.of([str(i) for i in range(8)], ["lag"] * 8, [1e-9] * 8)
    found = decide(ratios, tiny)
    assert ((found.low > 0) | (found.high < 0)).any(axis=1).mean() <= 0.009


def test_one_word_for_all():
    none = np.empty((1, 0), str)

    def said(*words, lost=()):
        counts = np.array([lost]) if lost else none
        return overall(np.array([words]), counts)[0]

    assert said("same", "better") == "better" and said("same") == "same"
    assert said("same", "slight") == "slight" and said("better", "slight") == "better"
    assert said("better", "undecided") == "undecided"
    assert said("undecided", "worse", "better") == "worse"
    assert said("better", lost=["undecided"]) == "undecided"
    assert said("same", lost=["not more"]) == "same"
    assert overall(none, np.array([["not more"]]))[0] == "undecided"  # nothing to be the same
