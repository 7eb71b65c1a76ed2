"""Hostile logs are answered in words, with status 2; nothing is written, and nothing replaced."""

from pathlib import Path
from runpy import run_path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.files import is_ours

made = SimpleNamespace(**run_path(str(Path(__file__).with_name("hostile_logs.py"))))


def answer(capsys, *words):
    status = main([str(word) for word in words])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return status, out, err


@pytest.mark.parametrize("case", made.HOSTILE)
def test_hostile_logs(case, tmp_path, capsys):
    hostile = made.HOSTILE[case]
    log = tmp_path / hostile.name
    hostile.write(log)
    before = log.read_bytes() if log.is_file() else b""
    status, _, err = answer(capsys, "import", log, *hostile.words, "-o", tmp_path / "rec.nc")
    assert status == 2, err
    said = err.replace(str(tmp_path), "")  # which is called after the case
    for word in hostile.says:
        assert word in said
    assert len(err) < 2000
    assert {path.name for path in tmp_path.iterdir()} == {hostile.name}
    assert not log.is_file() or log.read_bytes() == before


def test_a_good_one_is_imported(tmp_path, capsys):
    log = tmp_path / "log.csv"
    made.csv().write(log)
    status, out, _ = answer(capsys, "import", log, *made.SIGNALS)
    assert status == 0 and str(tmp_path / "log.nc") in out


def test_a_missing_file(tmp_path, capsys):
    status, _, err = answer(capsys, "import", tmp_path / "no.csv")
    assert status == 2 and "no.csv" in err and "no such file" in err.lower()


def test_a_raw_netcdf_log_is_never_replaced(tmp_path, capsys):
    log = tmp_path / "mylog.nc"
    made.hdf5(log)
    before = log.read_bytes()
    status, out, _ = answer(capsys, "import", log)
    assert status == 0 and "mylog-imported.nc" in out
    assert log.read_bytes() == before
    status, _, err = answer(capsys, "import", log, "-o", log)
    assert status == 2 and "would be overwritten" in err and log.read_bytes() == before


def test_a_log_beside_the_log_is_never_replaced(tmp_path, capsys):
    """log.csv and log.nc are two logs of one user."""
    beside, log = tmp_path / "log.nc", tmp_path / "log.csv"
    made.hdf5(beside)
    made.csv().write(log)
    before = beside.read_bytes()
    status, out, _ = answer(capsys, "import", log)
    assert status == 0 and "log-imported.nc" in out and beside.read_bytes() == before
    status, _, err = answer(capsys, "import", log, "-o", beside)
    assert status == 2 and "not written by flexaxis" in err and beside.read_bytes() == before


def test_a_page_of_somebody_else_is_never_replaced(tmp_path, capsys):
    page, log = tmp_path / "log.html", tmp_path / "log.csv"
    page.write_text("<!doctype html><title>Our lab</title>", encoding="utf-8")
    made.csv().write(log)
    status, _, err = answer(capsys, "import", log)
    assert status == 2 and "log.html" in err and "Our lab" in page.read_text(encoding="utf-8")


def test_its_own_record_and_page_are_made_anew(tmp_path, capsys):
    log = tmp_path / "log.csv"
    made.csv().write(log)
    for _ in range(2):
        status, out, _ = answer(capsys, "import", log)
        assert status == 0 and str(tmp_path / "log.nc") in out
    other = made.signals(seed=1)
    log.write_text(made.text_of(other), encoding="utf-8")
    assert answer(capsys, "import", log)[0] == 0
    with h5py.File(tmp_path / "log.nc") as file:
        np.testing.assert_allclose(file["torque"][:], other["torque"], rtol=1e-11)


def test_strict_is_status_1_if_something_spoils_the_estimates(tmp_path, capsys):
    log = tmp_path / "log.csv"
    made.csv({"angle": -made.good["angle"]}).write(log)
    assert answer(capsys, "import", log)[0] == 0
    status, out, _ = answer(capsys, "import", log, "--strict")
    assert status == 1 and "--scale torque=-1" in out
    made.csv().write(log)
    assert answer(capsys, "import", log, "--strict")[0] == 0


@pytest.mark.parametrize(
    ("words", "name", "content"),
    [
        (["identify", "--model", "one_mass"], "map.toml", "time = 't'\n"),
        (["identify", "--model", "one_mass"], "log-axis.html", "<title>Our lab</title>"),
        (["track", "--model", "AXIS", "--identify", "f_m"], "est.html", "<title>Our lab</title>"),
        (["track", "--model", "AXIS", "--identify", "f_m"], "est.nc", "my own log"),
        (
            ["identify", "--model", "one_mass"],
            "belt.toml",
            'model = "one_mass"\ndelay = 0.0\nnominal = {k_T = 1, J_m = 0.1, f_m = 0.1}\n',
        ),
    ],
)
def test_no_command_of_logs_replaces_what_is_not_its_own(words, name, content, tmp_path, capsys):
    log, there, axis = tmp_path / "log.csv", tmp_path / name, tmp_path / "axis.toml"
    made.csv().write(log)
    axis.write_text('model = "one_mass"\nnominal = {k_T = 1, J_m = 0.1, f_m = 0.1}\n')
    there.write_text(content, encoding="utf-8")
    command, *given = [str(axis) if word == "AXIS" else word for word in words]
    out = there.with_suffix(".toml" if command == "identify" else ".nc")
    status, _, err = answer(capsys, command, log, *given, "-o", out)
    assert status == 2 and name in err and "not written by flexaxis" in err
    assert there.read_text(encoding="utf-8") == content


@pytest.mark.parametrize(
    ("words", "out", "suffix"),
    [
        (["import"], "other.csv", ".nc"),
        (["track", "--model", "AXIS", "--identify", "f_m"], "other.csv", ".nc"),
        (["identify", "--model", "one_mass"], "other.nc", ".toml"),
    ],
)
def test_outputs_are_called_what_they_are(words, out, suffix, tmp_path, capsys):
    """Else a second log, a forgotten option away, becomes a record."""
    log, other, axis = tmp_path / "log.csv", tmp_path / out, tmp_path / "axis.toml"
    for path in (log, other):
        made.csv().write(path)
    before = other.read_bytes()
    axis.write_text('model = "one_mass"\nnominal = {k_T = 1, J_m = 0.1, f_m = 0.1}\n')
    command, *given = [str(axis) if word == "AXIS" else word for word in words]
    status, _, err = answer(capsys, command, log, *given, "-o", other)
    assert status == 2 and f"ends in {suffix}" in err and other.read_bytes() == before


@pytest.mark.parametrize("name", ["notes.txt", "log.parquet", "log.csv", "log.mat", "log.h5"])
def test_of_what_is_not_known_nothing_is_ours(name, tmp_path):
    path = tmp_path / name
    path.write_text("time,torque\n0,1\n")
    assert not is_ours(path)


def test_an_axis_of_ours_is_written_again(tmp_path):
    path = tmp_path / "axis.toml"
    path.write_text('model = "one_mass"\nnominal = {k_T = 1, J_m = 0.1, f_m = 0.1}\n')
    axis = find_axis(str(path))
    assert not is_ours(path)
    axis.save(path)
    assert is_ours(path)
    assert find_axis(str(path)) == axis


@pytest.fixture
def log(tmp_path):
    made.csv().write(tmp_path / "log.csv")
    return tmp_path / "log.csv"


@pytest.mark.parametrize("corner", ["900", "-1", "0", "1e-300"])
def test_a_high_pass_that_cannot_be(corner, log, capsys):
    status, _, err = answer(capsys, "identify", log, "--highpass", corner)
    assert status == 2 and "give a corner below half the rate" in err


TOO_STIFF = """model = "two_mass"
nominal = {k_T = 1, J_m = 1e-3, J_l = 1e-3, k = 1e6, d = 0.1, f_m = 0.1, f_l = 0.1}
"""


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        (TOO_STIFF, "below twice the fastest mode"),
        ('model = "two_mas"', "two_mass"),
        ('name = "x"\nstates = ["a"]', "has no A, B, C"),
        ('model = "one_mass"\nnominl = {}', "nominl"),
        ('model = "one_mass"\nnominal = {k_T = 1, J_m = 1}', "f_m"),
    ],
)
def test_axes_that_cannot_be(log, tmp_path, capsys, text, hint):
    axis = tmp_path / "axis.toml"
    axis.write_text(text, encoding="utf-8")
    status, _, err = answer(capsys, "identify", log, "--model", axis)
    assert status == 2 and hint in err, err


def test_unknown_parameters(log, capsys):
    status, _, err = answer(capsys, "identify", log, "--fix", "k_t=1")
    assert status == 2 and "Did you mean 'k_T'" in err
    assert answer(capsys, "track", log, "--model", "two_mass", "--identify", "k")[0] == 2


@pytest.mark.slow
def test_what_the_excitation_cannot_see_is_named(tmp_path, capsys):
    """A rigid motor, shaken fast: its friction is invisible, and the answer says so."""
    rng = np.random.default_rng(0)
    fast = np.diff(rng.standard_normal(8001), 1)
    speed = np.r_[0, np.cumsum(fast[:-1]) * 1e-3 / 1e-2] + rng.standard_normal(8000) * 3e-2
    shaken = {"time": np.arange(8000) / 1000, "torque": fast, "speed": speed}
    (tmp_path / "log.csv").write_text(made.text_of(shaken), encoding="utf-8")
    status, out, _ = answer(capsys, "identify", tmp_path / "log.csv", "--model", "one_mass")
    assert status == 1 and "cannot see f_m" in out
