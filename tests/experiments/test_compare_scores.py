"""What is compared of a score: ratios, differences where it may be 0, errors about their mean."""

import numpy as np
import pytest

from flexaxis.experiments.gate.gate import Comparison
from flexaxis.experiments.gate.pairs import pair, parse_margins, table
from flexaxis.experiments.gate.verdicts import judge
from flexaxis.experiments.gate.wording import cells, headline, ordered

SEEDS = range(1000, 1032)


def side(seed=0, *, bias=0.0, slow=0.3, quick=0.5, **more):
    """Rows of 32 runs: an error with a mean, what is slower than the window, and what is not."""
    rng = np.random.default_rng(seed)
    means = bias + slow * rng.standard_normal(32)
    within = quick**2 * rng.chisquare(40, 32) / 40
    return [
        {
            "scenario": "s", "seed": seed, "parameter": "f_m", "lag": 1.0, "diverged": False,
            "never_settled": False, "bias": float(b), "std": float(np.sqrt(w + b**2)),
        } | {name: float(values[k]) for name, values in more.items()}
        for k, (seed, b, w) in enumerate(zip(SEEDS, means, within, strict=True))
    ]  # fmt: skip


def found_of(base, candidate, *margins):
    wanted = parse_margins(list(margins))
    paired = pair(table(base), table(candidate), wanted)
    return Comparison("a", "b", list(SEEDS), 1, 1, 0.01, judge(paired, wanted))


def verdict(found, metric):
    (one,) = (v for v in found.verdicts if v.metric == metric)
    return one


def test_a_deviation_is_about_the_common_mean_with_the_bias_beside_it():
    """A bias of 37 % beside a deviation of 13 %: the rms about zero, 39 %, is neither."""
    base, candidate = side(slow=5, quick=12), side(1, bias=37, slow=5, quick=12)
    std = verdict(found_of(base, candidate), "std")
    rms = np.sqrt(np.mean([row["std"] ** 2 for row in candidate]))
    assert rms == pytest.approx(39, rel=0.03)
    for value, rows, mean in zip(
        (std.base, std.candidate), (base, candidate), std.bias, strict=True
    ):
        bias = np.array([row["bias"] for row in rows])
        each = np.sqrt([row["std"] ** 2 - 2 * bias.mean() * row["bias"] + bias.mean() ** 2
                        for row in rows])  # fmt: skip
        assert mean == pytest.approx(bias.mean())
        assert value == pytest.approx(np.exp(np.log(each).mean()))
    assert std.candidate == pytest.approx(13, rel=0.05)
    assert "bias 3" in cells(std)[3] and "%" in cells(std)[3]


def test_a_bias_that_has_grown_is_worse_though_the_deviation_is_the_same():
    base, candidate = side(), side(bias=-0.6)
    found = found_of(base, candidate)
    assert found.verdict == "worse" and verdict(found, "std").verdict == "same"
    bias = verdict(found, "bias")
    assert bias.verdict == "worse" and bias.unit == "%"
    before, after = (abs(np.mean([r["bias"] for r in rows])) for rows in (base, candidate))
    assert bias.change == pytest.approx(after - before)
    assert "bias worse" in headline(found)
    assert bias.margin == pytest.approx(0.2 * np.sqrt(np.mean([r["std"] ** 2 for r in base])))


@pytest.mark.parametrize("candidate", [{"bias": 0.02}, {"seed": 1}, {}])
def test_a_bias_has_no_say_unless_it_is_worse(candidate):
    found = found_of(side(), side(**candidate))
    assert verdict(found, "bias").verdict == "not more"
    assert all(v.metric != "bias" for v in ordered(found.verdicts))
    better = found_of(side(bias=0.6), side())
    assert better.verdict == "same" and verdict(better, "bias").verdict == "not more"


def test_what_may_be_zero_is_compared_by_its_difference():
    """7e-6 % → .02 % is no change by 300 000 %, but by .02 % of nominal."""
    rng = np.random.default_rng(4)
    nothing, little = np.full(32, 7e-6), 0.02 + 0.001 * rng.standard_normal(32)
    found = found_of(
        side(cross_talk=nothing), side(cross_talk=little), "cross_talk=2%"
    )  # fmt: skip
    one = verdict(found, "cross_talk")
    assert one.unit == "%" and one.change == pytest.approx(little.mean() - 7e-6)
    assert one.margin == pytest.approx(1e-3)  # less is as good as none
    assert (one.base, one.candidate) == pytest.approx((7e-6, little.mean()))
    assert one.verdict == "worse" and "cross talk worse" in headline(found)
    assert "Δ +0.02 %" in headline(found) and cells(one)[4] == "Δ +0.02 %"


def test_a_difference_that_is_as_good_as_none_is_the_same():
    rng = np.random.default_rng(4)
    noise = 1e-5 * rng.standard_normal(32)
    found = found_of(
        side(cross_talk=np.zeros(32)), side(cross_talk=5e-4 + noise), "cross_talk=2%"
    )  # fmt: skip
    assert verdict(found, "cross_talk").verdict == "slight"
    never = found_of(side(t10=np.zeros(32)), side(t10=np.zeros(32)), "t10=10%")
    assert verdict(never, "t10").verdict == "same" and verdict(never, "t10").unit == "s"


def test_what_is_never_zero_is_compared_by_ratios():
    lag = verdict(found_of(side(), [row | {"lag": 1.5} for row in side()]), "lag")
    assert lag.unit is None and lag.change == pytest.approx(0.5)
