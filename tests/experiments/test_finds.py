"""What is found of faults: shares over size, beside what their twins without them show."""

from types import SimpleNamespace as Finding

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.comparison.finds import finds
from flexaxis.experiments.scoring.detection import find_of, moved_of
from flexaxis.experiments.scoring.intervals import rate_interval
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.studies.definition import study_from

SIZE = "fault[0].factor"
STUDY = {"name": "s", "scenario": "fm_step-v2", "estimators": ["ekf"], "seeds": 2}
DEFINITION = {"name": "s", "fault": [{"parameter": "f_m"}]}


@pytest.mark.parametrize(
    ("keys", "points"),
    [
        ({}, [1.2, 1.5, 1.0]),
        ({"twins": False}, [1.2, 1.5]),
        ({"streams": "own"}, [1.2, 1.5]),  # no twin has the same noise then
        ({"sweep": {SIZE: [1.0, 1.5]}}, [1.0, 1.5]),
        ({"design": "list"}, [1.2, 1.5]),
    ],
)
def test_a_swept_size_has_a_twin_without_the_fault(keys, points):
    study = study_from(STUDY | {"sweep": {SIZE: [1.2, 1.5]}} | keys)
    assert [point[SIZE] for point in study.points] == points


def test_a_twin_has_the_streams_and_the_onset_of_the_fault():
    for name in ("fm_step-v2", "pause_fm_step-v2", "moves_fm_step-v2"):
        written = find_scenario(name)
        twin = written.override({SIZE: 1.0}, inherit=True)
        assert twin.key == written.key and not twin.events()
        for seed in range(1000, 1005):
            assert twin.drawn(seed).fault[0].at == written.drawn(seed).fault[0].at


def track(scenario, theta, findings=None):
    return Track(scenario, ("f_m",), theta, scenario.true_parameters(), findings=findings)


def test_what_is_seen_of_a_fault_and_where_the_twin_would_have_it():
    written = find_scenario("fm_step-v1")  # f_m + 50 % at sample 2000
    theta = np.full((4000, 1), 0.05)
    theta[2100:] *= 1.2  # .5 s after it
    theta[1500:1510] *= 1.05
    for scenario in (written, written.override({SIZE: 1.0}, inherit=True)):
        moved = moved_of(track(scenario, theta), 0)
        assert moved["0.5"] == 0.0 and moved["1.0"] == moved["5.0"] == pytest.approx(20)
        given = [Finding(alarm=1990, parameters=("f_m",)), Finding(alarm=2050, parameters=("k_T",))]
        assert find_of(track(scenario, theta, given), 0) == {"after": 0.25, "named": 0.0}
        assert find_of(track(scenario, theta, given[:1]), 0) == {"after": None, "named": None}
        assert find_of(track(scenario, theta), 0) is None
        if scenario is written:  # watched from a second after burn-in on, but not in the window
            assert moved["calm"] == pytest.approx(5) and moved["watched"] < 14
        else:
            assert moved["calm"] == pytest.approx(20) and moved["watched"] == pytest.approx(14)
    assert moved_of(track(written, np.full((4000, 1), np.nan)), 0)["1.0"] == 0.0  # a failed run


def row(seed, size, *, estimator="e", **seen):
    return {"case": f"{estimator}{size}/{seed}", "estimator": estimator, "method": estimator,
            "seed": seed, "axes": {SIZE: size}, **seen}  # fmt: skip


def found(stored, folder, rows, **how):
    table = finds(stored(folder, rows, [SIZE], scenarios=[{"definition": DEFINITION}]), **how)
    return list(table.itertuples())


def test_what_the_twin_shows_too_is_no_find(stored, tmp_path):
    """Delays alike whatever the size, as of chance: of 8 seeds 6 have a finding either way."""
    rows = []
    for seed in range(8):
        for size in (1.0, 1.1, 1.5, 2.0):
            by_chance = {"after": 0.3, "named": 0.0} if seed < 6 else {"after": None, "named": None}
            seen = {"after": 0.2, "named": 1.0} if size == 1.5 else by_chance
            if size == 2.0 and seed == 7:  # not named, and the twin shows nothing
                seen = {"after": 0.4, "named": 0.0}
            false = {"alarms": 1, "false_alarms": int(size == 1.0 and seed < 6), "calm": 20.0}
            rows.append(row(seed, size, find=seen, detection=false))
    each = {f.size: f for f in found(stored, tmp_path, rows)}
    assert {size: f.share for size, f in each.items()} == {
        1.0: 0.75,
        1.1: 0.0,
        1.5: 1.0,
        2.0: 0.125,
    }
    low, high = each[1.1].per_hour_interval
    assert (each[1.1].alarms, each[1.1].hours) == (6, pytest.approx(160 / 3600))
    assert low < 6 / each[1.1].hours < high and each[1.1].threshold is None
    later = {f.size: f.share for f in found(stored, tmp_path / "b", [
        r | {"find": {"after": 0.7, "named": 1.0}} for r in rows if r["axes"][SIZE] != 1.0
    ] + [r for r in rows if r["axes"][SIZE] == 1.0], within=0.5)}  # fmt: skip
    assert later == {1.0: 0.75, 1.1: 0.0, 1.5: 0.0, 2.0: 0.0}


def test_who_has_no_findings_gets_a_threshold_from_the_twins(stored, tmp_path):
    """200 twins of 18 s are an hour: ten alarms are the ten largest peaks."""
    rng = np.random.default_rng(0)
    rows = []
    for seed, peak in enumerate(rng.permutation(200) / 10):
        calm = {"calm": peak, "watched": 18.0}
        rows += [row(seed, 1.0, moved=calm | {"1.0": peak / 2})]
        rows += [row(seed, 1.5, moved=calm | {"1.0": 30.0 if seed % 2 else 0.0})]
    each = {f.size: f for f in found(stored, tmp_path, rows)}
    assert (each[1.5].alarms, each[1.5].hours) == (10, pytest.approx(1.0))
    assert each[1.5].threshold == pytest.approx(18.9) and each[1.5].share == 0.5
    assert each[1.0].share == 0.0
    (few, *_) = found(stored, tmp_path / "few", rows, per_hour=0.5)  # the exposure allows of none
    assert few.alarms == 0 and few.threshold == pytest.approx(19.9)
    assert few.per_hour_interval == [0.0, pytest.approx(3.0, rel=2e-3)]


def test_the_interval_of_a_rate_is_garwoods_and_wider_for_storms():
    alone = np.arange(10)
    assert rate_interval(np.zeros(10), 2.0, alone) == [0.0, pytest.approx(2.996 / 2, rel=1e-3)]
    # 5 events: .324 … 2.334 times the count, from any table
    assert rate_interval([1, 1, 1, 1, 1], 1.0, alone[:5]) == pytest.approx(
        [1.623, 11.668], abs=1e-3
    )
    low, high = rate_interval([0, 0, 0, 0, 10], 1.0, alone[:5])
    assert low < 1.0 and high > 30
