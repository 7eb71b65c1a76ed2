"""The command line: what it prints, where, with which status; and wrong use in one clear line."""

import errno
import json
import os
import subprocess
import sys

import h5netcdf
import pytest

from flexaxis.experiments.cli import commands, group_of, main, parser
from tests.experiments.command import flexaxis


@pytest.mark.parametrize("command", commands())
def test_help_teaches_with_an_example(capsys, command):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code == 0
    assert f"flexaxis {command}" in capsys.readouterr().out.split("example:")[1]


@pytest.mark.parametrize("command", commands())
def test_the_help_has_every_command_in_its_group(command):
    """Whoever writes a module for a new one reads here what it must say of itself."""
    module = commands()[command]
    missing = [name for name in ("HELP", "configure") if not hasattr(module, name)]
    assert not missing, f"{module.__file__}: give it {', '.join(missing)}; see experiments/cli.py"
    block = parser().format_help().split(f"\n{group_of(module)}:\n")[1].split("\n\n")[0]
    assert f"\n  {command} " in f"\n{block}"


def test_start_up_is_light():
    """The heavy libraries are imported by the commands that need them."""
    code = (
        "import sys; from flexaxis.experiments.cli import parser; parser();"
        "heavy = {'numpy', 'mujoco', 'numba', 'matplotlib', 'control', 'scipy'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == "[]"


def test_list_and_show(capsys):
    status, out, _ = flexaxis(capsys, "list", "--json")
    names = {row["name"] for row in json.loads(out)["scenarios"]}
    assert status == 0 and {"paper_nominal-v1", "pause_fm_step-v1"} <= names
    status, out, _ = flexaxis(capsys, "show", "fm_step-v1")
    assert status == 0 and "factor = 1.5" in out
    status, out, _ = flexaxis(capsys, "show", "rpem-forgetting", "--json")
    assert json.loads(out)["knob"] == "forgetting"
    assert flexaxis(capsys, "show", "smoke")[0] == 0


def test_what_show_prints_can_be_run(capsys, tmp_path):
    from flexaxis.experiments.catalogue.find import find_scenario

    _, out, _ = flexaxis(capsys, "show", "pause_fm_step-v1")
    path = tmp_path / "mine.toml"
    path.write_text(out, encoding="utf-8")
    assert find_scenario(str(path)).hash == find_scenario("pause_fm_step-v1").hash


def test_simulate_then_estimate(capsys, short_toml, tmp_path):
    record, estimates = tmp_path / "rec.nc", tmp_path / "est.nc"
    status, out, _ = flexaxis(capsys, "simulate", short_toml, "--seed", 3, "-o", record)
    assert (status, out.strip()) == (0, str(record))
    status, out, _ = flexaxis(capsys, "estimate", record, "-o", estimates, "--json")
    told = json.loads(out)
    assert status == 0 and told["truth"]["f_m"] == pytest.approx(0.075)
    with h5netcdf.File(estimates, decode_vlen_strings=True) as file:
        assert list(file["estimate"][:]) == ["k_T", "1/J_a", "f_m"]
        assert file["theta"].shape == (1600, 3) and file["covariance"].shape == (1600, 3, 3)
        assert file.attrs["estimator"] == "rpem-forgetting"
        assert told["last"]["k_T"] == file["theta"][-1, 0]
    status, out, _ = flexaxis(capsys, "estimate", record, "--estimator", "frozen")
    assert status == 0 and out.splitlines()[-1] == str(tmp_path / "rec-estimates.nc")


def test_run_and_report(capsys, short_toml, tmp_path):
    folder = tmp_path / "out"
    words = ("run", short_toml, "--estimator", "frozen", "--seeds", "2", "--jobs", "1")
    status, out, _ = flexaxis(capsys, *words, "-o", folder)
    assert status == 0 and out.splitlines()[-1] == f"report: {folder / 'report.html'}"
    first = (folder / "report.html").read_bytes()
    status, out, _ = flexaxis(capsys, "report", folder, "--json")
    assert json.loads(out)["seeds"] == [1000, 1001]
    assert (folder / "report.html").read_bytes() == first


BAD_TOML = """\
name = "bad"
duration = 20.0
durration = 3
identify = ["k_t"]
parameters.J_m = -1.0
noise.speed = "loud"
[[fault]]
kind = "stp"
[[nuisance]]
kind = "step"
parameter = "f_m"
at = 30.0
factor = 1.5
"""


def test_all_errors_of_a_file_at_once(capsys, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(BAD_TOML, encoding="utf-8")
    status, out, err = flexaxis(capsys, "run", path, "-o", tmp_path / "out")
    assert (status, out) == (2, "")
    for words in (
        "durration", "duration", "k_T", "J_m", "noise.speed", "fault[0]", "nuisance[0].at",
    ):  # fmt: skip
        assert words in err, err
    assert all(line.startswith(f"flexaxis: {path}: ") for line in err.splitlines())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["run", "fm_stp-v1"], "Did you mean 'fm_step-v1'"),
        (["run", "fm_step-v1", "--estimator", "rpem-forgeting"], "Did you mean 'rpem-forgetting'"),
        (["run", "fm_step-v1", "--seeds", "x"], "give a number of seeds"),
        (["run", "fm_step-v1", "--seeds", "5:5"], "give a number of seeds"),
        (["run", "fm_step-v1", "--jobs", "0"], "number of processes"),
        (["run", "fm_step-v1", "--estimator", "rpem-forgetting[forgetting=1.2]"], "(0, 1]"),
        (["run", "fm_step-v1", "--estimator", "rpem-forgetting[P0=[1,-1,1]]"], "positive definite"),
        (["show", "smoek"], "Did you mean 'smoke'"),
        (["simulate", "missing.toml"], "missing.toml"),
        (["estimate", "missing.nc"], "missing.nc"),
        (["report", "missing"], "is not the folder of a run or a study"),
    ],
)
def test_wrong_use_is_one_clear_line_and_status_2(capsys, tmp_path, monkeypatch, words, hint):
    monkeypatch.chdir(tmp_path)
    status, out, err = flexaxis(capsys, *words)
    assert (status, out) == (2, "")
    assert hint in err and "Traceback" not in err and len(err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_damaged_record(capsys, short_toml, tmp_path):
    record = tmp_path / "rec.nc"
    flexaxis(capsys, "simulate", short_toml, "-o", record)
    whole = record.read_bytes()
    record.write_bytes(whole[: len(whole) // 2])
    status, _, err = flexaxis(capsys, "estimate", record)
    assert status == 2 and str(record) in err and len(err.splitlines()) == 1
    with h5netcdf.File(record, "w") as file:
        file.attrs["foreign"] = 1
    assert flexaxis(capsys, "estimate", record)[0] == 2
    record.write_bytes(whole)
    with h5netcdf.File(record, "a") as file:
        file["speed"][123] = float("nan")
    status, _, err = flexaxis(capsys, "estimate", record)
    assert status == 2 and "speed" in err and "123" in err


@pytest.mark.parametrize(
    ("number", "status"), [(errno.ENOSPC, 70), (errno.EFBIG, 70), (errno.EACCES, 2)]
)
def test_a_full_disk_is_no_wrong_use(short_toml, monkeypatch, capsys, number, status):
    def atomic(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("flexaxis.sim.record.atomic", atomic)
    assert main(["simulate", str(short_toml), "-o", str(short_toml.with_name("rec.nc"))]) == status
    assert "rec.nc: cannot be written" in capsys.readouterr().err
