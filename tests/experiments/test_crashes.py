"""What crashes says whose code it was and where, with a status that no finding has."""

from dataclasses import replace

import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.cli import main
from flexaxis.experiments.commands import answers
from flexaxis.experiments.commands.answers import CRASH, FINDING, WRONG_USE
from flexaxis.experiments.demo.racer import Racer
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.track import track
from flexaxis.sim.parameters import preset
from flexaxis.sim.simulate import simulate

OWN = """\
import os, sys


class Base:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.theta = [nominal["f_m"]]

    def step(self, u, y):
        return self.theta


class Key(Base):
    def __init__(self, nominal, period):
        nominal["f_q"]  # line 16


class Value(Base):
    def __init__(self, nominal, period):
        int("two")  # line 21


class Ends(Base):
    def __init__(self, nominal, period):
        sys.exit(1)  # line 26


class Needs(Base):
    def __init__(self, nominal, period, more):
        pass


class Dies(Base):
    def __init__(self, nominal, period):
        os.kill(os.getpid(), 9)
        super().__init__(nominal, period)


class Unknown(Base):
    names = ("f_mm",)


class Inverse(Base):
    names = ("k_T", "1/j_a")


class Text(Base):
    names = "f_m"


class Number(Base):
    names = 5


class Numbers(Base):
    names = (5,)


class Nothing(Base):
    names = ()


class Twice(Base):
    names = ("J_a", "1/J_a")


class Damping(Base):
    names = ("1/d_g",)
"""
RUN = ["run", "short.toml", "--seeds", "2", "--estimator"]
COMPARE = ["compare", "short.toml", "--base", "frozen", "--seeds", "2", "--candidate"]
COMMANDS = {"run": RUN, "compare": COMPARE, "check": ["check"]}


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch, short_toml):
    (tmp_path / "own.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)


def told(capsys, *words):
    status = main([str(word) for word in words])
    return status, capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Unknown", "own.py:Unknown: names[0]: unknown parameter 'f_mm'; known are k_T, "),
        ("Unknown", "Did you mean 'f_m'?"),
        ("Inverse", "names[1]: unknown parameter '1/j_a'"),
        ("Inverse", "Did you mean '1/J_a'?"),
        ("Text", "`names` must be a sequence of parameters, such as ('k_T', '1/J_a') or ('f_m',), "
         "not 'f_m'"),
        ("Number", "`names` must be a sequence of parameters"),
        ("Numbers", "`names` must be a sequence of parameters"),
        ("Nothing", "`names` must be a sequence of parameters"),
        ("Twice", "names[1]: '1/J_a' after 'J_a': name each once"),
    ],
)  # fmt: skip
def test_names_that_cannot_be_scored(capsys, command, name, said):
    status, err = told(capsys, *COMMANDS[command], f"own.py:{name}")
    assert status == WRONG_USE and said in err and len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"parameters.d_g": 0.0}, "names[0]: '1/d_g' cannot be estimated where parameters.d_g is "),
        ({"fault[0].parameter": "d_g", "fault[0].factor": 0.0}, "fault[0].factor: must be above 0"),
    ],
)
def test_names_that_this_scenario_makes_impossible(capsys, short, tmp_path, change, said):
    (tmp_path / "zero.toml").write_text(short.override({"name": "zero"} | change).to_toml())
    status, err = told(capsys, "run", "zero.toml", "--estimator", "own.py:Damping", "--seeds", "2")
    assert status == WRONG_USE and said in err and len(err.splitlines()) == 1


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(
    ("name", "what", "line"),
    [("Key", "nominal has no 'f_q'. Did you mean 'f_m'?", 16),
     ("Value", "ValueError: invalid literal", 21),
     ("Ends", "SystemExit: 1", 26)],
)  # fmt: skip
def test_a_constructor_that_raises(capsys, command, name, what, line):
    words = [*COMMANDS[command], f"own.py:{name}"]
    status, err = told(capsys, *words)
    assert status == CRASH and len(err.splitlines()) == 1
    assert what in err and f"own.py:{line})" in err and "Traceback" not in err
    assert name == "Ends" or f"own.py:{name} crashed when it was made: " in err
    for traced in (["--traceback", *words], [*words, "--traceback"]):
        status, err = told(capsys, *traced)
        assert status == CRASH and "Traceback" in err and what in err


def test_whoever_builds_an_estimator_refuses_it_in_the_same_words(short):
    """Of the demo and of a log too, which tell it other values and have other knobs."""
    axis, log = replace(find_axis("three_mass"), known=True), simulate(short, [0])[0]
    builders = (
        lambda spec: build(spec, short),
        lambda spec: track(log, axis, spec, identify=["f_m"]),
        lambda spec: Racer(spec, preset("n1")),
    )
    for name in ("Key", "Value", "Needs", "Text", "Number", "Nothing"):
        said = set()
        for builder in builders:
            with pytest.raises(EstimatorError) as raised:
                builder(parse(f"own.py:{name}"))
            said.add((type(raised.value), str(raised.value)))
        assert len(said) == 1, name


@pytest.mark.parametrize("text", ["builtins:int", "math:pi", "builtins:None"])
def test_what_cannot_be_made_at_all_is_wrong_use(capsys, text):
    status, err = told(capsys, *RUN, text)
    assert status == WRONG_USE and text in err and len(err.splitlines()) == 1


def test_a_constructor_that_asks_for_more_is_wrong_use(capsys):
    status, err = told(capsys, *RUN, "own.py:Needs")
    assert status == WRONG_USE and "missing 1 required positional argument: 'more'" in err


@pytest.mark.parametrize("option", ['forgetting="x"', "forgetting=[0.9, 0.8]", "P0=[1, 2]"])
def test_an_option_that_a_shipped_one_refuses_is_wrong_use(capsys, option):
    status, err = told(capsys, *RUN, f"rpem-forgetting[{option}]")
    assert status == WRONG_USE and len(err.splitlines()) == 1


@pytest.mark.parametrize("command", COMMANDS)
def test_a_constructor_that_ends_its_process(capsys, command):
    status, err = told(capsys, *COMMANDS[command], "own.py:Dies")
    assert status == CRASH and len(err.splitlines()) == 1
    assert "own.py:Dies crashed when it was made: its process died: " in err


def test_a_fault_of_our_own_is_a_crash_as_well(capsys, monkeypatch):
    from flexaxis.experiments.catalogue import names

    monkeypatch.setattr(names, "_kept", lambda: 1 / 0)
    status, err = told(capsys, "list")
    assert status == CRASH and "ZeroDivisionError" in err and len(err.splitlines()) == 1


def test_no_crash_looks_like_something_else():
    statuses = {name: getattr(answers, name) for name in
                ("FINE", "FINDING", "WRONG_USE", "UNDECIDED", "CRASH", "INTERRUPTED")}  # fmt: skip
    assert len(set(statuses.values())) == 6 and (CRASH, FINDING) == (70, 1)
    assert statuses["INTERRUPTED"] == 130


@pytest.mark.slow
def test_traceback_is_no_part_of_the_command_that_is_kept(capsys, tmp_path):
    words = [*RUN, "frozen", "-o", "out"]
    assert main(["--traceback", *words]) == 0
    assert "--traceback" not in (tmp_path / "out" / "summary.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("place", ["missing/t.toml", "."])
def test_where_tuning_cannot_be_saved_is_said_before_it(capsys, monkeypatch, place):
    from flexaxis.experiments.studies import tuning

    monkeypatch.setattr(tuning, "match_noise", lambda *args: pytest.fail("tuned first"))
    words = ["tune", "ekf", "--seeds", "0:2", "--jobs", "1", "--save", place]
    status, err = told(capsys, *words)
    assert status == WRONG_USE and place in err and "Nothing was tuned" in err
