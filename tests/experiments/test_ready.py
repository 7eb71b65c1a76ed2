"""Estimators that are made once and reset: nobody can tell them from new ones."""

import numpy as np
import pytest

from flexaxis.estimators.errors import EstimatorError
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building import ready as ready_
from flexaxis.experiments.building.estimator_text import build, parse
from flexaxis.experiments.building.ready import ready
from flexaxis.experiments.running.case import followed
from flexaxis.sim.simulate import simulate

SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in REGISTRY if "friction" in name]
OWN = """class Mine:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        pass

    def step(self, u, y):
        return [0.05]

    def reset(self):
        pass
"""


@pytest.fixture(scope="module")
def records():
    from flexaxis.experiments.catalogue.find import find_scenario

    short = find_scenario("fm_step-v1").override({"duration": 4.0, "fault[0].at": 3.0})
    return short, simulate(short, [0, 1])


@pytest.mark.parametrize("name", [*(name for name in REGISTRY if "friction" not in name), *SLOW])
def test_to_the_last_bit_it_is_a_new_one(records, name):
    scenario, (one, other) = records
    spec = parse(name)
    used = ready(spec, scenario)
    followed(name, used, scenario, one)
    found, new = ready(spec, scenario), build(spec, scenario)
    assert found is used or not hasattr(new, "reset")
    for mine, its in zip(
        followed(name, found, scenario, other), followed(name, new, scenario, other), strict=True
    ):
        np.testing.assert_array_equal(mine, its)
    assert repr(getattr(found, "findings", ())) == repr(getattr(new, "findings", ()))


def test_it_is_made_anew_where_it_is_offered_something_else(records):
    scenario, _ = records
    spec = parse("rpem-forgetting")
    same = [scenario.override({"fault[0].factor": 2.0}), scenario.override({"name": "other"})]
    assert {id(ready(spec, each)) for each in (scenario, *same)} == {id(ready(spec, scenario))}
    for changes in ({"start": 1.2}, {"output": "increment"}, {"identify": ["k_T", "f_m"]},
                    {"told": {"noise": 0.1}}, {"told": {"k_g": 1.1}}):  # fmt: skip
        assert ready(spec, scenario.override(changes)) is not ready(spec, scenario), changes
    assert ready(parse("rpem-forgetting[forgetting=0.99]"), scenario) is not ready(spec, scenario)


def test_it_is_made_anew_for_another_period(records):
    """Also where the period shows in nothing else, as with P(0) given."""
    scenario, _ = records
    spec = parse("rpem-forgetting[P0=[1e-4, 1e-4, 1e-4]]")
    assert ready(spec, scenario.override({"period": 0.01})) is not ready(spec, scenario)


def test_long_arrays_that_are_offered_are_told_apart(records, monkeypatch):
    """By a sample in their middle, which no text of an array shows."""
    scenario, _ = records
    one, other = np.zeros((2, 8000))
    other[4000] = 1.0
    found = []
    for torque in (one, other, one.copy()):
        monkeypatch.setattr(
            ready_, "offered_to", lambda *_, torque=torque, **__: {"torque": torque}
        )
        found.append(ready(parse("frozen"), scenario))
    assert found[0] is not found[1] and found[0] is found[2]


def test_who_reads_another_output_is_refused_each_time(records):
    scenario = records[0].override({"output": "increment"})
    for _ in range(2):
        with pytest.raises(EstimatorError, match="reads 'speed'"):
            ready(parse('frozen[output="speed"]'), scenario)


def test_the_control_that_is_told_of_faults_is_one_for_each(records):
    scenario, _ = records
    spec = parse("oracle-reset")
    later = scenario.override({"fault[0].at": 3.5})
    assert ready(spec, later) is not ready(spec, scenario)


def test_code_of_users_is_made_for_each_record(records, tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    spec = parse(f"{tmp_path / 'mine.py'}:Mine")
    assert ready(spec, records[0]) is not ready(spec, records[0])


def test_a_thread_has_its_own(records):
    from concurrent.futures import ThreadPoolExecutor

    spec = parse("frozen")
    with ThreadPoolExecutor(1) as threads:
        theirs = threads.submit(ready, spec, records[0]).result()
    assert theirs is not ready(spec, records[0])


def test_only_so_many_are_kept(records, monkeypatch):
    monkeypatch.setattr(ready_, "KEPT", 2)
    texts = [f"rpem-forgetting[forgetting={0.99 + i / 1000}]" for i in range(3)]
    first, *_, last = [ready(parse(text), records[0]) for text in texts]
    assert ready(parse(texts[-1]), records[0]) is last
    assert ready(parse(texts[0]), records[0]) is not first


def test_whether_it_could_be_made_is_found_out_once(records, monkeypatch):
    scenario, _ = records
    spec = parse("ekf")
    ready(spec, scenario)
    monkeypatch.setattr(ready_, "made", lambda *_: pytest.fail("made again"))
    ready(spec, scenario.override({"fault[0].factor": 2.0}))
    monkeypatch.undo()
    wrong = parse("rpem-forgetting[forgetting=2.0]")
    for _ in range(2):
        with pytest.raises(EstimatorError, match="forgetting"):
            ready(wrong, scenario)
