"""Mistakes at the front door and on the command line: each is one clear error, before any work."""

import numpy as np
import pytest

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.cli import main
from flexaxis.experiments.running.estimators import parse, text_of
from flexaxis.experiments.running.user_code import EstimatorCrash
from flexaxis.sim.errors import FlexaxisError


class Still:
    """Stays at nominal f_m."""

    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period, *, factor=1.0):
        self.theta = [factor * nominal["f_m"]]

    def step(self, u, y):
        return self.theta


def named_still():
    class Still:
        names, output = ("f_m",), "speed"

    return Still


def made(source):
    """A class whose text nobody can read."""
    content = {"__name__": "__main__"}
    exec(source, content)
    return content["Hidden"]


def test_two_classes_of_one_name_are_refused(short):
    one, other = named_still(), named_still()
    with pytest.raises(EstimatorError, match=r"two classes have the name Still.*named_still"):
        fx.benchmark([one, other], scenarios=short, seeds=1)


def test_classes_without_text_are_told_apart():
    first = parse(text_of(made("class Hidden: a = 1"))).digest
    assert first == parse("Hidden").digest
    assert first != parse(text_of(made("class Hidden: a = 2"))).digest


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"estimators": []}, "no estimator"),
        ({"scenarios": []}, "no scenario"),
        ({"seeds": 2.0}, "seeds 2.0"),
        ({"seeds": True}, "seeds True"),
        ({"seeds": [1.5]}, "seed 1.5"),
        ({"seeds": []}, "at least one"),
        ({"seeds": 0}, "^seeds '0': give a number"),
        ({"seeds": [1, 2, 1]}, "seeds: 1 is given more than once"),
        ({"estimators": [None]}, "no estimator was given: give its name"),
    ],
)
def test_a_benchmark_of_nothing(short, given, words):
    given = {"estimators": "frozen", "scenarios": short, "seeds": 1} | given
    with pytest.raises((FlexaxisError, EstimatorError), match=words):
        fx.benchmark(given.pop("estimators"), **given)


@pytest.mark.parametrize("seed", [1.5, True, None, "1", -1])
def test_a_seed_that_is_no_number_of_a_run(short, seed):
    for take in (fx.simulate, fx.make_axis):
        with pytest.raises(FlexaxisError, match="whole number"):
            take(short, seed=seed)


def test_a_seed_of_numpy_is_one(short):
    assert fx.simulate(short, seed=np.int64(3)).seed == 3


@pytest.mark.parametrize("value", [None, float("nan"), np.inf, {"a": 1}, [None]])
def test_an_option_that_cannot_be_written(short, value):
    with pytest.raises(EstimatorError, match="forgetting"):
        fx.estimate(fx.simulate(short), "rpem-forgetting", options={"forgetting": value})


def test_an_option_of_numpy_is_a_number(short):
    found = fx.estimate(fx.simulate(short), "frozen")
    assert found.last
    options = {"forgetting": np.float32(0.9375)}
    found = fx.estimate(fx.simulate(short), "rpem-forgetting", options=options)
    assert found.estimator == "rpem-forgetting[forgetting=0.9375]"


@pytest.mark.parametrize("torque", ["a", None, np.array([0.1]), [0.1], float("nan"), 1j, True])
def test_a_torque_that_is_no_number(short, torque):
    with pytest.raises(FlexaxisError, match="one finite number"):
        fx.make_axis(short).step(torque)


def test_a_torque_of_numpy_is_one(short):
    samples = [fx.make_axis(short).step(torque) for torque in (1, np.float32(1), np.array(1.0))]
    assert len({sample.speed for sample in samples}) == 1


def test_an_axis_of_no_study_is_not_drawn(short):
    found = fx.benchmark("frozen", scenarios=short, seeds=1)
    with pytest.raises(FlexaxisError, match="nothing was swept"):
        found.plot("nope")


def test_scores_are_of_an_estimator_or_an_estimate(short):
    record = fx.simulate(short)
    with pytest.raises(EstimatorError, match="a record has no scores, an estimator has: give one"):
        fx.score(record)
    scores = fx.score(record, "frozen")
    assert scores[0]["estimator"] == "frozen"
    head = repr(scores).splitlines()[0]
    assert "lag [s]" in head and "std [% of nominal]" in head and "diverged  " not in head
    assert "lag [s]" in scores[:1]._repr_html_()
    with pytest.raises(EstimatorError, match="an estimate by frozen already"):
        fx.score(fx.estimate(record, "frozen"), "ekf")


def test_a_scenario_is_no_record():
    with pytest.raises(FlexaxisError, match=r"fx.estimate\(fx.simulate\('fm_step-v1'\), …\)"):
        fx.estimate("fm_step-v1", "frozen")


@pytest.mark.parametrize("instance", [False, True])
def test_an_estimate_that_is_not_finite_is_a_warning(short, instance):
    class Lost(Still):
        def step(self, u, y):
            return [float("nan") if y is None or y > 0 else 1.0]

    record = fx.simulate(short)
    made = Lost({"f_m": 1.0}, 0.005) if instance else Lost
    with pytest.warns(UserWarning, match=r"Lost returned .* of 1600 samples, first at sample \d+"):
        fx.estimate(record, made)


def test_an_instance_is_a_guest(short, capsys):
    class Ends(Still):
        def step(self, u, y):
            print("in between")
            raise SystemExit(3)

    with pytest.raises(EstimatorCrash, match=r"Ends crashed .*sample 0"):
        fx.estimate(fx.simulate(short), Ends(short.nominal.as_dict(), 0.005))
    out, err = capsys.readouterr()
    assert not out and "in between" in err


MISTAKES = [
    (["run", "smoke", "--time-limit", "nan"], "above 0"),
    (["list", "--gruop=steps"], "unknown option '--gruop=steps'. Did you mean '--group'?"),
    (["new", "sub/x.py"], "sub/x.py: there is no folder sub: make it first"),
    (["simulate", "fm_step-v1", "--seed", "-1"], "--seed -1: give a whole number"),
]


@pytest.mark.parametrize(("words", "said"), MISTAKES)
def test_a_mistake_on_the_command_line(capsys, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(words)
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    assert (status, out) == (2, "") and said in err
    assert not list(tmp_path.iterdir())


def test_paths_and_generators_are_taken(short_toml):
    from pathlib import Path

    path = Path(short_toml)
    assert len(fx.simulate(path).torque) == len(fx.simulate(str(path)).torque)
    found = fx.benchmark((e for e in ["frozen"]), scenarios=(s for s in [path]), seeds=1)
    assert set(found.scores()["estimator"]) == {"frozen"}


@pytest.mark.parametrize("given", [None, 3, b"short.toml"])
def test_what_is_no_scenario_is_told_as_such(given):
    with pytest.raises(FlexaxisError, match=r"is no scenario: give a name"):
        fx.simulate(given)
