"""Verdicts on made-up scores whose right answer is known; the sequential gate."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine_cases import BenchHere

from flexaxis.experiments.comparison.statistics import half_width
from flexaxis.experiments.gate.gate import Comparison, Question, compare
from flexaxis.experiments.gate.pairs import pair, parse_margins, table
from flexaxis.experiments.gate.report import markdown, write
from flexaxis.experiments.gate.verdicts import by_metric, judge
from flexaxis.experiments.gate.wording import cells, headline, meaning, row_command, worst
from flexaxis.experiments.scoring.score_table import MARGINS
from flexaxis.sim.errors import FlexaxisError

sys.path.insert(0, str(Path(__file__).parent))


def rows(scale=1.0, *, spread=0.005, seeds=8, seed=0, std=1.0, lost=(), parameter="f_m"):
    """Rows of one estimator on one scenario: lag about `scale`, lost on some seeds."""
    noise = np.random.default_rng(seed).normal(0, spread, (seeds, 2))
    return [
        {
            "scenario": "s",
            "hash": "h",
            "estimator": "e",
            "seed": k,
            "parameter": parameter,
            "lag": None if k in lost else scale * np.exp(noise[k, 0]),
            "std": None if k in lost else std * np.exp(noise[k, 1]),
            "diverged": k in lost,
            "never_settled": False,
        }
        for k in range(seeds)
    ]


def verdicts(base, candidate, **options):
    found = judge(pair(table(base), table(candidate), MARGINS), MARGINS, **options)
    return {v.metric: v for v in found}


@pytest.mark.parametrize(
    ("scale", "spread", "word"),
    [
        (1.6, 0.005, "worse"),
        (0.6, 0.005, "better"),
        (1.0, 0.003, "same"),
        (1.005, 0.0001, "slight"),  # sure, but too small to matter
        (1.05, 0.1, "undecided"),
        (1.05, 0.005, "undecided"),  # sure, but only 8 runs say so
    ],
)
def test_words_and_numbers(scale, spread, word):
    found = verdicts(rows(spread=spread), rows(scale, spread=spread, seed=1))["lag"]
    assert found.verdict == word and (found.reason == "few") == ((scale, spread) == (1.05, 0.005))
    assert (found.seeds_needed is not None) == (word == "undecided")
    assert found.interval[0] < found.change < found.interval[1]
    assert found.change == pytest.approx(scale - 1, abs=1.2 * spread)
    assert found.base == pytest.approx(1.0, abs=spread)  # geometric mean of the lags


def test_the_number_of_seeds_leaves_no_doubt():
    """ln(1/.01)/ln(1 + .051/.5) = 47.3 runs of a change of 5 %."""
    base = rows(spread=0.0)
    found = verdicts(base, [row | {"lag": 0.95} for row in base])["lag"]
    assert (found.verdict, found.seeds_needed) == ("undecided", 48)
    (few,) = cells(found)[-1:]
    # .5·(.01^(−1/8) − 1) = .389, and exp(−.389) = .678
    assert few == "undecided: 8 runs can say better from -32 % on; about 48 seeds would do"
    two = [row | {"scenario": name} for name in "st" for row in base]
    found = verdicts(two, [row | {"lag": 0.95} for row in two])["lag"]
    assert (found.verdict, found.seeds_needed) == ("undecided", 24)  # both say so


def test_the_number_of_seeds_reckons_with_what_fails_rarely():
    """Of 12 % at 3.5 % spread Student's t is soon sure; ln(1/.01)/ln(1 + .12/.5) = 21.4 runs."""
    base = [row | {"lag": 1.0} for row in rows(spread=0.0, seeds=4)]
    slower = [row | {"lag": np.exp(0.12 + 0.03 * (-1) ** row["seed"])} for row in base]
    found = verdicts(base, slower)["lag"]
    assert (found.verdict, found.reason, found.seeds_needed) == ("undecided", "", 22)
    two = [[row | {"scenario": name} for name in "st" for row in side] for side in (base, slower)]
    assert verdicts(*two)["lag"].seeds_needed == 11  # both will say so


@pytest.mark.parametrize(("mean", "sd"), [(0.6, 0.5), (0.004, 0.03), (-0.6, 0.5)])
def test_the_number_of_seeds_is_the_first_whose_interval_decides(mean, sd):
    base = [row | {"lag": 1.0} for row in rows(spread=0.0)]
    off = [row | {"lag": np.exp(mean + sd * (-1) ** row["seed"])} for row in base]
    n = verdicts(base, off)["lag"].seeds_needed
    gap = abs(abs(mean) - np.log1p(MARGINS["lag"]))  # beyond the margin, or within it, all of it
    within = [half_width(sd * np.sqrt(8 / 7), k, 0.005) < gap for k in (n - 1, n)]
    assert within == [False, True]


def test_seeds_that_no_one_has():
    base = [row | {"lag": 1.0} for row in rows(spread=0.0)]
    for change, sd, seeds in ((0.0198, 0.5, 8), (0.3, 0.0, 1)):
        off = [row | {"lag": np.exp(change + sd * (-1) ** row["seed"])} for row in base[:seeds]]
        found = verdicts(base[:seeds], off)["lag"]
        assert (found.verdict, found.seeds_needed) == ("undecided", None)


def test_a_far_run_is_named():
    base = rows(spread=0.0, seeds=64)
    candidate = [row | {"lag": 2.0 if row["seed"] == 7 else 0.8} for row in base]
    found = verdicts(base, candidate)["lag"]
    assert (found.verdict, found.reason, found.worst_seed) == ("undecided", "far", 7)
    assert "far on the other side" in cells(found)[-1]


def test_a_diverged_run_has_no_pair():
    found = verdicts(rows(), rows(lost=[1, 2]))
    assert (found["lag"].pairs, found["lag"].runs) == (6, 8)
    assert found["diverged"].worst_seed in (1, 2)
    stuck = [row | {"diverged": row["seed"] == 3} for row in rows()]
    stuck[3]["lag"] = 400.0  # scored as if at the edge of the box
    found = verdicts(rows(), stuck)
    assert found["lag"].pairs == 7 and found["lag"].verdict == "same"


def test_what_is_scored_on_one_side_only_stays_in_the_comparison():
    found = verdicts(rows(), rows(lost=range(8)))["lag"]
    assert (found.pairs, found.verdict, found.interval) == (0, "undecided", None)
    nowhere = [row | {"lag": None} for row in rows()]
    assert "lag" not in verdicts(nowhere, nowhere)  # of a parameter that did not change


def test_a_word_for_each_metric():
    found = list(verdicts(rows(), rows(0.5, std=1.6, seed=1)).values())
    silent = {"diverged": "not more", "never_settled": "not more"}
    assert by_metric(found) == silent | {"lag": "better", "std": "worse"}
    lag = next(v for v in found if v.metric == "lag")
    assert by_metric([lag, replace(lag, verdict="worse")]) == {"lag": "mixed"}


def comparison(base, candidate):
    found = list(verdicts(base, candidate).values())
    return Comparison("mine", "yours", list(range(8)), 1, 1, 0.01, found)


def test_the_headline_is_a_sentence_for_each_word():
    found = comparison(rows(), rows(0.5, std=1.6, seed=1))
    assert headline(found).startswith("worse: std worse in 1 of 1 score (f_m in s, +60 %), lag be")
    assert "A regression" in meaning(found)
    late = [row | {"never_settled": row["seed"] < 6} for row in rows(0.5, seed=1)]
    found = comparison(rows(), late)
    assert headline(found).startswith("undecided: 6 of 8 runs newly never settle, lag better in 1")
    assert meaning(found).startswith("6 runs newly lost: too many to pass, too few to be sure")
    assert "smaller than the margins" in meaning(comparison(rows(), rows()))


def test_numbers_have_units():
    found = {v.metric: cells(v) for v in verdicts(rows(), rows(1.6, seed=1)).values()}
    assert found["lag"][2].endswith(" s") and found["std"][3].endswith(" %")


def test_only_common_seeds_and_parameters_count():
    found = verdicts(rows(seeds=12), rows(seeds=8))
    assert found["lag"].runs == 8
    with pytest.raises(FlexaxisError, match=r"nothing in common.*f_m and k_T"):
        verdicts(rows(), rows(parameter="k_T"))


def test_margins():
    assert parse_margins(["lag=5%", "std=0.03,t10=10%"]) == {
        "lag": 0.05, "std": 0.03, "bias": 0.2, "t10": 0.1}  # fmt: skip


@pytest.mark.parametrize("text", ["lagg=2%", "lag", "lag=two", "lag=0", "lag=200%", "lag=nan"])
def test_wrong_margins(text):
    with pytest.raises(FlexaxisError, match="--margin"):
        parse_margins([text])


def test_looks_are_fixed_beforehand_and_share_the_error():
    question = Question("a", "b", [], range(1000, 1008), MARGINS, max_seeds=40)
    assert [len(seeds) for seeds in question.looks()] == [8, 16, 32, 40]
    assert question.looks()[-1] == list(range(1000, 1040))
    assert Question("a", "b", [], range(8), MARGINS).looks() == [list(range(8))]


def test_looking_again_does_not_raise_the_false_alarms():
    """Four looks at 4000 true nulls, alpha .05: at most 5 %; without sharing it is some 13 %."""
    random = np.random.default_rng(5)
    counts = [8, 16, 32, 64]
    wrong = {True: 0, False: 0}
    for _ in range(4000):
        values = random.normal(size=64)
        p = [gate_p(values[:n]) for n in counts]
        for shared in wrong:
            wrong[shared] += min(p) <= 0.05 / (len(counts) if shared else 1)
    assert wrong[True] / 4000 < 0.05 and wrong[False] / 4000 > 0.1


def gate_p(values):
    from flexaxis.experiments.comparison.statistics import summary, t_p

    return t_p(*summary(values))


class Made:
    """A bench with made-up scores; `asked` are the seeds that were."""

    def __init__(self, candidate):
        self.pool = {"a": rows(seeds=100, spread=0.1), "b": candidate}
        self.asked = []

    def with_failed(self, scenarios, names, seeds):
        self.asked.append(list(seeds))
        return {
            ("hash", name): [[row | {"estimator": name} for row in self.pool[name]
                              if row["seed"] in seeds]]
            for name in names
        }  # fmt: skip


def test_seeds_are_added_until_it_is_decided():
    bench = Made(rows(1.4, std=1.4, seeds=100, spread=0.1, seed=1))
    found = compare(Question("a", "b", [], range(8), MARGINS, max_seeds=64), bench)
    assert found.verdict == "worse" and found.look > 1 and found.looks == 4
    assert bench.asked[-1] == found.seeds and len(bench.asked) == found.look
    assert found.alpha == pytest.approx(0.01 / 4)
    assert found.status() == 1


def test_one_seed_is_refused():
    with pytest.raises(FlexaxisError, match="at least 2 seeds"):
        compare(Question("a", "b", [], [1], MARGINS), BenchHere())
    with pytest.raises(FlexaxisError, match="--max-seeds 4 is less than the 8 seeds"):
        compare(Question("a", "b", [], range(8), MARGINS, max_seeds=4), BenchHere())


def test_a_comparison_end_to_end(short, tmp_path):
    """On simulated records: 8 s with a fault at 6 s; λ = .98 is four times as fast and noisier."""
    fast = "rpem-forgetting[forgetting=0.98]"
    question = Question("rpem-forgetting", fast, [short], range(6), MARGINS)
    with BenchHere(tmp_path, traced=True) as bench:
        found = compare(question, bench)
    words = by_metric(found.verdicts)
    assert words["lag"] == "better" and words["std"] == "worse" and found.status() == 1
    page = write(tmp_path, found, [short], sources={"short": "my folder/short.toml"})
    text = page.read_text(encoding="utf-8")
    assert text.count('<svg role="img"') == 2 and " src=" not in text  # changes, the worst run
    assert "my folder/short.toml" in text and "<title>candidate</title>" in text
    assert "| short | std f_m |" in (tmp_path / "verdict.md").read_text(encoding="utf-8")
    focus = worst(found)
    assert focus.verdict == "worse" and focus.worst_seed in range(6)
    assert f"--seeds {focus.worst_seed}:{focus.worst_seed + 1}" in row_command(found, focus, {})
    assert json.loads((tmp_path / "compare.json").read_text())["verdict"] == "worse"


def test_an_estimator_is_the_same_as_itself(short):
    found = compare(
        Question("rpem-drift", "rpem-drift", [short], range(3), MARGINS), BenchHere()
    )
    assert found.verdict == "same" and "rpem-drift" in markdown(found)


def test_another_noise_on_the_same_run(short, tmp_path):
    """Same excitation, torque and motion; other noise, also in the cache of records."""
    from flexaxis.experiments.running.cache import RecordCache, records

    store = RecordCache(tmp_path)
    for _ in range(2):  # made, and read again
        (first,), (again,) = (records(short, [0], store, repeat=k)[0] for k in (0, 1))
        np.testing.assert_array_equal(first.torque, again.torque)
        np.testing.assert_array_equal(first.true_speed, again.true_speed)
        noises = np.array([r.speed - r.true_speed for r in (first, again)])
        # 1600 samples: a correlation of 4/√1600 would be four standard deviations
        assert abs(np.corrcoef(noises)[0, 1]) < 0.1
        assert noises.std(axis=1) == pytest.approx([0.1, 0.1], rel=0.1)


def test_who_does_not_estimate_what_changes_is_not_better():
    """Quieter in one parameter, and silent on the one that fails: nothing is said of that."""
    noise = np.random.default_rng(0).normal(0, 0.005, 32)

    def of(parameter, std, changed):
        return [
            {"scenario": "s", "seed": k, "parameter": parameter, "changed": changed,
             "lag": 1.0 if changed else None, "std": std * np.exp(noise[k]), "diverged": False,
             "never_settled": False}
            for k in range(32)
        ]  # fmt: skip

    base = table([*of("f_m", 1.0, True), *of("k_T", 1.0, False)])
    for rest, missing in (([], (("s", "f_m"),)), (of("f_m", 1.0, True), ())):
        paired = pair(base, table([*of("k_T", 0.5, False), *rest]), MARGINS)
        assert paired.missing == missing
        found = Comparison("a", "b", list(range(32)), 1, 1, 0.01, judge(paired, MARGINS),
                           paired)  # fmt: skip
        assert found.verdict == ("undecided" if missing else "better")
        assert ("f_m of s is not estimated" in headline(found)) == bool(missing)
        assert ("does not estimate all that changes (f_m)" in meaning(found)) == bool(missing)


def test_seeds_that_lost_runs_need_are_of_all_scenarios():
    """Twice as many scenarios, on which as large a share is lost, need half as many seeds."""
    one = rows(), rows(lost=[1, 2, 3])
    both = [side + [row | {"scenario": "t", "hash": "i"} for row in side] for side in one]
    needed = [verdicts(*sides)["diverged"].seeds_needed for sides in (one, both)]
    assert needed[0] and abs(needed[1] - needed[0] / 2) <= 1
