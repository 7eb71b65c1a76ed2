"""The catalogue: names are frozen with their content."""

import tomllib
from pathlib import Path

import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import find
from flexaxis.experiments.catalogue.card import in_a_line, reference_card
from flexaxis.experiments.catalogue.find import (
    GROUPS,
    find_scenario,
    find_suite,
    scenario_names,
    select,
    suite_names,
)
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.parameters import PARAMETER_NAMES

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
    with pytest.raises(ScenarioError, match="4728e23aa5f4f744; give a changed"):
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


def test_every_parameter_has_a_step():
    alone = [s.fault[0] for s in CATALOGUE if len(s.fault) == 1 and s.linear]
    for kind, failing in (
        ("step", set(PARAMETER_NAMES) - {"r"}),
        ("ramp", {"f_m", "J_a", "k_T"}),
        ("intermittent", {"f_m"}),
    ):
        assert {fault.parameter for fault in alone if fault.kind == kind} == failing


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("fm_step-v1", "f_m +50 % at 10 s"),
        ("kg_step-v1", "k_g -20 % at 10 s; not estimated"),
        ("ja_ramp-v1", "J_a +30 % from 10 to 15 s"),
        ("fm_intermittent-v1", "f_m +50 % from 10 s, 2 s of 4"),
        ("coarse_encoder_fm_step-v1", "f_m +50 % at 10 s; increment; encoder of 2048 counts"),
        ("warming_fm-v1", "no fault: f_m -30 % from 5 s, 20 s to 63 %"),
        ("n2_nominal-v1", "no fault; n2"),
        ("torque_delay_fm_step-v1", "f_m +50 % at 10 s; torque late by 1 ms"),
        ("coulomb-v1", "no fault; Coulomb friction of 0.1 N m"),
        ("told_kg_fm_step-v1", "f_m +50 % at 10 s; known k_g × 1.1"),
        ("coulomb_fc_step-v1", "f_c +50 % at 10 s; Coulomb friction of 0.1 N m"),
        ("moves_ja_step-v1", "J_a +30 % at 10.35 s; moves of 0.4 s within 4 rad, 0.2 s apart"),
        ("standstill-v1", "no fault; standstill"),
        (
            "noisy_loop_fm_step-v1",
            "f_m +50 % at 10 s; increment; noise of 0.1 rad/s on the speed; "
            "noise of 0.0002 rad on the angle; encoder of 8192 counts; controller sees what is "
            "measured",
        ),
    ],
)
def test_a_scenario_in_a_line(name, line):
    assert in_a_line(find_scenario(name)) == line


def test_a_card_says_whether_there_is_a_bound():
    assert reference_card(find_scenario("together-v1"))["bound"] == "defined for k_T, f_m"
    assert reference_card(find_scenario("coulomb-v1"))["bound"].startswith("none")


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
