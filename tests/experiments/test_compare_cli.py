"""`flexaxis compare` as a program: what goes where, and the status a build server sees."""

import json

import pytest

from tests.experiments.command import flexaxis

pytestmark = pytest.mark.usefixtures("recorded")
SLOW = "rpem-forgetting[forgetting=0.999]"  # 2 s after the fault its lag is twice as long


def compare(capsys, short_toml, tmp_path, candidate, *more):
    words = ("--base", "rpem-forgetting", "--candidate", candidate, "--seeds", "8", "--jobs", "1")
    return flexaxis(capsys, "compare", short_toml, *words, "-o", tmp_path / "out", *more)


def test_a_regression(capsys, short_toml, tmp_path):
    status, out, _ = compare(capsys, short_toml, tmp_path, SLOW)
    assert status == 1
    assert out.startswith("WORSE: lag of f_m")
    assert out.splitlines()[-1] == f"report: {tmp_path / 'out' / 'report.html'}"


def test_no_regression_in_json_only(capsys, short_toml, tmp_path):
    status, out, _ = compare(capsys, short_toml, tmp_path, "rpem-forgetting", "--json")
    told = json.loads(out)
    assert status == 0 and told["verdict"] == "same" and told["status"] == 0
    assert {row["metric"] for row in told["rows"]} == {"lag", "std"}
    assert (told["look"], told["looks"]) == (1, 1)


@pytest.mark.slow
def test_a_diverging_candidate_is_a_regression(capsys, short_toml, tmp_path):
    wild = tmp_path / "wild.py"
    wild.write_text(
        "class Wild:\n"
        "    names, output = ('f_m',), 'speed'\n"
        "    def __init__(self, nominal, period): self.theta = nominal['f_m']\n"
        "    def step(self, u, y):\n"
        "        self.theta *= 2\n"
        "        return [self.theta]\n"
    )
    found = compare(capsys, short_toml, tmp_path, f"{wild}:Wild", "--seeds", "10", "--json")
    told = json.loads(found[1])
    lost = next(row for row in told["lost"] if row["way"] == "diverged")
    assert (found[0], told["verdict"]) == (1, "worse")
    assert (lost["verdict"], lost["base"], lost["candidate"]) == ("worse", 0, 10)
    status, out, _ = compare(capsys, short_toml, tmp_path, f"{wild}:Wild", "--seeds", "2")
    assert status == 3 and "2 of 2 runs newly diverge" in out


@pytest.mark.parametrize("more", [(), (".", "--match-std"), (".", "--max-seeds", "64")])
def test_stored_runs_need_two_folders_and_no_new_runs(capsys, tmp_path, more):
    status, _, err = flexaxis(capsys, "compare", ".", *more, "-o", tmp_path)
    assert status == 2 and "name two folders, and omit --match-std" in err


@pytest.mark.slow
def test_stored_runs(capsys, short_toml, tmp_path):
    for name, estimator in (("old", "rpem-forgetting"), ("new", SLOW)):
        words = ("--estimator", estimator, "--seeds", "8", "--jobs", "1", "-o", tmp_path / name)
        assert flexaxis(capsys, "run", short_toml, *words)[0] == 0
    words = (tmp_path / "old", tmp_path / "new", "-o", tmp_path / "out")
    status, out, _ = flexaxis(capsys, "compare", *words)
    assert status == 1 and "WORSE: lag of f_m" in out
    status, out, _ = flexaxis(capsys, "compare", *words, "--seeds", "1002:1005", "--json")
    assert json.loads(out)["seeds"] == [1002, 1003, 1004]


RAISES = """
from flexaxis.estimators.registry import REGISTRY


class Same:
    output = "speed"

    def __init__(self, nominal, period):
        self._of, self.k = REGISTRY["rpem-forgetting"].factory(nominal, period), 0
        self.names = self._of.names

    def step(self, u, y):
        return self._of.step(u, y)


class Raises(Same):
    def step(self, u, y):
        self.k += 1
        if self.k == 1500 and y > {level}:
            raise ArithmeticError("not sure")
        return self._of.step(u, y)
"""


def own(tmp_path, level):
    (tmp_path / "raises.py").write_text(RAISES.format(level=level))
    return f"{tmp_path}/raises.py:"


@pytest.mark.slow
def test_a_candidate_that_raises_loses_these_runs(capsys, short_toml, tmp_path):
    of = own(tmp_path, 0.0)
    words = ("--base", f"{of}Same", "--json")
    status, out, _ = compare(capsys, short_toml, tmp_path, f"{of}Raises", *words)
    told = json.loads(out)
    assert status == 3 and told["verdict"] == "undecided"
    assert 0 < told["failed"]["candidate"] < 8


@pytest.mark.slow
def test_a_scenario_that_the_candidate_cannot_read_is_in_the_verdict(
    capsys, short, short_toml, tmp_path
):
    (tmp_path / "encoder.toml").write_text(
        short.override({"name": "encoder", "output": "increment"}).to_toml()
    )
    both = (str(short_toml), str(tmp_path / "encoder.toml"))
    words = ("--seeds", "2", "--jobs", "1", "-o", tmp_path / "out", "--json")
    candidate = f"{own(tmp_path, 1e9)}Same"
    sides = ("--base", "rpem-forgetting", "--candidate", candidate)
    status, out, _ = flexaxis(capsys, "compare", *both, *sides, *words)
    told = json.loads(out)
    assert (status, told["verdict"]) == (0, "undecided")
    assert told["gaps"] == [["candidate", "the candidate cannot run on encoder", False]]
    assert flexaxis(capsys, "compare", *both, *sides, *words, "--strict")[0] == 3
    sides = ("--base", candidate, "--candidate", candidate)
    _, out, err = flexaxis(capsys, "compare", *both, *sides, *words)
    assert "scenario encoder is omitted" in err and not json.loads(out)["gaps"]
