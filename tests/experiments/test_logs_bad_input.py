"""Logs that cannot be used are answered in words, with status 2."""

import numpy as np
import pytest

from flexaxis.experiments.cli import main

N = 2000
t = np.arange(N) / 1000
rng = np.random.default_rng(0)
u = rng.standard_normal(N)
phi = np.cumsum(np.cumsum(u)) * 1e-5
GOOD = {"time": t, "torque": u, "angle": phi}


def csv(path, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{v:.12g}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def answer(capsys, *words):
    status = main([str(word) for word in words])
    err = capsys.readouterr().err
    assert "Traceback" not in err
    return status, err


def test_the_good_one_is_accepted(tmp_path, capsys):
    assert answer(capsys, "import", csv(tmp_path / "log.csv", GOOD))[0] == 0


SPIN = np.degrees(np.cumsum(np.full(N, 0.05)) + phi) % 360
CASES = {
    "missing column": (GOOD, ["--torque", "torqe"], "Did you mean 'torque'"),
    "no torque": ({"time": t, "angle": phi}, [], "--torque COLUMN"),
    "no time": ({"torque": u, "angle": phi}, [], "--rate HZ"),
    "degrees": (GOOD | {"angle": SPIN}, [], "--unit angle=deg"),
    "rpm": (GOOD | {"speed": np.gradient(phi, t) * 9.5493}, [], "--unit speed=rpm"),
    "microseconds": (GOOD | {"time": t * 1e6}, [], "--unit time=us"),
    "unknown unit": (GOOD, ["--unit", "angle=furlong"], "rad"),
    "not monotone": (GOOD | {"time": np.r_[t[:500], t[499:-1]]}, [], "at sample 500"),
    "constant": (GOOD | {"torque": np.ones(N)}, [], "torque is constant"),
    "too short": ({k: v[:50] for k, v in GOOD.items()}, [], "200 or more"),
    "resample": (GOOD, ["--resample", "20"], "200 are needed"),
    "scale": (GOOD, ["--scale", "torque=x"], "not a number"),
    "scale of what": (GOOD, ["--scale", "torq=2"], "Did you mean 'torque'"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_logs(case, tmp_path, capsys):
    columns, words, hint = CASES[case]
    status, err = answer(capsys, "import", csv(tmp_path / "log.csv", columns), *words)
    assert status == 2 and hint in err, err
    assert not list(tmp_path.glob("*.nc"))


def test_text_that_is_no_table(tmp_path, capsys):
    path = tmp_path / "log.csv"
    path.write_text("time,torque,angle\n1,2,3\n1,2,3,4\n", encoding="utf-8")
    status, err = answer(capsys, "import", path)
    assert status == 2 and "line 3 has 4 cells" in err
    path.write_bytes(b"\x00\x01\x02" * 100)
    assert "neither CSV nor MAT nor HDF5" in answer(capsys, "import", path)[1]
    assert "no such file" in answer(capsys, "import", tmp_path / "no.csv")[1].lower()


@pytest.mark.parametrize("corner", ["900", "-1", "0", "1e-300"])
def test_a_high_pass_that_cannot_be(corner, tmp_path, capsys):
    log = csv(tmp_path / "log.csv", GOOD)
    status, err = answer(capsys, "identify", log, "--highpass", corner)
    assert status == 2 and "give a corner below half the rate" in err


def test_rate_below_twice_the_fastest_mode(tmp_path, capsys):
    axis = tmp_path / "axis.toml"
    axis.write_text(
        'model = "two_mass"\nnominal = {k_T = 1, J_m = 1e-3, J_l = 1e-3, k = 1e6, d = 0.1, '
        "f_m = 0.1, f_l = 0.1}\n",
        encoding="utf-8",
    )
    log = csv(tmp_path / "log.csv", GOOD)
    status, err = answer(capsys, "identify", log, "--model", axis)
    assert status == 2 and "below twice the fastest mode" in err


@pytest.mark.slow
def test_what_the_excitation_cannot_see_is_named(tmp_path, capsys):
    """A rigid motor, shaken fast: its friction is invisible, and the answer says so."""
    fast = np.diff(rng.standard_normal(8001), 1)
    speed = np.cumsum(fast[:-1]) * 1e-3 / 1e-2
    columns = {
        "time": np.arange(8000) / 1000,
        "torque": fast,
        "speed": np.r_[0, speed] + rng.standard_normal(8000) * 3e-2,
    }
    log = csv(tmp_path / "log.csv", columns)
    status = main(["identify", str(log), "--model", "one_mass"])
    out = capsys.readouterr().out
    assert status == 1 and "cannot see f_m" in out


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ('model = "two_mas"', "two_mass"),
        ('name = "x"\nstates = ["a"]', "has no A, B, C"),
        ('model = "one_mass"\nnominl = {}', "nominl"),
        ('model = "one_mass"\nnominal = {k_T = 1, J_m = 1}', "f_m"),
    ],
)
def test_bad_models(tmp_path, capsys, text, hint):
    axis = tmp_path / "axis.toml"
    axis.write_text(text, encoding="utf-8")
    status, err = answer(capsys, "identify", csv(tmp_path / "log.csv", GOOD), "--model", axis)
    assert status == 2 and hint in err, err


def test_unknown_parameters(tmp_path, capsys):
    log = csv(tmp_path / "log.csv", GOOD)
    status, err = answer(capsys, "identify", log, "--fix", "k_t=1")
    assert status == 2 and "Did you mean 'k_T'" in err
    assert answer(capsys, "track", log, "--model", "two_mass", "--identify", "k")[0] == 2
