"""No command writes over what it reads; what is written is written whole."""

import os
import shutil

import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.files import write_json, write_text
from flexaxis.sim.simulate import simulate

OWN = """\
class Own:
    names, output = ("f_m",), "speed"
    def __init__(self, nominal, period): self.theta = [nominal["f_m"]]
    def step(self, u, y): return self.theta
"""
STUDY = 'scenario = "short.toml"\nestimators = ["frozen"]\nseeds = 2\n'
LOG = ["--torque", "torque", "--angle", "angle", "--time", "time"]
FOLDERS = ("run", "share", "merged")


@pytest.fixture(scope="module")
def made(short, tmp_path_factory):
    """One of everything that a command reads."""
    folder = tmp_path_factory.mktemp("made")
    simulate(short, [0])[0].save(folder / "rec.nc")
    (folder / "short.toml").write_text(short.to_toml(), encoding="utf-8")
    (folder / "own.py").write_text(OWN, encoding="utf-8")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    for name in ("map.toml", "axis.toml", "lesson.gif"):
        (folder / name).write_text("", encoding="utf-8")
    one = ["--jobs", "1", "-o"]
    run = ["run", str(folder / "short.toml"), "--estimator", "frozen", "--seeds", "2"]
    assert main([*run, *one, str(folder / "run")]) == 0
    assert main(["study", str(folder / "study.toml"), *one, str(folder / "share")]) == 0
    return folder


@pytest.fixture
def here(made, tmp_path, monkeypatch):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "linked.nc").symlink_to("rec.nc")
    os.link(tmp_path / "rec.nc", tmp_path / "twin.nc")
    return tmp_path


def content(folder):
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


TRACK = ["track", "rec.nc", "--identify", "k_T", "--model"]
REFUSED = {
    "simulate": ["simulate", "short.toml", "-o", "short.toml"],
    "estimate": ["estimate", "rec.nc", "-o", "rec.nc"],
    "estimate, another name": ["estimate", "rec.nc", "-o", "run/../rec.nc"],
    "estimate, a folder to be made": ["estimate", "rec.nc", "-o", "nowhere/../rec.nc"],
    "estimate, a link": ["estimate", "rec.nc", "-o", "linked.nc"],
    "estimate, of a link": ["estimate", "linked.nc", "-o", "rec.nc"],
    "estimate, a hard link": ["estimate", "rec.nc", "-o", "twin.nc"],
    "estimate, scenario": ["estimate", "rec.nc", "--scenario", "short.toml", "-o", "short.toml"],
    "estimate, code": ["estimate", "rec.nc", "--estimator", "own.py:Own[a=1]", "-o", "own.py"],
    "import": ["import", "rec.nc", *LOG, "-o", "rec.nc"],
    "import, map": ["import", "rec.nc", "--map", "map.toml", "-o", "map.toml"],
    "identify": ["identify", "rec.nc", "-o", "rec.nc"],
    "identify, model": ["identify", "rec.nc", "--model", "axis.toml", "-o", "axis.toml"],
    "identify, map": ["identify", "rec.nc", "--map", "map.toml", "-o", "map.toml"],
    "track": [*TRACK, "axis.toml", "-o", "rec.nc"],
    "track, model": [*TRACK, "axis.toml", "-o", "axis.toml"],
    "track, code": [*TRACK, "axis.toml", "--estimator", "own.py:Own", "-o", "own.py"],
    "report": ["report", "run", "-o", "run/summary.json"],
    "report, rows": ["report", "run", "-o", "run/scores.sqlite"],
    "shards": ["study", "--from", "share", "-o", "share"],
    "study": ["study", "study.toml", "-o", "study.toml"],
    "demo": ["demo", "--script", "lesson.gif", "--record", "lesson.gif"],
    "compare": ["compare", "run", "share/../run", "-o", "run"],
}


@pytest.mark.parametrize("case", REFUSED)
def test_an_input_is_refused_as_output(here, capsys, case):
    before = content(here)
    assert main(REFUSED[case]) == 2
    out, err = capsys.readouterr()
    assert content(here) == before
    assert (out, len(err.splitlines())) == ("", 1) and err.startswith("flexaxis: ")
    assert "is an input of this command" in err


def test_a_text_that_cannot_be_written_whole_leaves_the_old_one(tmp_path):
    target = tmp_path / "results.json"
    write_json(target, {"k_T": 1.0})
    with pytest.raises(ValueError, match="JSON"):
        write_json(target, {"k_T": float("nan")})
    with pytest.raises(UnicodeEncodeError):
        write_text(target, "half a text, then \ud800")
    assert target.read_text() == '{\n "k_T": 1.0\n}\n'
    assert [path.name for path in tmp_path.iterdir()] == ["results.json"]
