"""Logs of real axes on a board: who follows the first part predicts the rest."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexaxis.experiments.board.entry import Entry, EntryError
from flexaxis.experiments.board.real_logs import START, log_scores, with_values
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.sim.record import Record

sys.path.insert(0, str(Path(__file__).parent))
from boards import HONEST, about, confined

J, F, T, N = 0.01, 0.05, 0.004, 4000  # of one mass, k_T = 1; s; samples
AXIS = f"""model = "one_mass"
noise = 0.01
rate = {1 / T}
[nominal]
k_T = 1.0
J_m = {J}
f_m = {F}
"""


def saved(folder, name="bench"):
    rng = np.random.default_rng(3)
    torque = 0.4 * rng.standard_normal(N)
    speed, keep = np.zeros(N), np.exp(-F / J * T)
    for k in range(N - 1):
        speed[k + 1] = keep * speed[k] + (1 - keep) / F * torque[k]
    measured = speed + 0.01 * rng.standard_normal(N)
    Record(time=T * np.arange(N), torque=torque, speed=measured).save(folder / f"{name}.nc")
    (folder / f"{name}.toml").write_text(AXIS)


def entry(folder, estimator):
    return Entry(
        folder=folder, about=about(name=estimator.partition(":")[0].replace("/", "-")),
        estimator=estimator, suite="", quick=False, knob={}, turns={}, left_out={},
        environment={}, command="", digest="0" * 64,
    )  # fmt: skip


def test_who_follows_the_first_part_predicts_the_rest(tmp_path):
    saved(tmp_path)
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "mine.py").write_text(HONEST)
    taken = [entry(tmp_path, name) for name in ("ekf", "frozen", "code/mine.py:Honest")]
    ekf, frozen, own = log_scores(taken, tmp_path)
    assert ekf.leads and ekf.error < 0.5 * ekf.nominal and not frozen.leads
    assert frozen.error == pytest.approx(frozen.nominal)  # whoever does nothing stays 20 % off
    assert own.error is None and own.remark == "names code: --run-code runs it"


LOOKS = """
class Looks(Honest):
    def __init__(self, nominal, period, **given):
        with open("OUTSIDE", "w") as file:
            file.write("x")
"""


@confined
def test_code_follows_a_log_in_the_sandbox(tmp_path):
    saved(tmp_path)
    text = HONEST.replace("forgetting=0.99", "forgetting=0.99, torque=torque")
    text = text.replace('output="speed"):', 'output="speed", torque=None):')
    text = text.replace("nominal, period, identify", "one_mass(dict(nominal)), period, identify")
    text = "from flexaxis.estimators.models.axes import one_mass\n" + text
    (tmp_path / "code").mkdir()
    (tmp_path / "code" / "mine.py").write_text(text)
    outside = tmp_path / "outside"
    (tmp_path / "code" / "looks.py").write_text(HONEST + LOOKS.replace("OUTSIDE", str(outside)))
    names = ("rpem-forgetting[forgetting=0.99]", "code/mine.py:Honest", "code/looks.py:Looks")
    taken = [entry(tmp_path, name) for name in names]
    shipped, own, looks = log_scores(taken, tmp_path, run_code=True)
    assert not own.remark
    assert own.error == pytest.approx(shipped.error) and own.error < 0.5 * own.nominal
    assert looks.error is None and "FileNotFoundError" in looks.remark and not outside.exists()
    assert not list(tmp_path.rglob("__pycache__"))


def test_a_log_comes_with_its_axis(tmp_path):
    with pytest.raises(EntryError, match=r"has no NAME\.nc with a NAME\.toml"):
        log_scores([], tmp_path)


def test_values_of_inverses_are_those_of_their_parameters(tmp_path):
    (tmp_path / "a.toml").write_text(AXIS)
    axis = find_axis(str(tmp_path / "a.toml"))
    found = with_values(axis, {"1/J_m": 50.0, "f_m": START * F}).model.nominal
    assert found == replace(axis.model, nominal={"k_T": 1.0, "J_m": 0.02, "f_m": 0.06}).nominal
