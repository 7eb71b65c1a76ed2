"""What became of a parameter: which logs it is of, in which units, and at which chance."""

import numpy as np
import pytest

from flexaxis.experiments.logs.trend import estimates as trend
from flexaxis.experiments.logs.trend import wear
from flexaxis.experiments.logs.trend.change_points import Change
from flexaxis.experiments.logs.trend.wear import WearVerdict, verdict, verdicts

N = 12
DAYS = np.cumsum(np.arange(1.0, N + 1))  # none as long after the last as another


@pytest.fixture
def values():
    return 2.0 * np.exp(0.3 * np.random.default_rng(0).standard_normal(N))


def test_a_log_without_a_covariate_is_left_out_with_its_day(values):
    warm = np.random.default_rng(1).standard_normal(N)
    warm[[2, 7]] = np.nan
    sd = 0.01 * np.arange(1.0, N + 1)
    found = verdict("f_m", DAYS, values, sd, warm[:, None], false_alarms=0.01)
    kept = [k for k in range(N) if k not in {2, 7}]
    assert found.logs.tolist() == kept and found.proportional
    np.testing.assert_array_equal(found.series.time, DAYS[kept])
    np.testing.assert_array_equal(found.series.covariates[:, 0], warm[kept])
    # of logarithms: the difference of two is that of the estimates, and d log x = dx / x
    np.testing.assert_allclose(np.diff(found.series.value), np.diff(np.log(values[kept])))
    np.testing.assert_allclose(found.series.deviation, (sd / values)[kept])


def test_the_chance_of_a_false_alarm_is_that_of_all_parameters(monkeypatch, values):
    asked = []
    monkeypatch.setattr(wear, "verdict", lambda name, *_, **more: asked.append((name, more)))
    entry = {"value": 1.0, "sd": 0.1}
    rows = [{"estimates": dict.fromkeys(("k_T", "J_m", "f_m", "f_c"), entry)}] * N
    verdicts(rows, DAYS, {}, false_alarms=0.04, smallest=0.02)
    assert asked == [
        (name, {"false_alarms": pytest.approx(0.01), "smallest": 0.02})
        for name in ("k_T", "J_m", "f_m", "f_c")
    ]


def test_a_difference_of_logarithms_is_a_ratio(values):
    change = Change("step", 5, 5, 5, 0.0, size=float(np.log(1.5)), deviation=0.01)
    shared = ("f_m", "changed", np.arange(N), None)
    ratio, part = (WearVerdict(*shared, proportional, None, None) for proportional in (True, False))
    assert ratio.percent(change.size) == pytest.approx(50.0)
    assert ratio.percent_deviation(change) == pytest.approx(1.5)  # d(e^x) = e^x dx
    assert part.percent(0.5) == pytest.approx(50.0) and part.percent_deviation(change) == 1.0


def test_the_mean_of_a_column_is_that_of_what_is_there(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,temp\n0,20\n1,\n2,23\n", encoding="utf-8")
    assert trend._means(path) == {"time": 1.0, "temp": 21.5}


def test_a_copy_of_a_log_is_no_further_measurement_and_has_the_first_ones_date(
    tmp_path, monkeypatch
):
    logs = [tmp_path / f"2026-05-0{day}.csv" for day in (1, 2, 3)]
    for path, content in zip(logs, ("a", "b", "a"), strict=True):
        path.write_text(content, encoding="utf-8")
    monkeypatch.setattr(trend.Plan, "text", "")
    plan = trend.Plan(None, (), None)
    made = []

    def row_of(plan, path):
        made.append(path.name)
        return {"case": plan.case(path)}

    monkeypatch.setattr(trend, "row_of", row_of)
    monkeypatch.setattr(trend, "parallel", lambda work, tasks, **_: map(work, tasks))
    for _ in range(2):  # the second time nothing is made
        found = trend.estimate_all(plan, logs, tmp_path / "out")
        assert [(row["log"], row["copies"], row["date"][:10]) for row in found] == [
            ("2026-05-01.csv", ["2026-05-03.csv"], "2026-05-01"),
            ("2026-05-02.csv", [], "2026-05-02"),
        ]
    assert len(made) == 2
