"""The catalogue: names are frozen with their content."""

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import (
    find_scenario,
    find_suite,
    scenario_names,
    select,
    suite_names,
)
from flexaxis.sim.errors import ScenarioError

# A scenario whose content changes gets a new name (-v2); these are never edited, only added to.
FROZEN = {
    "backlash_fm_step-v1": "46309ad95edee30a",
    "coulomb-v1": "5028193a1567c2f5",
    "coulomb_fm_step-v1": "ebcf109c556f2101",
    "dg_double-v1": "62bceb22e5ca37ef",
    "encoder_fm_step-v1": "69e61f594931c860",
    "fm_double-v1": "d3bb881aec3cd7a2",
    "fm_ramp-v1": "c5c2d1fc08490fd0",
    "fm_step-v1": "4728e23aa5f4f744",
    "ja_big_step-v1": "51b0f7464a4b3bbb",
    "ja_step-v1": "03ed2464327b9d4b",
    "jm_step-v1": "85a03dd2955ae6c4",
    "ka_step-v1": "76af8d20a7ebebd5",
    "kg_step-v1": "450e98ce68d92ff8",
    "kt_step-v1": "a67f5e82d45a56ae",
    "paper_nominal-v1": "eb8e646c9e100f4e",
    "pause_fm_step-v1": "46afcb944f875562",
    "repair-v1": "9dbdaacaadb7ee8d",
    "two_faults-v1": "d53702ddccc8b659",
}


def test_every_scenario_is_frozen():
    assert {name: find_scenario(name).hash[:16] for name in scenario_names()} == FROZEN


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_says_its_name_and_what_it_tests(name):
    scenario = find_scenario(name)
    assert scenario.name == name and len(scenario.card) > 40
    assert scenario.noise.speed == 0.1 and scenario.preset == "n1"


@pytest.mark.parametrize(
    ("name", "parameter", "at", "ratio"),
    [
        ("fm_step-v1", "f_m", 10, 1.5),
        ("fm_double-v1", "f_m", 10, 2.0),
        ("ja_step-v1", "J_a", 10, 1.1),
        ("kt_step-v1", "k_T", 10, 0.9),
        ("fm_ramp-v1", "f_m", 10, 1.5),
        ("encoder_fm_step-v1", "f_m", 10, 1.5),
        ("pause_fm_step-v1", "f_m", 20, 1.5),
    ],
)
def test_faults(name, parameter, at, ratio):
    (event,) = find_scenario(name).events()
    assert (event.parameter, event.index) == (parameter, 200 * at)
    assert event.after / event.before == pytest.approx(ratio)


def test_the_pause():
    excited = find_scenario("pause_fm_step-v1").excited()
    assert excited.size == 10000
    np.testing.assert_array_equal(np.flatnonzero(~excited), np.arange(2000, 6000))


def test_suites():
    assert suite_names() == ["smoke", "standard"]
    standard = find_suite("standard")
    assert set(standard.scenarios) == set(FROZEN) and set(standard.estimators) == set(REGISTRY)
    assert standard.seeds == 30


def test_select_mixes_suites_scenarios_and_files(tmp_path):
    mine = find_scenario("fm_step-v1").override({"name": "mine"})
    path = tmp_path / "mine.toml"
    path.write_text(mine.to_toml(), encoding="utf-8")
    scenarios, estimators, seeds, *_ = select(["smoke", "fm_step-v1", str(path)])
    assert [s.name for s in scenarios] == [*find_suite("smoke").scenarios, "mine"]
    assert estimators == list(find_suite("smoke").estimators) and seeds == 8


def test_one_name_for_two_definitions_is_refused(tmp_path):
    path = tmp_path / "other.toml"
    path.write_text(
        find_scenario("fm_double-v1").override({"name": "fm_step-v1"}).to_toml(), encoding="utf-8"
    )
    with pytest.raises(ScenarioError, match=r"other\.toml: the name 'fm_step-v1' is also that"):
        select(["fm_step-v1", str(path)])


def test_all_wrong_names_at_once():
    with pytest.raises(ScenarioError) as caught:
        select(["fm_stp-v1", "smokee"])
    assert len(caught.value.problems) == 2
