"""The gate on itself: how often it raises a false alarm, and what it finds.

A pool of runs is made once; comparisons are drawn from it. Under the null both sides are the same
estimator on records of their own, and change sides by chance, so that neither can be better.
"""

import numpy as np
import pytest
from scipy import stats

import flexaxis as fx
from flexaxis.experiments.gate.pairs import Paired, pair, table
from flexaxis.experiments.gate.verdict import decide, judge_lost
from flexaxis.experiments.scoring.score_table import MARGINS

pytestmark = pytest.mark.slow

COMPARISONS, POOL, SIZE = 2000, 48, 16  # 16 of 48 seeds on 4 scenarios: 64 runs
CLOSE = "rpem-forgetting[forgetting=0.99525]"


def paired(base, candidate):
    return pair(table(base), table(candidate), MARGINS)


@pytest.fixture(scope="module")
def frame():
    texts = ["rpem-forgetting", CLOSE]
    run = fx.benchmark(texts, scenarios="gate", seeds=range(1000, 1000 + 2 * POOL), jobs=2)
    return run.to_dataframe().reset_index()


@pytest.fixture(scope="module")
def null(frame):
    """The reference paired with itself on other records."""
    own = frame[frame["estimator"] == "rpem-forgetting"]
    again = own[own["seed"] >= 1000 + POOL]
    return paired(own[own["seed"] < 1000 + POOL], again.assign(seed=again["seed"] - POOL))


def drawn(pool, random, *, swap=True, lose=(0.0, 0.0)):
    """Return the words on one comparison of some seeds of the pool."""
    about = [pool.scores[name].to_numpy() for name in ("scenario", "metric", "margin")]
    seeds, (names, place) = (
        random.permutation(POOL)[:SIZE],
        np.unique(about[0], return_inverse=True),
    )
    sign = np.where(swap & (random.random((len(names), SIZE)) < 0.5), -1, 1)
    base, candidate = (random.random((len(names), SIZE)) < share for share in lose)
    changes = np.stack(pool.scores["changes"])[:, seeds] * sign[place]
    changes[(base | candidate)[place]] = np.nan
    newly, regained = np.sum(candidate & ~base), np.sum(base & ~candidate)
    lost = judge_lost(int(newly), int(regained), "diverged")
    return {lost, *decide(changes, *about)["verdict"]}


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_false_alarms(null, share):
    """At most 1 %, with an upper 95 % limit below 2 %, with and without lost runs."""
    random = np.random.default_rng(0)
    words = [drawn(null, random, lose=(share, share)) for _ in range(COMPARISONS)]
    count = sum(bool({"worse", "better"} & each) for each in words)
    upper = stats.binomtest(count, COMPARISONS).proportion_ci(0.95).high
    print(f"{100 * share:g} % of runs lost: {count} of {COMPARISONS} false, at most {upper:.2%}")
    assert count <= 0.01 * COMPARISONS and upper < 0.02


@pytest.mark.parametrize(("longer", "least"), [(0.05, 0.95), (0.10, 0.99)])
def test_a_lag_that_is_longer_is_called_worse(frame, longer, least):
    """Pairs scatter as those of a close setting; their mean is shifted to the planted change."""
    both = paired(*(frame[frame["estimator"] == text] for text in ("rpem-forgetting", CLOSE)))
    lag = both.scores["metric"] == "lag"
    moved = [x - lag[i] * (x.mean() - np.log1p(longer)) for i, x in both.scores["changes"].items()]
    planted, random = Paired(both.scores.assign(changes=moved), both.lost), np.random.default_rng(1)
    count = sum("worse" in drawn(planted, random, swap=False) for _ in range(500))
    print(f"lag {longer:.0%} longer: called worse in {count} of 500")
    assert count >= least * 500
