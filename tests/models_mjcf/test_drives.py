"""Drives that exist: every number says where it is from, and each can be run as it is."""

import re
import tomllib

from flexaxis.experiments.catalogue.find import find_scenario, find_suite
from flexaxis.models_mjcf import model_files
from flexaxis.sim.parameters import PARAMETER_NAMES, presets

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


def test_every_drive_is_in_the_suite():
    assert {find_scenario(name).preset for name in SUITE} == {*DRIVES, "wg"}
    assert set(DRIVES) < set(presets())
