"""A real two-mass bench, where its data are at hand: FdiTools, MultisineTypeA.mat (MIT)."""

import json
import os
from hashlib import sha256
from pathlib import Path

import pytest

from flexaxis.experiments.cli import main
from flexaxis.sim.record import load_record
from tests.experiments.command import flexaxis

DATA = Path(os.environ.get("FLEXAXIS_FDITOOLS", "MultisineTypeA.mat"))
DIGEST = "a15dadc2e756ceddd927935f9c4c547cdcaef95c8611fc39087c848b3a8acb26"
# an independent fit of the frequency response, per k_T = 1
REFERENCE = {"J_m": 4.79e-3, "J_l": 4.76e-3, "k": 547.0}
MAP = """\
time = "time"
torque = "iq_adx"
angle = "theta_mx"
torque_is = "smooth"
unit = {time = "us"}
"""

pytestmark = pytest.mark.skipif(
    not DATA.is_file(),
    reason="no bench data: FLEXAXIS_FDITOOLS names MultisineTypeA.mat of FdiTools",
)


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    assert sha256(DATA.read_bytes()).hexdigest() == DIGEST
    folder = tmp_path_factory.mktemp("bench")
    (folder / "map.toml").write_text(MAP, encoding="utf-8")
    rec, axis = folder / "rec.nc", folder / "axis.toml"
    words = ["--map", folder / "map.toml", "-o", rec]
    assert main(["import", str(DATA), *map(str, words)]) == 0
    linear = ("--model", "two_mass", "--friction", "none")
    assert main([str(w) for w in ("identify", rec, *linear, "-o", axis)]) == 0
    return rec, axis


def track(capsys, rec, axis, estimator):
    words = ("--identify", "k_T,1/J_l,k", "--start", "1.2", "--estimator", estimator, "--json")
    status, out, _ = flexaxis(capsys, "track", rec, "--model", axis, *words)
    return status, json.loads(out)


def test_identify_agrees_with_an_independent_fit(identified):
    import tomllib

    found = tomllib.loads(identified[1].read_text(encoding="utf-8"))
    for name, value in REFERENCE.items():
        assert abs(found["nominal"][name] / value - 1) < 0.02, name
    assert found["delay"] == pytest.approx(0.115e-3, abs=0.01e-3)


def test_a_planted_change_is_found_and_named(identified, capsys, tmp_path):
    from dataclasses import replace

    record = load_record(identified[0])
    torque = record.torque.copy()
    torque[len(torque) // 2 :] *= 0.9
    changed = replace(record, torque=torque).save(tmp_path / "changed.nc")
    status, told = track(capsys, changed, identified[1], "ekf")
    (change,) = told["changes"]
    assert status == 1 and change["name"] == "k_T"
    assert abs(change["time"] - 10.0) < 0.5
    assert change["relative"] == pytest.approx(1 / 0.9 - 1, abs=0.02)
