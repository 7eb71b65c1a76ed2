"""The tables of axes with friction judge rightly: when something was found, and as what."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from acceptance.friction import Run, judge
from acceptance.friction_rows import pooled
from acceptance.friction_targets import COLUMNS, Column, Given

from flexaxis.experiments.catalogue.find import find_scenario

SCENARIO = find_scenario("ja_step-v1")  # J_a × 1.1 at sample 2000
ALARM, ONSET = 2030, 2010


@dataclass(frozen=True)
class Said:
    alarm: int
    onset: int
    parameters: tuple[str, ...]
    interval: tuple[tuple[float, float], ...] = ()


class Teller:
    """Estimates nothing, and says what it is told to: from a sample on, until the next."""

    names = ("k_T", "1/J_a", "f_m")
    output = "speed"

    def __init__(self, *story):
        self.story, self.count = story, 0

    def run(self, u, y):
        self.count += len(u)
        return np.tile([1.0, 1.25, 0.05], (len(u), 1))

    @property
    def findings(self):
        last = {}
        for sample, finding in self.story:
            if self.count > sample:
                last[finding.alarm] = finding
        return tuple(last.values())


class Told(Run):
    """A run of a teller instead of an estimator by name."""

    def estimator(self):
        return Teller(*self.spec)


def told(*story, scenario=SCENARIO):
    rest = np.zeros(scenario.samples)
    record = SimpleNamespace(
        torque=rest, speed=rest, valid=None, true_parameters=scenario.true_parameters()
    )
    return judge(Told(story, scenario, record))


FIRST = Said(ALARM, ONSET, ("f_m",))
SECOND = Said(ALARM, ONSET, ("1/J_a",), ((0.85, 0.95),))


def test_a_change_is_named_as_it_was_then_and_a_second_later():
    run = told((ALARM, FIRST), (ALARM + 150, SECOND), (ALARM + 300, FIRST))
    (found,) = run.found
    assert (found.named, found.renamed) == (("f_m",), ("J_a",))
    assert found.delay == pytest.approx(0.15)
    assert run.faults == ("J_a",) and run.alarms == 1 and run.false == 0
    row = pooled([run, run])
    assert (row.found, row.named, row.renamed, row.covered) == (100, 0, 100, 100)


def test_an_interval_of_an_inverse_is_one_of_the_inverse_ratio():
    wide, wrong = ((0.85, 0.95),), ((1.05, 1.15),)  # of 1/J_a; J_a grew by a tenth
    for interval, covered in ((wide, True), (wrong, False), ((), None)):
        run = told((ALARM, replace(SECOND, interval=interval)))
        assert run.found[0].covered is covered
    assert told((ALARM, FIRST)).found[0].covered is None  # of something else


@pytest.mark.parametrize(
    ("finding", "met", "false"),
    [
        (FIRST, True, 0),
        (replace(FIRST, onset=1890), False, 0),  # an alarm there, but about another time
        (replace(FIRST, alarm=3010, onset=3005), False, 1),
        (replace(FIRST, alarm=1500, onset=1490), False, 1),
    ],
)
def test_found_is_an_alarm_in_the_window_that_is_right_about_the_time(finding, met, false):
    run = told((finding.alarm, finding))
    assert (run.found[0] is not None, run.false) == (met, false)
    assert run.calm == pytest.approx(15.0)


def test_an_alarm_that_was_taken_back_named_nothing():
    assert told((ALARM, FIRST), (ALARM + 150, replace(FIRST, parameters=()))).found[0].renamed == ()


def test_who_stands_still_has_the_lag_of_doing_nothing_and_no_bias():
    row = pooled([told(), told()])
    assert row.lag == pytest.approx(5.0) and row.found == 0 and row.named is None
    assert row.t10 == np.inf and row.bias == pytest.approx({"k_T": 0, "J_a": 0, "f_m": 0})


def test_a_missed_target_has_a_mark():
    row = pooled([told(), told()])
    given = Given("coulomb_fm_step-v1", row, row)
    cells = {column.heading: column.cell(given) for column in COLUMNS}
    assert cells["lag"] == "5.000!" and cells["bias k_T"] == "0.00" and cells["named"] == "–"
    words = {column.heading: column.target(given) for column in COLUMNS}
    assert (words["lag"], words["bias k_T"], words["found"]) == ("≤0.150", "±1.00", "≥97")
    assert Column("x", lambda row: 2.0, ".1f").cell(given) == "2.0"
