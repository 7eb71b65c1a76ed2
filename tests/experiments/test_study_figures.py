"""The figures of a study show the numbers of its rows, and bear what may be missing there."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.reporting.study import charts
from flexaxis.experiments.reporting.study import rows as study_rows
from flexaxis.experiments.reporting.study.rows import (
    alarms,
    confusion,
    isolation_table,
    lag_table,
)
from flexaxis.experiments.scoring.detection import isolation


def pooled(method, factor, **changes):
    lag = (factor or 1.0) / 10
    row = {
        "method": method, "who": method, "estimator": method, "fault[0].factor": factor,
        "start": 1.0, "parameter": "f_m", "changed": True, "runs": 4, "lag": lag,
        "lag_bound": 0.05, "lag_interval": [lag / 2, 2 * lag], "std": 0.3, "bias": 0.4,
    }  # fmt: skip
    return row | changes


def test_degradation_draws_lags_with_intervals_and_errors():
    rows = [pooled("ekf", factor) for factor in (2.0, 1.5)]
    rows += [pooled("ekf", 1.5, changed=False, std=0.0, bias=1.0, runs=12)]
    rows += [pooled("frozen", None)]  # an axis that is no option of this estimator
    chart = charts.degradation(rows, "fault[0].factor", label="size", words="")
    lag, error = chart.panels
    drawn, bound = lag.lines
    np.testing.assert_allclose([drawn.x, drawn.y], [[1.5, 2.0], [0.15, 0.2]])
    np.testing.assert_allclose([drawn.low, drawn.high], [[0.075, 0.1], [0.3, 0.4]])
    assert bound.role == "bound" and set(bound.y) == {0.05}
    # std² + bias² is .25 in 4 cases and 1 in 12, and .25 in the others
    (drawn,) = error.lines
    np.testing.assert_allclose([drawn.x, drawn.y], [[1.5, 2.0], [np.sqrt(0.8125), 0.5]])
    assert lag.y_range[0] == 0 and lag.y_range[1] > 0.4


def told(case, estimator, delay, missed, false, *, parameters=("k_T", "f_m")):
    detection = {"alarms": 1, "delay": delay, "faults": 2, "missed": missed, "false_alarms": false}
    row = {"case": case, "method": "m", "estimator": estimator, "detection": detection,
           "isolation": [{"fault": "f_m", "named": None}] * 2, "seconds": 36.0}  # fmt: skip
    return [row | {"parameter": name} for name in parameters]


def test_alarms_are_counted_once_a_case_whatever_changed(stored, tmp_path):
    rows = [*told("a", "m[t=1]", 0.1, 0, 1), *told("b", "m[t=1]", None, 2, 0)]
    rows += [*told("c", "m[t=9]", 0.3, 1, 0), {"case": "d", "method": "m", "detection": None}]
    first, second = alarms(stored(tmp_path, rows))
    assert (first["estimator"], first["delay"], first["missed"]) == ("m[t=1]", 0.1, 50.0)
    assert first["false_per_hour"] == pytest.approx(1 / (72 / 3600))
    assert (second["delay"], second["missed"], second["false_per_hour"]) == (0.3, 50.0, 0.0)


def test_a_lag_over_all_points_does_not_take_levels_for_draws(stored, tmp_path):
    rows = [
        {"case": f"{factor}/{seed}", "method": "m", "estimator": "m", "base": "s", "seed": seed,
         "axes": {"fault[0].factor": factor}, "lag": factor * (1 + 0.01 * seed)}
        for factor in (1.0, 100.0) for seed in range(6)
    ]  # fmt: skip
    results = stored(tmp_path, rows, axes=["fault[0].factor"], seeds=list(range(6)))
    (row,) = study_rows.rows_of(results, [], {}, ["lag"])
    low, high = row["lag_interval"]
    assert row["lag"] == pytest.approx(10.25, rel=1e-2) and 9.9 < low < high < 10.6
    few = stored(tmp_path / "few", [row for row in rows if row["seed"] < 3],
                 axes=["fault[0].factor"], seeds=[0, 1, 2])  # fmt: skip
    (row,) = study_rows.rows_of(few, [], {}, ["lag"])
    assert row["lag_interval"] is None  # six runs of three seeds, and six draws they are not


def test_detection_draws_a_point_a_setting():
    found = [
        {"method": "m", "estimator": f"m[t={t}]", "delay": delay, "delay_interval": interval,
         "missed": missed, "false_per_hour": false}
        for t, delay, interval, missed, false in (
            (4, 0.1, [0.0, 0.2], 0.0, 20.0),
            (16, 0.4, None, 25.0, 0.0),
            (99, None, None, 100.0, 0.0),
        )
    ]  # fmt: skip
    delay, missed = charts.detection(found, words="").panels
    assert {line.who for line in delay.lines} == {"m"}
    through, *points = delay.lines
    assert through.x.tolist() == [0.0, 20.0] and through.y.tolist() == [0.4, 0.1]
    assert [point.label for point in points] == ["m[t=16]", "m[t=4]"]
    assert points[1].low == [0.0] and points[1].high == [0.2]
    assert sorted(missed.lines[0].y) == [0.0, 25.0, 100.0]


@dataclass
class Finding:
    alarm: int
    parameters: tuple


def test_what_each_fault_was_taken_for():
    scenario = find_scenario("two_faults-v1")
    first, second = (event.index for event in scenario.events())
    faults = [event.parameter for event in scenario.events()]
    names = scenario.identify
    assert isolation(scenario, names, None) is None
    for findings, expected in (
        ([], [None, None]),
        ([Finding(first - 1, ("f_m",)), Finding(second, ("1/J_a",))], [None, ["J_a"]]),
        ([Finding(first, ()), Finding(first + 9, ("k_T",))], [[], None]),
        ([Finding(second + 5, ("k_T", "f_m"))], [None, ["k_T", "f_m"]]),
    ):
        found = isolation(scenario, names, findings)
        assert [entry["fault"] for entry in found] == faults
        assert [entry["named"] for entry in found] == expected


def test_confusion_counts_each_case_once(stored, tmp_path):
    told = [{"fault": "f_m", "named": ["f_m"]}, {"fault": "J_a", "named": None}]
    other = [{"fault": "f_m", "named": []}, {"fault": "J_a", "named": ["k_T", "f_m"]}]
    rows = [
        {"case": case, "method": "m", "isolation": said, "detection": {}, "parameter": name}
        for case, said in (("a", told), ("b", other), ("e", told))
        for name in ("k_T", "1/J_a", "f_m")
    ]
    rows += [{"case": "c", "method": "n", "isolation": None, "detection": None}]
    rows += [{"case": "d", "method": "n", "isolation": [], "detection": {}}]
    counts = confusion(stored(tmp_path, rows))
    assert counts == {
        "m": Counter({("f_m", "f_m"): 2, ("J_a", "missed"): 2, ("f_m", "unmodelled"): 1,
                      ("J_a", "several"): 1})
    }  # fmt: skip
    table = isolation_table(counts, words="")
    lines = {tuple(cell.text for cell in row.cells[:2]): row.cells[2:] for row in table.rows}
    assert set(lines) == {("m", "f_m"), ("m", "J_a")}
    names = [column.heading for column in table.columns[2:]]
    share = dict(zip(names, (cell.value for cell in lines["m", "f_m"]), strict=True))
    assert share == pytest.approx({"f_m [%]": 200 / 3, "J_a [%]": 0, "several [%]": 0,
                                   "unmodelled [%]": 100 / 3, "missed [%]": 0})  # fmt: skip


def test_the_lag_over_two_axes_has_a_cell_for_every_pair():
    rows = [pooled("ekf", factor, start=start, lag=factor * start)
            for factor in (1.5, 2.0, 3.0) for start in (1.0, 1.2)]  # fmt: skip
    axes = ("start", "fault[0].factor")
    rows.append(pooled("ekf", 3.0, start=1.2, lag=0.0, runs=12))  # of another parameter
    table = lag_table(rows[1:], axes, ("start", "size"), "")
    values = [[cell.value for cell in row.cells[1:]] for row in table.rows]
    assert values == [[1.5, pytest.approx(1.8), ""], [2.0, pytest.approx(2.4), 2.0],
                      [3.0, pytest.approx(0.9), 3.0]]  # fmt: skip
    tones = [cell.tone for row in table.rows for cell in row.cells[2:]]
    assert tones[0] == pytest.approx(np.log(1.8 / 0.9) / np.log(3.0 / 0.9))  # one scale for all
    assert tones[1] is None and tones[4:] == [0.0, 1.0]
    assert [c.heading for c in table.columns[1:]] == [
        "size", "lag [s] at start 1.2", "lag [s] at start 1",
    ]  # fmt: skip


class Swept:
    """Results of which only the axes are asked for."""

    axes = ("fault[0].factor", "rpem-forgetting.forgetting")

    def __init__(self, count):
        self.count, self.study = count, {"estimators": ["rpem-forgetting", "ekf"]}

    def values(self):
        return {"fault[0].factor": [1.5, 2.0], "rpem-forgetting.forgetting": [*range(self.count)]}


def test_an_estimator_is_not_pooled_over_its_knob():
    """Each setting is a line, as long as they can be told apart; else the words say so."""
    knob = "rpem-forgetting.forgetting"
    few, many = Swept(8), Swept(9)
    assert study_rows.told_apart(few, ["fault[0].factor"]) == [knob]
    assert study_rows.pooled_over(few, ["fault[0].factor"]) == []
    assert study_rows.told_apart(few, [knob]) == []  # it is the axis itself
    assert study_rows.told_apart(many, ["fault[0].factor"]) == []
    assert study_rows.pooled_over(many, ["fault[0].factor"]) == [knob]
    row = {"method": "rpem-forgetting[regularization=1e-6]", knob: 0.99}
    assert study_rows.who(row, [knob]) == "rpem-forgetting[regularization=1e-6,forgetting=0.99]"
