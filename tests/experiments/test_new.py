"""From the template to a verdict, as a new user would, and beside a user's own packages."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from flexaxis.experiments.cli import main


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my_estimator.py"]) == 0
    return tmp_path / "my_estimator.py"


@pytest.mark.slow
def test_the_template_is_the_shipped_method(mine, short):
    """For f_m alone, from the same P(0)."""
    import numpy as np

    from flexaxis.estimators import Rpem, three_mass
    from flexaxis.experiments.running.estimators import build, parse
    from flexaxis.sim.simulate import simulate

    record, own = simulate(short, [0])[0], build(parse(f"{mine}:Mine"), short)
    found = [own.step(u, y) for u, y in zip(record.torque, record.speed, strict=True)]
    rpem = Rpem(
        three_mass(short.nominal.as_dict()),
        identify=("f_m",),
        P0=[[5e-6]],
        forgetting=0.995,
        period=0.005,
    )
    np.testing.assert_allclose(found, rpem.run(record.torque, record.speed), rtol=1e-8)


def verdict(capsys, *words):
    capsys.readouterr()
    status = main(["compare", "short.toml", *words, "--seeds", "5", "--jobs", "1", "--json"])
    return status, json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_the_template_keeps_the_rules_and_gets_a_verdict(mine, capsys, short_toml):
    """It is told k_T and J_a, so it is quicker than the method that has to find them as well."""
    assert main(["check", f"{mine}:Mine"]) == 0
    words = ["--base", "rpem-forgetting", "--candidate", f"{mine}:Mine"]
    status, told = verdict(capsys, *words)
    assert (status, told["candidate"]) == (0, f"{mine}:Mine") and told["verdict"] != "worse"
    rows = {(row["metric"], row["parameter"]): row for row in told["rows"]}
    assert {name for _, name in rows} <= {"", "f_m"}
    assert rows["lag", "f_m"]["candidate"] < rows["lag", "f_m"]["base"]
    # ten times the gain is three times the noise
    words = ["--base", f"{mine}:Mine", "--candidate", f"{mine}:Mine[forgetting=0.95]"]
    status, told = verdict(capsys, *words)
    assert (status, told["verdict"]) == (1, "worse")
    (std,) = (row for row in told["rows"] if row["metric"] == "std")
    assert std["verdict"] == "worse" and std["candidate"] > 2 * std["base"]


def test_nothing_is_overwritten(mine, capsys):
    mine.write_text("my work")
    assert main(["new", "my_estimator.py"]) == 2
    assert "already exists" in capsys.readouterr().err and mine.read_text() == "my work"


@pytest.mark.slow
def test_a_user_has_packages_of_our_names(tmp_path, short_toml):
    """A folder with experiments/, sim/ and estimators/ of its own, and an estimator using them."""
    for name in ("experiments", "sim", "estimators", "models_mjcf"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"WHOSE = 'mine: {name}'\n")
    (tmp_path / "own.py").write_text(
        "import estimators, experiments, sim\n"
        "assert estimators.WHOSE == 'mine: estimators' and sim.WHOSE == 'mine: sim'\n"
        "assert experiments.WHOSE == 'mine: experiments'\n"
        "class Own:\n"
        "    names, output = ('f_m',), 'speed'\n"
        "    def __init__(self, nominal, period): self.theta = [nominal['f_m']]\n"
        "    def step(self, u, y): return self.theta\n"
    )
    words = ["run", str(short_toml), "--estimator", "own.py:Own", "--estimator", "frozen"]
    done = subprocess.run(
        [Path(sys.executable).with_name("flexaxis"), *words, "--seeds", "4", "--jobs", "2"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "own.py:Own" in done.stdout
