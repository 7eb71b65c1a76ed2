"""Logs of simulated runs: as a robot writes them, and as import reads them."""

import json
import shlex

import numpy as np
import pytest

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.findings import LogError
from flexaxis.experiments.logs.importing import import_log
from flexaxis.experiments.logs.units import LONGEST_GAP, write_log
from flexaxis.sim.record import load_record
from flexaxis.sim.scenario import load_scenario
from flexaxis.sim.simulate import simulate


@pytest.fixture(scope="module")
def record():
    scenario = find_scenario("fm_step-v1").override({"duration": 11.0})
    return simulate(scenario, [0])[0]


def round_trip(record, path, **style):
    write_log(path, record, np.random.default_rng(0), **style)
    return import_log(path, torque_is="held", burn_in=0.0).record


def test_round_trip_within_the_resolution(record, tmp_path):
    units = ("ms", "deg", "rpm", "A")
    back = round_trip(record, tmp_path / "log.csv", units=units, counts=65536, gaps=3)
    assert 3 <= (~back.valid).sum() <= 3 * (LONGEST_GAP + 1)
    assert back.period == pytest.approx(record.period, rel=1e-4)
    there = back.valid
    assert np.max(abs(back.angle - record.angle)[there]) <= np.pi / 65536 + 1e-8
    np.testing.assert_allclose(back.torque[there], record.torque[there], atol=1e-8)
    np.testing.assert_allclose(back.speed[there], record.speed[there], atol=1e-6)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"units": ("degg",)}, "deg"),
        ({"gaps": -1}, "gaps"),
    ],
)
def test_wrong_styles_are_refused(given, word, record, tmp_path):
    with pytest.raises(LogError, match=word):
        round_trip(record, tmp_path / "log.csv", **given)


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.toml"
    changes = {"duration": 11.0, "name": "short"}
    path.write_text(find_scenario("fm_step-v1").override(changes).to_toml())
    return path


def test_the_printed_line_imports_the_log(short, tmp_path, capsys):
    one, other, rec = (tmp_path / name for name in ("one log.csv", "other.csv", "rec.nc"))
    words = ["simulate", str(short), "--as-log", "csv", "--units", "deg,mA,ms,rpm"]
    for path in (one, other):
        assert main([*words, "-o", str(path), "--json"]) == 0
    assert one.read_bytes() == other.read_bytes()
    assert one.read_text().splitlines()[0] == "time [ms],torque [mA],angle [deg],speed [rpm]"
    printed = shlex.split(json.loads(capsys.readouterr().out.splitlines()[0])["import"])
    assert main([*printed[1:], "-o", str(rec)]) == 0
    back, true = load_record(rec), simulate(load_scenario(short), [0])[0]
    for name in ("time", "torque", "angle", "speed"):
        np.testing.assert_allclose(getattr(back, name), getattr(true, name), rtol=1e-6, atol=1e-6)
    assert main([*words, "-o", str(tmp_path / "wrong.txt")]) == 2
    assert main(["simulate", str(short), "--gaps", "2", "-o", str(one)]) == 2
