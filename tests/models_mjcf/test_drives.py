"""Drives that exist: every number says where it is from, and each can be run as it is."""

import re
import tomllib

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.models_mjcf import model_files
from flexaxis.sim.parameters import PARAMETER_NAMES, preset, presets
from flexaxis.sim.stability import loop_problem

TEXT = model_files("three_mass")[1]["drives.toml"].decode()
DRIVES = tomllib.loads(TEXT)
SUITE = find_suite("drives").scenarios
BAM = [name for name in DRIVES if name != "bench"]


def test_every_number_says_where_it_is_from():
    lines = [line for line in TEXT.splitlines() if re.match(r"\w+ = ", line)]
    assert len(lines) == len(DRIVES) * len(PARAMETER_NAMES)
    plain = {"k_T = 1.0", "r = 1.0", "f_g = 0.0", "f_a = 0.0"}  # said once, at the top
    silent = {
        line for line in lines if not re.search(r"# (assumed|BAM|fit|a quarter|the rest)", line)
    }
    assert silent <= plain


@pytest.mark.parametrize("name", BAM)
def test_what_is_assumed_is_what_is_said(name):
    """The antiresonance of the load at 85 rad/s, a quarter at the flange, damping of the modes."""
    p = preset(name)
    load = p.J_g + p.J_a
    assert np.sqrt(p.k_g / load) == pytest.approx(85, rel=0.01)
    assert p.J_g / load == pytest.approx(0.25, rel=0.01) and p.k_a == pytest.approx(4 * p.k_g)
    damping = 0.1 * p.k_g / np.sqrt(p.k_g * (1 / p.J_m + 1 / load))
    assert p.d_g == pytest.approx(damping, rel=0.01) and p.d_a == pytest.approx(4 * p.d_g)


def test_the_shaft_of_the_bench_is_that_of_the_fit():
    p = preset("bench")
    assert 1 / (1 / p.k_g + 1 / p.k_a) == pytest.approx(547)
    assert 1 / (1 / p.d_g + 1 / p.d_a) == pytest.approx(9.4e-3)
    assert p.J_g + p.J_a == pytest.approx(4.76e-3)


def test_every_drive_is_in_the_suite():
    assert {find_scenario(name).preset for name in SUITE} == {*DRIVES, "wg"}
    assert set(DRIVES) < set(presets())


@pytest.mark.parametrize("name", [name for name in SUITE if not name.startswith("wg")])
def test_the_loop_is_stable_with_twice_the_gain(name):
    scenario = find_scenario(name)
    twice = scenario.controller.model_copy(update={"Kv": 2 * scenario.controller.Kv})
    assert loop_problem(scenario.nominal, twice, scenario.period) is None
