"""Some hundred pooled numbers, calculated again from the rows by the textbook."""

import math
import statistics

import pytest
from engine_cases import nested
from scipy import stats

from flexaxis.experiments.files import summary_of
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.studies.benchmark import run

RAISES = """
class Raises:
    names, output = ("k_T", "f_m"), "speed"

    def __init__(self, nominal, period):
        self.k, self.theta = 0, [nominal["k_T"], nominal["f_m"]]

    def step(self, u, y):
        self.k += 1
        if self.k == 1500 and y > 0:
            raise ArithmeticError("not sure")
        self.theta[1] *= 1 + 1e-5 * y
        return list(self.theta)
"""


def mean_t(values):
    """Mean with Student's interval, from scipy's own."""
    low, high = stats.t.interval(0.95, len(values) - 1, statistics.fmean(values), stats.sem(values))
    return statistics.fmean(values), low, high


def hall(values):
    """Hall's interval (1992), by a search in place of the cube root in closed form."""
    n, mean, sd = len(values), statistics.fmean(values), statistics.stdev(values)
    g = statistics.fmean((x - mean) ** 3 for x in values) / statistics.pstdev(values) ** 3
    quantile = stats.t.ppf(0.975, n - 1)

    def transformed(s):
        return math.sqrt(n) * (s + g * s**2 / 3 + g**2 * s**3 / 27 + g / (6 * n))

    def root(wanted):
        low, high = -1e3, 1e3
        for _ in range(200):
            middle = (low + high) / 2
            low, high = (middle, high) if transformed(middle) < wanted else (low, middle)
        return low

    return mean - sd * root(quantile), mean - sd * root(-quantile)


def again(rows):
    """What a pooled row of these rows must say, as far as the textbook goes."""

    def values(name):
        return [row[name] for row in rows if row[name] is not None]

    found: dict = {"runs": len(rows), "seeds": len({row["seed"] for row in rows})}
    for name in ("diverged", "failed"):
        found[name] = sum(values(name))
    for name in ("bias", "score", "lag_bound", "lag_null", "nees", "nis"):
        if each := values(name):
            found[name] = statistics.fmean(each)
            if name in {"bias", "score"} and statistics.pstdev(each) > 1e-9:
                found[f"{name}_interval"] = hall(each)
    if lags := values("lag"):
        logs = [math.log(lag) for lag in lags]
        found["lag"] = statistics.geometric_mean(lags)
        if statistics.pstdev(lags) > 1e-9:
            found["lag_interval"] = [math.exp(end) for end in mean_t(logs)[1:]]
        t10 = [math.inf if row["t10"] is None else row["t10"] for row in rows]
        middle = statistics.median(t10)
        found["t10"] = middle if math.isfinite(middle) else math.inf
    if talk := values("cross_talk"):
        found["cross_talk"] = math.sqrt(statistics.fmean(x**2 for x in talk))
    kept = [row for row in rows if not row["lost_before"]]
    gone = sum(row["std"] ** 2 for row in rows if row["lost_before"])
    square = sum(row["std"] ** 2 for row in kept)
    common = statistics.fmean(row["bias"] for row in kept) if kept else 0.0
    variance = (square - len(kept) * common**2 + gone) / len(rows)
    found["std"] = math.sqrt(max(0.0, variance))
    return found


@pytest.mark.slow
def test_a_hundred_pooled_numbers_are_what_the_rows_say(short, tmp_path):
    (tmp_path / "own.py").write_text(RAISES)
    late = short.override({"name": "late", "fault[0].factor": 0.6, "start": 1.1})
    names = ("rpem-forgetting", "frozen", f"{tmp_path}/own.py:Raises")
    study = Study("t", (short, late), names, tuple(range(1000, 1007)))
    with Runner(tmp_path / "out") as runner:
        found = run(study, runner)
    rows = nested(Results.load(tmp_path / "out").frame)
    compared = 0
    for pooled in summary_of(found.folder)["rows"]:
        key = ("scenario", "estimator", "parameter", "changed")
        mine = [row for row in rows if all(row[k] == pooled[k] for k in key)]
        for name, wanted in again(mine).items():
            said = math.inf if pooled[name] is None else pooled[name]
            # A difference of squares keeps half the digits: 1e-8 of a bias of some per cent.
            rounding = 1e-6 if name == "std" else 1e-9
            assert said == pytest.approx(wanted, rel=1e-9, abs=rounding), (pooled, name)
            compared += 2 if name.endswith("_interval") else 1
    assert compared > 100
    assert {row["failed"] for row in summary_of(found.folder)["rows"]} > {0}
