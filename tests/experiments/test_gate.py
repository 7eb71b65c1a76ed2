"""The gate: its rules beside textbook tests, its words, and what it does with missing runs."""

import math

import numpy as np
import pytest
from scipy import stats

from flexaxis.experiments.gate.gate import Comparison, check_margins, look_seeds
from flexaxis.experiments.gate.pairs import pair, table
from flexaxis.experiments.gate.report import as_dict, markdown
from flexaxis.experiments.gate.verdict import ALPHA, SHARES, decide, judge, judge_lost, losses
from flexaxis.experiments.scoring.intervals import sign_p

SEEDS = range(1000, 1032)
STEP = -math.log(0.95)


def judged(changes):
    """Judge scores (S, n) of one metric, one a scenario."""
    n = len(changes)
    names = np.array([str(i) for i in range(n)])
    return decide(np.asarray(changes), names, np.array(["lag"] * n), np.full(n, 0.02))


def words(changes):
    return judged(changes)["verdict"].tolist()


def side(seed=0, *, bias=0.0, seeds=SEEDS, scenario="s", **more):
    """Rows of an estimator: an error with a mean, what is slower than the window, what is not."""
    rng, n = np.random.default_rng(seed), len(seeds)
    means = bias + 0.3 * rng.standard_normal(n)
    within = 0.25 * rng.chisquare(40, n) / 40
    base = {"scenario": scenario, "parameter": "f_m", "lag": 1.0, "changed": True}
    std = np.sqrt(within + means**2)
    rows = [
        base | {"seed": s, "bias": b, "std": d} for s, b, d in zip(seeds, means, std, strict=True)
    ]
    return [
        row | {k: np.broadcast_to(v, n)[i] for k, v in more.items()} for i, row in enumerate(rows)
    ]


def compared(base, candidate, **margins):
    paired = pair(table(base), table(candidate), check_margins(margins))
    about = (judge(paired), losses(paired), paired, check_margins(margins))
    return Comparison("a", "b", list(SEEDS), *about)


def row(comparison, metric):
    (one,) = comparison.rows[comparison.rows["metric"] == metric].to_dict("records")
    return one


def textbook(changes, alpha, margin):
    """SciPy's t test, Holm by sorting, SciPy's interval at the level found."""
    tests = [stats.ttest_1samp(x, 0.0) for x in changes]
    order = sorted(range(len(tests)), key=lambda i: tests[i].pvalue)
    said, level, going = {}, 0.0, True
    for rank, i in enumerate(order):
        level = alpha / (len(order) - rank) if going else level
        going = going and tests[i].pvalue <= level
        low, high = tests[i].confidence_interval(1 - level)
        inside = -margin < low and high < margin
        same = "same" if low <= 0 <= high else "slight"
        beyond = "worse" if low > margin else "better" if high < -margin else "undecided"
        said[i] = same if inside else beyond
    return [said[i] for i in range(len(tests))]


def test_words_are_those_of_the_textbook():
    """30 comparisons of scores of all kinds, so many pairs that none are too few."""
    rng, seen = np.random.default_rng(3), set()
    for _ in range(30):
        means = rng.choice([0.0, 0.01, 0.02, 0.03, -0.03, 0.06], (5, 1))
        x = means + rng.choice([0.005, 0.03], (5, 1)) * rng.normal(size=(5, 200))
        assert words(x) == textbook(x, SHARES[False] * ALPHA, math.log(1.02))
        seen |= {*words(x)}
    assert seen == {"worse", "better", "slight", "same", "undecided"}


def test_an_interval_over_few_pairs_is_student_s():
    x = np.random.default_rng(2).normal(0.3, 0.1, 6)
    (found,) = judged(x[None]).to_dict("records")
    ends = stats.ttest_1samp(x, 0.0).confidence_interval(1 - SHARES[False] * ALPHA)
    assert (found["low"], found["high"]) == pytest.approx(tuple(ends))


def test_a_small_change_takes_many_runs():
    """On 0.9³² = 3.4 % of 32 runs, a failure of every tenth run does not show."""
    one = judged(np.full((1, 32), -STEP))
    assert one["verdict"][0] == "undecided" and one["reason"][0] == "few"
    assert words(np.full((1, 48), -STEP)) == ["better"]
    assert set(words(np.full((4, 32), -STEP))) == {"better"}  # 128 runs say so
    assert words(np.full((1, 8), -0.5)) == ["better"]  # a large one does not


@pytest.mark.parametrize("sign", [1, -1])
def test_rare_failures_seldom_deceive(sign):
    """5 % quicker on nine runs of ten, and slower by as much in all on one: no true change."""
    rng, wrong = np.random.default_rng(1), 0
    for _ in range(100):
        x = sign * np.where(rng.random((2, 32)) < 0.1, 9 * STEP, -STEP)
        wrong += bool({"worse", "better"} & {*words(x)})
    assert wrong <= 6  # 2 % and three binomial deviations; the t test alone errs in up to 43 %


def test_no_better_with_a_run_far_on_the_other_side():
    x = np.random.default_rng(0).normal(-0.1, 0.01, (4, 64))
    assert set(words(x)) == {"better"}
    x[2, 5] = math.log(1.5)
    found = judged(x)
    assert set(found["verdict"]) == {"undecided"} and set(found["reason"]) == {"far"}
    assert set(words(-x)) == {"worse"}  # one gain among so many failures hides none
    wide = np.random.default_rng(1).normal(-0.3, 0.3, (4, 128))  # where all scatter, none is far
    assert (wide > 0.2).any() and set(words(wide)) == {"better"}


@pytest.mark.parametrize("number", [5, 11, 40])
def test_an_equal_chance_of_losing_is_called_worse_or_better_seldom(number):
    """The exact chance over all ways in which so many one-sided losses fall."""
    newly = np.arange(number + 1)
    said = [judge_lost(int(k), number - int(k), "diverged") for k in newly]
    chance = stats.binom.pmf(newly, number, 0.5)
    for word, level in (("worse", 0.0015), ("better", 0.0005)):
        assert sum(c for c, w in zip(chance, said, strict=True) if w == word) <= level
    assert sign_p(7, 3) == pytest.approx(stats.binomtest(7, 10, alternative="greater").pvalue)


@pytest.mark.parametrize(
    ("lost", "word", "status"),
    [(22, "worse", 1), (10, "worse", 1), (9, "undecided", 3), (2, "undecided", 3),
     (1, "undecided", 0), (0, "same", 0)],
)  # fmt: skip
@pytest.mark.parametrize("way", ["diverged", "never_settled"])
def test_lost_runs(way, lost, word, status):
    found = compared(side(), side(**{way: np.arange(32) < lost}))
    assert (found.verdict, found.status()) == (word, status)
    assert next(each for each in found.lost if each.way == way).newly == lost
    other = compared(side(**{way: np.arange(32) < lost}), side())
    assert other.verdict == ("better" if lost > 10 else "same")


def test_a_lost_run_counts_once_and_has_no_pair():
    gone = np.arange(32) < 20
    found = compared(side(never_settled=gone), side(diverged=gone, never_settled=gone))
    assert found.lost[1].candidate == 0 and found.verdict == "worse"
    assert row(found, "lag")["pairs"] == 12
    alike = compared(side(diverged=gone), side(diverged=gone))
    assert alike.verdict == "same" and as_dict(alike)["headline"] == "SAME: 2 of 2 scores"
    assert compared(side(diverged=True), side(diverged=True)).verdict == "undecided"


def test_a_deviation_is_about_the_common_mean_and_a_grown_bias_is_worse():
    base, candidate = side(), side(bias=-0.6)
    found = compared(base, candidate)
    std, bias = row(found, "std"), row(found, "bias")
    mean = np.mean([r["bias"] for r in candidate])
    about = [np.sqrt(r["std"] ** 2 - 2 * mean * r["bias"] + mean**2) for r in candidate]
    assert std["candidate"] == pytest.approx(stats.gmean(about)) and std["verdict"] == "same"
    before, after = (abs(np.mean([r["bias"] for r in rows])) for rows in (base, candidate))
    assert bias["verdict"] == found.verdict == "worse"
    assert bias["change"] == pytest.approx(after - before)
    assert bias["scale"] == pytest.approx(np.sqrt(np.mean([r["std"] ** 2 for r in base])))
    assert row(compared(candidate, base), "bias")["verdict"] == "not more"


def test_what_is_as_good_as_nothing_counts_as_the_least_that_matters():
    little = 0.02 + 0.001 * np.random.default_rng(4).standard_normal(32)
    found = compared(side(cross_talk=7e-6), side(cross_talk=little), cross_talk=0.02)
    one = row(found, "cross_talk")
    assert one["change"] == pytest.approx(stats.gmean(little) / 1e-3 - 1)
    assert one["base"] == pytest.approx(1e-3) and one["verdict"] == "worse"
    assert row(compared(side(), side(lag=1.5)), "lag")["change"] == pytest.approx(0.5)


def test_the_verdict_comes_first_and_large_changes_are_ratios():
    scatter = np.exp(0.3 * np.random.default_rng(0).standard_normal(32))
    content = as_dict(compared(side(), side(lag=17 * scatter)))
    assert content["headline"] == "WORSE: lag of f_m on s is 16 times longer (14–18), same noise"
    (lag,) = (r for r in content["rows"] if r["metric"] == "lag")
    assert lag["text"][4:] == ["16 times", "14 … 18 times", "worse"]
    assert content["rows"][0] == lag
    assert len(content["legend"]) <= 5
    text = markdown(content)
    assert text.index("WORSE") < text.index("| scenario") < text.index(content["legend"][0])
    assert as_dict(compared(side(), side()))["headline"] == "SAME: 2 of 2 scores"
    quick = as_dict(compared(side(), side(lag=0.7 * scatter)))
    assert quick["headline"].startswith("BETTER: lag of f_m on s is 33 % shorter (24–41)")
    assert not quick["advice"]
    noisy = [r | {"std": 2 * r["std"], "lag": 0.5} for r in side()]
    for sides in ((side(), noisy), (noisy, side())):
        (advice,) = as_dict(compared(*sides))["advice"]
        assert "--match-std" in advice


def test_what_one_side_lacks_is_never_the_same():
    both = side() + side(scenario="t")
    candidate_lacks, base_lacks = compared(both, side()), compared(side(), both)
    assert (candidate_lacks.verdict, candidate_lacks.status()) == ("undecided", 3)
    assert (base_lacks.verdict, base_lacks.status()) == ("undecided", 0)
    assert "candidate has 32 missing runs on t" in as_dict(candidate_lacks)["headline"]
    more = side(seeds=range(1000, 1040))
    some = compared(more, more[:32])  # seeds of one side alone
    assert not some.paired.gaps and some.verdict == "same"


def test_a_changed_parameter_that_the_candidate_does_not_estimate():
    more = [r | {"parameter": "k_T"} for r in side()]
    found = compared(side() + more, more)
    assert found.verdict == "undecided" and found.paired.gaps[0].text.endswith("f_m on s")
    assert "the base also estimates f_m" in as_dict(found)["advice"][0]
    with pytest.raises(ValueError, match="fewer than 2 runs in common"):
        compared(side(), more)


def test_failed_cases_are_lost_runs():
    """A failed case has rows of all parameters; the others say what is estimated."""
    failed = {"failed": np.arange(32) < 1, "diverged": np.arange(32) < 1}
    found = compared(side(), side(**failed))
    assert (found.verdict, found.status()) == ("undecided", 3)
    assert found.paired.failed == {"base": 0, "candidate": 1}
    most = np.arange(32) < 27
    assert compared(side(), side(failed=most, diverged=most)).verdict == "worse"


def test_looks_are_fixed_beforehand():
    looks = look_seeds(range(1000, 1008), 40)
    assert [len(look) for look in looks] == [8, 16, 32, 40] and looks[-1][-1] == 1039
    assert look_seeds(range(8), 0) == [list(range(8))]
    for seeds, most in ((range(1), 0), (range(8), 4)):
        with pytest.raises(ValueError, match=r"at least 2 seeds.*--max-seeds"):
            look_seeds(seeds, most)
