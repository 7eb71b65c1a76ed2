"""The catalogue: names are frozen with their content."""

from pathlib import Path

import numpy as np
import pytest

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import GROUPS, in_a_line, reference_card
from flexaxis.experiments.catalogue.find import (
    find_scenario,
    find_suite,
    scenario_names,
    select,
    suite_names,
)
from flexaxis.experiments.cli import main
from flexaxis.sim.errors import ScenarioError
from flexaxis.sim.excitation import Multisine
from flexaxis.sim.parameters import PARAMETER_NAMES

CATALOGUE = [find_scenario(name) for name in scenario_names()]

# A scenario whose content changes gets a new name (-v2); these are never edited, only added to.
FROZEN = {
    "backlash_fm_step-v1": "46309ad95edee30a",
    "coarse_encoder_fm_step-v1": "62859565c8140e69",
    "cogging_fm_step-v1": "c9570781e8d3fd9a",
    "coulomb-v1": "5028193a1567c2f5",
    "coulomb_fm_step-v1": "ebcf109c556f2101",
    "da_double-v1": "11ddd33cb5dd4142",
    "da_intermittent-v1": "e21533ea4754c9d9",
    "da_ramp-v1": "41888caafc894825",
    "dg_double-v1": "62bceb22e5ca37ef",
    "dg_intermittent-v1": "7a04ec6af6adf16f",
    "dg_ramp-v1": "5a9b46d98e506c06",
    "encoder_fm_step-v1": "69e61f594931c860",
    "fa_intermittent-v1": "50bfb8b5d21191a8",
    "fa_ramp-v1": "170408ac85b7d381",
    "fa_step-v1": "fa55d30c5a03b81d",
    "fg_intermittent-v1": "d4b8bb5c4150d5d3",
    "fg_ramp-v1": "d7c9522b11ad6779",
    "fg_step-v1": "bc4de6ddec0d12f5",
    "fm_double-v1": "d3bb881aec3cd7a2",
    "fm_intermittent-v1": "24b4f17aa3dca27a",
    "fm_ramp-v1": "c5c2d1fc08490fd0",
    "fm_small_step-v1": "3884a2a4784dd618",
    "fm_step-v1": "4728e23aa5f4f744",
    "inner_loop_fm_step-v1": "f92f406824ee4be2",
    "ja_big_step-v1": "51b0f7464a4b3bbb",
    "ja_intermittent-v1": "75e3ac640627a146",
    "ja_ramp-v1": "1fa519ffae73736f",
    "ja_step-v1": "03ed2464327b9d4b",
    "jg_intermittent-v1": "58ffa567a41a194e",
    "jg_ramp-v1": "9512833f90bcd7e0",
    "jg_step-v1": "27e7a72585cd8fac",
    "jm_intermittent-v1": "a579c98ca8052c70",
    "jm_ramp-v1": "ee9fc487df3321cf",
    "jm_step-v1": "85a03dd2955ae6c4",
    "ka_intermittent-v1": "db0d4ee314305bb0",
    "ka_ramp-v1": "9a1fe3d6c22e2665",
    "ka_step-v1": "76af8d20a7ebebd5",
    "kg_intermittent-v1": "974269196a44bc93",
    "kg_known_step-v1": "e793a62f4bac5461",
    "kg_ramp-v1": "9e1cb6f3ab6ee086",
    "kg_step-v1": "450e98ce68d92ff8",
    "kt_big_step-v1": "2d3af235eafaa1e6",
    "kt_intermittent-v1": "d14556f171e002e5",
    "kt_ramp-v1": "0f383f647e9a3d92",
    "kt_step-v1": "a67f5e82d45a56ae",
    "load-v1": "666499a486fa2a6c",
    "lugre_fm_step-v1": "9ba3823f77a4dfc6",
    "moves_fm_step-v1": "8e57c764620b1418",
    "moves_ja_step-v1": "b94cbea38424c005",
    "n2_fm_step-v1": "6c9a47bc6e2113c7",
    "n2_nominal-v1": "4352ee855b9b62e0",
    "paper_nominal-v1": "eb8e646c9e100f4e",
    "pause_fm_step-v1": "46afcb944f875562",
    "repair-v1": "9dbdaacaadb7ee8d",
    "restart-v1": "6e01928f731f2df3",
    "saturation_fm_step-v1": "41ec6ab9c2c8b881",
    "slow_fm_step-v1": "c0c14cc03bbba4ae",
    "speed_filter_fm_step-v1": "48cbdde846ca8ae6",
    "standstill-v1": "016ee2f93ac938e0",
    "stiffening_fm_step-v1": "dcdec8f4341acf66",
    "three_faults-v1": "46dda765fc6ec3ea",
    "together-v1": "ebd5e57cd0ffd0a1",
    "told_kg_fm_step-v1": "baa5480a8c00e407",
    "torque_delay_fm_step-v1": "01a6e30780a86359",
    "two_faults-v1": "d53702ddccc8b659",
    "warming_coulomb-v1": "2013b302b14affb1",
    "warming_fm-v1": "27f0b73bea11a997",
    "warming_fm_step-v1": "dd826dc0ed07f4cc",
    "wear_and_step-v1": "c866d7fd6e00ed71",
}


def test_every_scenario_is_frozen():
    assert {name: find_scenario(name).hash[:16] for name in scenario_names()} == FROZEN


@pytest.mark.parametrize("name", scenario_names())
def test_a_scenario_says_its_name_and_what_it_tests(name):
    scenario = find_scenario(name)
    assert scenario.name == name and len(scenario.card) > 40
    assert scenario.noise.speed == 0.1 and scenario.group in GROUPS and scenario.difficulty
    card = reference_card(scenario)
    assert card["tests"] == scenario.card and all(card.values())
    assert (card["unmodelled"] == "nothing") == scenario.linear


@pytest.mark.parametrize("kind", ["step", "ramp", "intermittent"])
def test_every_parameter_fails_in_every_way(kind):
    alone = [s.fault[0] for s in CATALOGUE if len(s.fault) == 1]
    failing = {fault.parameter for fault in alone if fault.kind == kind}
    assert failing == set(PARAMETER_NAMES) - {"r"}


def test_groups_hold_what_they_say():
    for scenario in CATALOGUE:
        kinds = [fault.kind for fault in scenario.fault]
        match scenario.group:
            case "nominal":
                assert not kinds and scenario.linear
            case "steps":
                assert kinds == ["step"] and scenario.linear
            case "wear":
                assert kinds == ["ramp"] and scenario.linear
            case "intermittent":
                assert kinds == ["intermittent"] and scenario.linear
            case "several":
                assert len(kinds) > 1 and scenario.linear
            case "excitation":
                assert scenario.excitation != Multisine() and scenario.linear
            case "mismatch":
                assert not scenario.linear
        assert bool(scenario.nuisance) == (scenario.group == "nuisance")


def test_the_page_on_scenarios_names_them_all():
    page = Path(__file__).parents[2] / "docs" / "scenarios.md"
    table = page.read_text(encoding="utf-8").split("## The catalogue")[1].split("## Keys")[0]
    rows = {row.split("|")[1].strip(" `"): row for row in table.splitlines() if "|" in row}
    for scenario in CATALOGUE:
        assert f"`{scenario.name.removesuffix('-v1')}`" in rows[scenario.group]
    assert set(rows) - {"group", "---"} == set(GROUPS)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("fm_step-v1", "f_m +50 % at 10 s"),
        ("kg_step-v1", "k_g -20 % at 10 s; not estimated"),
        ("fg_ramp-v1", "f_g 20-fold from 10 to 15 s; not estimated"),
        ("fm_intermittent-v1", "f_m +50 % from 10 s, 2 s of 4"),
        ("coarse_encoder_fm_step-v1", "f_m +50 % at 10 s; increment; encoder of 2048 counts"),
        ("warming_fm-v1", "no fault: f_m -30 % from 5 s, 20 s to 63 %"),
        ("n2_nominal-v1", "no fault; n2"),
        ("torque_delay_fm_step-v1", "f_m +50 % at 10 s; torque late by 1 ms"),
        ("coulomb-v1", "no fault; Coulomb friction of 0.1 N m"),
        ("told_kg_fm_step-v1", "f_m +50 % at 10 s; told k_g × 1.1"),
        ("moves_ja_step-v1", "J_a +30 % at 10.35 s; moves of 0.4 s within 4 rad, 0.2 s apart"),
        ("standstill-v1", "no fault; standstill"),
    ],
)
def test_a_scenario_in_a_line(name, line):
    assert in_a_line(find_scenario(name)) == line


def test_the_list_has_each_scenario_once_in_its_group(capsys):
    assert main(["list", "scenarios"]) == 0
    words = [line.split()[0] for line in capsys.readouterr().out.splitlines() if line.strip()]
    shown = [word for word in words if word in FROZEN or word in GROUPS]
    expected = [[group, *(s.name for s in CATALOGUE if s.group == group)] for group in GROUPS]
    assert shown == [word for group in expected for word in group]


def test_a_card_with_line_breaks_stays_a_comment(capsys, tmp_path):
    path = tmp_path / "mine.toml"
    scenario = find_scenario("fm_step-v1").override({"name": "mine", "card": "two\nlines"})
    path.write_text(scenario.to_toml(), encoding="utf-8")
    assert main(["show", str(path)]) == 0
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    assert find_scenario(str(path)).card == "two\nlines"


def test_a_card_says_whether_there_is_a_bound():
    assert reference_card(find_scenario("together-v1"))["bound"] == "defined for k_T, f_m"
    assert reference_card(find_scenario("coulomb-v1"))["bound"].startswith("none")


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
    assert suite_names() == ["faults", "gate", "mismatch", "nuisance", "smoke", "standard"]
    standard = find_suite("standard")
    assert set(standard.scenarios) == set(FROZEN)
    assert set(standard.estimators) == set(REGISTRY) - {"literal-rpem"}
    assert standard.seeds == 30
    groups = {name: find_scenario(name).group for name in FROZEN}
    parted = [find_suite(name).scenarios for name in ("faults", "mismatch", "nuisance")]
    assert sorted(sum(parted, ())) == sorted(FROZEN)  # each scenario in one of them
    assert {groups[name] for name in parted[2]} == {"nuisance", "nominal"}


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
