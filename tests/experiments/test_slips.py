"""Numbers that nobody means: refused in a line before any work, and before memory is full."""

import itertools
import re

import numpy as np
import pytest

import flexaxis as fx
from flexaxis.estimators.offline.colour import colourless
from flexaxis.experiments.building.processes import MOST, check_jobs
from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.identify import LOWEST
from flexaxis.experiments.logs.mapping import LogMap, Raw, mapping_from, pick
from flexaxis.experiments.logs.prepare import prepare
from flexaxis.experiments.logs.reading.log import Log
from flexaxis.experiments.running import seeds
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.seeds import parse_seeds
from flexaxis.experiments.storage.files import StudyError
from flexaxis.experiments.studies.definition import study_from
from flexaxis.sim.errors import FlexaxisError

HUGE = str(10**21)
LINES = [
    ["run", "fm_step-v1", "--seeds", HUGE],
    ["run", "fm_step-v1", "--seeds", f"{2**63}:{2**63 + 1}"],
    ["run", "fm_step-v1", "--jobs", "10000"],
    ["simulate", "fm_step-v1", "--seed", HUGE],
    ["simulate", "fm_step-v1", "--as-log", "csv", "--gaps", "1000000"],
    ["compare", "--base", "frozen", "--candidate", "frozen", "--max-seeds", HUGE],
    ["import", "log.csv", "--resample", "1e300"],
]


@pytest.mark.parametrize("words", LINES, ids=lambda words: " ".join(words)[:60])
def test_of_an_option(capsys, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_text("t,u,phi\n0,1,2\n0.1,1,3\n")
    try:
        status = main(words)
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    (line,) = [line for line in err.splitlines() if line.startswith("flexaxis")]
    assert (status, out) == (2, "") and words[-2] in line and len(line) < 200, err
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (10**21, "at most 100000 seeds"),
        (itertools.count(), "at most 100000 seeds"),
        ([2**63], "below 2\\^63"),
        ([True], "a whole number"),
        ([-1], "a whole number"),
    ],
)
def test_of_seeds_from_python(given, said):
    with pytest.raises(FlexaxisError, match=said):
        fx.benchmark("frozen", scenarios="fm_step-v1", seeds=given)


@pytest.mark.parametrize("jobs", [0, -1, "2", 2.0, True, None, 10**21])
def test_of_processes_from_python(jobs):
    with pytest.raises(FlexaxisError, match=r"jobs .*processes"):
        fx.benchmark("frozen", scenarios="fm_step-v1", seeds=1, jobs=jobs)


@pytest.mark.parametrize("jobs", [1, np.int64(2), MOST])
def test_numbers_of_processes(jobs):
    check_jobs(jobs)


def test_as_many_seeds_as_may_be():
    assert len(parse_seeds(str(seeds.MOST))) == seeds.MOST
    assert parse_seeds(f"{seeds.END - 2}:{seeds.END}") == [seeds.END - 2, seeds.END - 1]


def study(**more):
    asked = {"name": "s", "scenario": "fm_step-v1", "estimators": ["frozen"], "seeds": 2}
    return study_from(asked | more)


@pytest.mark.parametrize(
    "more",
    [
        {"sweep": {f"fault[0].{key}": [*range(1, 1001)] for key in ("factor", "at")}},
        {"sweep": {"fault[0].factor": {"low": 1, "high": 2}}, "design": "sobol", "samples": 10**6},
        {"seeds": 2**31},
    ],
)
def test_of_a_study(more):
    with pytest.raises(StudyError, match=r"100,?000"):
        study(**more)


def test_of_a_study_whose_parts_are_not_too_large():
    """A thousand points and twenty thousand seeds: ten million rows twice."""
    factors = [1 + i / 1000 for i in range(1000)]
    large = study(sweep={"fault[0].factor": factors}, seeds=20_000)
    with pytest.raises(StudyError, match=r"1000 points × 1 estimators × 20000 seeds .*too many"):
        make_plan(large)


def test_the_lowest_high_pass_can_be_computed():
    """What is left after some thousand samples of a constant is the constant, almost."""
    found = colourless(LOWEST / 0.005, 0.005).high(np.ones(5000))
    assert found[-1] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("rate", [0.0, 1e-300, 1e300])
def test_of_a_rate(rate):
    with pytest.raises(LogError, match="rate is"):
        mapping_from({"torque": "u", "angle": "phi", "rate": rate}, source="map.toml")


@pytest.mark.parametrize("period", [8.0, 1e6])
def test_of_a_sample_every_hour(period):
    time = period * np.arange(400)
    raw = Raw(time, np.sin(time), None, np.cos(time), None, frozenset())
    with pytest.raises(LogError, match=re.escape(f"a sample every {period:.3g} s")):
        prepare(raw)


def test_of_a_torque_that_no_one_could_measure():
    values = {"u": np.array([1e-320, 3e-320, 0.0]), "phi": np.array([0.0, 1.0, 2.0])}
    log = Log("log.csv", ("u", "phi"), lambda names, strict=True: {n: values[n] for n in names})
    with pytest.raises(LogError, match=r"column 'u' is never more than 3e-320"):
        pick(log, LogMap(torque="u", angle="phi", rate=100.0))
