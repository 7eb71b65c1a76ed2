"""What was done, as a table, as CSV, and as a lesson that does the same again, to the last bit."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from flexaxis.experiments.demo.curves import estimates_table, history_table
from flexaxis.experiments.demo.history import COLUMNS, History, HistoryLine
from flexaxis.experiments.demo.lesson import Player, parse_lesson
from flexaxis.experiments.demo.live_axis import Friction
from flexaxis.experiments.demo.session import DemoSession
from flexaxis.sim.timing import PERIOD, rate

RATE = rate(PERIOD)
QUICK = ("rpem-forgetting", "rpem-drift")


@pytest.fixture(scope="module")
def played():
    """A session in which everything was touched once, between samples of all kinds."""
    session = DemoSession(estimators=QUICK, seed=9)
    session.advance(9 * RATE + 3)
    session.inject("f_m", 2.0)
    session.advance(301)
    session.tune(0, replace(session.racers[0].tuning, forgetting=0.99))
    session.advance(77)
    session.disturb(0.05)
    session.rub(Friction("LuGre", f_c=0.05, f_s=0.02))
    session.advance(7)
    session.rub(Friction("LuGre", f_c=0.2, f_s=0.02))
    session.advance(400)
    session.choose(1, "ekf")
    session.excite("stop-and-go")
    session.advance(150)
    session.repair()
    session.inject("k_a", 0.9)
    session.advance(250)
    return session


def test_a_lesson_does_it_all_again(played):
    lesson = parse_lesson(played.lesson(), source="saved")
    again = DemoSession(estimators=lesson.estimators, seed=lesson.seed)
    player = Player(again, lesson)
    assert again.axis.time == pytest.approx(9.015 - 8.0), "it begins a little before the first act"
    while again.axis.samples < played.axis.samples:
        player.advance(min(13, played.axis.samples - again.axis.samples))
    for mine, theirs in zip(again.racers, played.racers, strict=True):
        assert mine.text == theirs.text and mine.tuning == theirs.tuning
        np.testing.assert_array_equal(mine.theta, theirs.theta)
    np.testing.assert_array_equal(again.curves().theta, played.curves().theta)
    np.testing.assert_array_equal(again.axis.state, played.axis.state)
    assert again.history.csv() == played.history.csv()


def test_the_csv_is_read_by_others(played):
    rows = list(csv.DictReader(io.StringIO(played.history.csv())))
    assert tuple(rows[0]) == COLUMNS and len(rows) == 2 * len(played.history.entries)
    forgetting, drift = rows[:2]
    assert (forgetting["what"], forgetting["parameter"]) == ("f_m × 2", "f_m")
    assert (forgetting["estimator"], drift["estimator"]) == QUICK
    assert float(forgetting["time_s"]) == pytest.approx(9.015)
    assert (float(forgetting["before"]), float(forgetting["after"])) == (0.05, 0.1)
    lags = played.history.entries[0].lags
    assert [float(row["lag_s"]) for row in rows[:2]] == pytest.approx(lags, rel=1e-5)
    assert float(forgetting["lag_bound_single_s"]) < float(forgetting["lag_bound_s"])


def test_what_an_estimator_found_is_told():
    session = DemoSession(seed=10)
    session.advance(8 * RATE)
    session.inject("f_m", 2.0)
    session.advance(6 * RATE)
    entry = session.history.last
    (after, what), *_ = entry.found[1]
    assert what.startswith("f_m × ") and float(what.split()[-1]) == pytest.approx(2.0, rel=0.1)
    assert 0 < after < 0.5 and not entry.found[0]
    text = history_table(session.history)
    assert f"{what} after" in text and "f_m = 0.0" in text
    assert "theory allows" in estimates_table(session) and "<b>lag</b> [s]" in estimates_table(
        session
    )


def test_text_is_shown_as_text():
    past = History()
    past.add(HistoryLine(0, "x", "<script>alert(1)</script>", ("a", "b")), {})
    assert "<script>" not in history_table(past)
