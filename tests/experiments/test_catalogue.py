"""The catalogue: names are frozen with their content."""

import tomllib
from pathlib import Path

import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import find
from flexaxis.experiments.catalogue.card import reference_card
from flexaxis.experiments.catalogue.find import (
    GROUPS,
    find_scenario,
    find_suite,
    scenario_names,
    select,
    suite_names,
)
from flexaxis.sim.errors import ScenarioError

HOME = Path(find.__file__).parent
FROZEN = tomllib.loads((HOME / "hashes.toml").read_text(encoding="utf-8"))
APART = ("chains", "control", "drives", "known")  # groups with a suite of their own
CATALOGUE = [find_scenario(name) for name in sorted(FROZEN)]


def test_every_scenario_is_frozen():
    """The error is the advice: the line to add."""
    for name in scenario_names():
        find_scenario(name)
    listed = [name for name in FROZEN if not name.endswith("-v2")]
    assert sorted(listed) == scenario_names(), "names are kept as long as what they stand for"


def test_without_a_suffix_the_first_version_is_meant():
    assert find_scenario("fm_step") == find_scenario("fm_step-v1")
    assert [s.name for s in select(["fm_step", "fm_step-v1", "fm_step-v2"]).scenarios] == [
        "fm_step-v1", "fm_step-v2",
    ]  # fmt: skip
    with pytest.raises(ScenarioError, match="unknown scenario 'coulomb2'"):
        find_scenario("coulomb2")


@pytest.fixture
def catalogue(tmp_path, monkeypatch):
    """A catalogue of one scenario, written with some content and frozen with some hash."""

    def write(content, frozen):
        (tmp_path / "scenarios").mkdir(exist_ok=True)
        (tmp_path / "scenarios" / "fm_step-v1.toml").write_text(content, encoding="utf-8")
        (tmp_path / "hashes.toml").write_text(frozen, encoding="utf-8")

        find.hashes.cache_clear()

    monkeypatch.setattr(find, "HOME", tmp_path)
    yield write
    find.hashes.cache_clear()


STEP = (HOME / "scenarios" / "fm_step-v1.toml").read_text(encoding="utf-8")
LINE = '"fm_step-v1" = "4728e23aa5f4f744"'  # of the first release


def test_a_name_is_frozen_with_its_content(catalogue):
    catalogue(STEP, LINE)
    assert find_scenario("fm_step-v1").fault[0].factor == 1.5
    catalogue(STEP.replace("factor = 1.5", "factor = 1.6"), LINE)
    with pytest.raises(ScenarioError, match=r"4728e23aa5f4f744\. Use a new name"):
        find_scenario("fm_step-v1")


def test_what_is_not_frozen_says_the_line_to_add(catalogue):
    catalogue(STEP, "")
    with pytest.raises(ScenarioError) as caught:
        find_scenario("fm_step-v1")
    assert f"add the line {LINE} to {find.HOME / 'hashes.toml'}" in str(caught.value)


@pytest.mark.parametrize("name", FROZEN)
def test_a_scenario_says_its_name_and_what_it_tests(name):
    scenario = find_scenario(name)
    assert scenario.name == name and len(scenario.card) > 40
    assert scenario.noise.speed == 0.1 and scenario.group in GROUPS and scenario.difficulty
    card = reference_card(scenario)
    assert card["tests"] == scenario.card and all(card.values())
    assert (card["unmodelled"] == "nothing") == scenario.linear


def test_suites():
    names = "control drives faults gate headline known mismatch nuisance smoke standard"
    assert suite_names() == names.split()
    standard = find_suite("standard")
    drawn = {name for name in FROZEN if name.endswith("-v2")}
    last = set(FROZEN) - {name.replace("-v2", "-v1") for name in drawn}
    apart = {s.name for s in CATALOGUE if s.group in ("chains", "known")}
    assert set(standard.scenarios) == last - apart and len(last) == len(FROZEN) - len(drawn)
    assert {s.name for s in CATALOGUE if s.fault} - last == {n.replace("-v2", "-v1") for n in drawn}
    assert set(standard.estimators) == set(REGISTRY)
    assert standard.seeds == 30
    groups = {name: find_scenario(name).group for name in FROZEN}
    parted = [find_suite(name).scenarios for name in ("faults", "mismatch", "nuisance")]
    rest = [name for name in last if groups[name] not in APART]
    assert sorted(name for part in parted for name in part) == sorted(
        rest
    )  # each of the others in one of them
    assert {groups[name] for name in parted[2]} == {"nuisance", "nominal"}


def test_select_mixes_suites_scenarios_and_files(tmp_path):
    mine = find_scenario("fm_step-v1").override({"name": "mine"})
    path = tmp_path / "mine.toml"
    path.write_text(mine.to_toml(), encoding="utf-8")
    suite, smoke = select(["smoke", "fm_step-v1", str(path)]), find_suite("smoke")
    assert [s.name for s in suite.scenarios] == [*smoke.scenarios, "mine"]
    assert suite.estimators == smoke.estimators and suite.seeds == 8


def test_all_wrong_names_at_once():
    with pytest.raises(ScenarioError) as caught:
        select(["fm_stp-v1", "smokee"])
    assert len(caught.value.problems) == 2
