"""Missing rows: what acted in them is not known, and neither biases an answer nor passes unseen."""

from dataclasses import replace

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.fit import UNKNOWN, Setup, held_out
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.signals import log_of
from flexaxis.experiments.logs.units import write_log
from flexaxis.sim.simulate import simulate

NAMES = ("J_m", "J_l", "k", "d", "f_m")


@pytest.fixture(scope="module")
def scenario():
    found = find_scenario("two_mass_fm_step-v1").override({"fault[0].at": 5.0, "duration": 6.0})
    return found.override({"fault": []})


@pytest.fixture(scope="module")
def truth(scenario):
    return scenario.nominal.as_dict()


def of_gaps(scenario, number, path, seed=0):
    """A log in which up to 20 rows are missing, several times."""
    write_log(path, simulate(scenario, [seed])[0], np.random.default_rng(seed), gaps=number)
    return import_log(path, torque_is="held", burn_in=0.0).record


@pytest.mark.slow
def test_parameters_are_those_of_a_log_without(scenario, truth, tmp_path):
    """The speed is off by 3 rad/s behind a gap where the torque in it is a line."""
    record = of_gaps(scenario, 4, tmp_path / "log.csv")
    assert 10 < (~record.valid).sum() < 100
    axis = find_axis("two_mass").having(
        {"k_T": 1.0, "f_l": 0.001} | {n: 0.8 * truth[n] for n in NAMES}
    )
    found = identify(record, axis, fix=("k_T", "f_l"), delay=0.0, friction="none", gravity="none")
    estimates = found.estimates.loc["value", list(NAMES)]
    np.testing.assert_allclose(estimates, [truth[n] for n in NAMES], rtol=1e-4)
    assert found.warnings == []


@pytest.mark.parametrize("number", [12, 100])
def test_of_many_gaps_the_longest_begin_a_stretch(scenario, number, tmp_path):
    axis = find_axis("two_mass")
    log = log_of(of_gaps(scenario, number, tmp_path / "log.csv"), axis)
    setup = Setup(log, axis.model, NAMES, delay=4 * log.period)
    assert 1 < len(setup.begins) <= 1 + UNKNOWN // 3
    held = held_out(setup)  # what comes at once behind a gap is fitted
    assert all(not held[begin : begin + 3].any() for begin in setup.begins)
    assert 0.05 * len(held) < held.sum() < 0.3 * len(held)


@pytest.mark.parametrize(
    ("rows", "late", "burn_in"),
    [
        (np.r_[0:20], 0, 0.0),
        (np.r_[203:215, 600:610], 0, 1.0),
        (np.r_[300:320, 700:703], 3, 0.0),
        (np.r_[300:310, 314:320, 330:335], 0, 0.0),
    ],
    ids=["at the start", "behind the burn-in", "with a delay", "close by"],
)
def test_wherever_a_gap_is(scenario, truth, rows, late, burn_in):
    whole = simulate(scenario, [0])[0]
    valid, k = np.ones(len(whole.time), bool), np.arange(len(whole.time))
    valid[rows] = False
    moved = np.r_[np.zeros(late), whole.increment][: len(k)]
    lines = {
        name: np.interp(k, k[valid], values[valid])
        for name, values in (("torque", whole.torque), ("increment", moved))
    }
    valid[1:] &= valid[:-1]  # an increment needs both of its ends
    record = replace(whole, valid=valid, burn_in=burn_in, speed=None, **lines)
    axis = find_axis("two_mass").having({n: truth[n] for n in ("k_T", "f_l", *NAMES)})
    setup = Setup(log_of(record, axis), axis.model, NAMES, delay=late * record.period)
    values = np.array([truth[n] for n in NAMES])
    started = setup.having(dict(zip(NAMES, 0.9 * values, strict=True)))
    np.testing.assert_allclose(started.solve().z[:5], values, rtol=1e-3)
