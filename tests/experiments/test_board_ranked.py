"""Everything that carries a rank is tried on unknown seeds, and nothing else is compared."""

import copy as copies
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from flexaxis.experiments.board.agreement import agreements
from flexaxis.experiments.board.entry import ENTRY, seal
from flexaxis.experiments.board.hidden import Draw
from flexaxis.experiments.board.sampling import sample
from flexaxis.experiments.board.stored import own
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.board.trial import Ask, verify_entry
from flexaxis.experiments.board.unseen import EARLIER, pairs, ranked, reported
from flexaxis.experiments.board.unseen import SEEDS as UNKNOWN
from flexaxis.experiments.board.verdict import of_form
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.files import dumps
from flexaxis.experiments.running.rows import read as read_rows
from flexaxis.experiments.studies.sweep import reference

sys.path.insert(0, str(Path(__file__).parent))
from boards import CHEATS, SEEDS, entered, known

STEP, LOAD = find_scenario("fm_step-v1"), find_scenario("load-v1")
TWO = Board("two", (STEP, LOAD), SEEDS)
MEANS = Means(store=default_cache())
KNOBBED = "code/memory_knob.py:Turned"


@pytest.fixture(scope="module")
def cheat(tmp_path_factory):
    """An entry that is honest at the setting as entered alone, and knows nothing of a load."""
    home = tmp_path_factory.mktemp("cheat")
    for name in ("memory.py", "memory_knob.py"):
        shutil.copy(CHEATS / name, home)
    known(home, replace(TWO, scenarios=(STEP,)))
    return entered(home / "entry", home / "memory_knob.py:Turned", TWO)


@pytest.fixture
def copy(cheat, tmp_path):
    return shutil.copytree(cheat.folder, tmp_path / "copy")


def forged(folder, change_rows=lambda rows: rows, change=lambda content: None):
    """Change the rows and entry.json, and close the entry again."""
    path = folder / "run" / "scores.jsonl"
    rows = change_rows([json.loads(line) for line in path.read_text().splitlines()])
    path.write_text("".join(dumps(row) + "\n" for row in rows))
    content = json.loads((folder / ENTRY).read_text())
    change(content)
    for key in ("form", "files", "digest"):
        content.pop(key)
    seal(folder, content)
    _, verdict = of_form(folder, TWO)
    return {check.name: check.seen for check in verdict.checks if check.holds is False}


def changed(rows, **changes):
    """A copy of the first case, with other values and a number of its own."""
    return [copies.deepcopy(row) | {"case": "f" * 16} | changes for row in rows[: rows[0]["rows"]]]


@pytest.mark.parametrize(
    ("changes", "said"),
    [({"seed": 9000}, "no seed of the suite"), ({"seed": True}, "no seed of the suite"),
     ({"hash": "0" * 64}, "this name and this hash"),
     ({"scenario": "fm_step-v1"}, "this name and this hash"),
     ({"estimator": "ekf"}, "neither the estimator nor the reference"), ({}, "a row twice")],
)  # fmt: skip
def test_rows_that_nobody_asked_for_are_refused(copy, changes, said):
    wrong = forged(copy, lambda rows: rows + changed(rows, **changes))
    assert said in wrong["rows of this suite"]


def as_(name, value):
    """Write settings of fm_step-v1 and load-v1 anew, with one of them changed."""

    def change(content):
        line = content["settings"][name]
        content["settings"][name] = value(dict(line)) if callable(value) else value

    return change


def renamed(old, new):
    return lambda line: {t.replace(old, new): turn for t, turn in line.items()}


@pytest.mark.parametrize(
    ("change", "said"),
    [(as_("load-v1", {f"{KNOBBED}[forgetting=0.9]": 1.0}), "is run as entered"),
     (as_("fm_step-v1", renamed("=0.99]", "=0.991]")), "is not the knob of"),
     (as_("fm_step-v1", lambda line: line | {f"{KNOBBED}[gain=3]": 8.0}), "is no turn"),
     (as_("fm_step-v1", lambda line: line | {f"{KNOBBED}[forgetting=0.9]": 1.0}), "the usual")],
)  # fmt: skip
def test_settings_are_one_knob_turned(copy, change, said):
    wrong = forged(copy, change=change)
    assert said in wrong.get("settings of one estimator", "")


def test_a_decoy_case_would_be_compared_with_nothing(cheat):
    """Also where a verdict on rows were missing: rows of other seeds are not read."""
    rows = list(read_rows(cheat.run / "scores.jsonl"))
    settings = ranked(cheat, own(cheat, TWO), TWO)
    decoys = [row | {"seed": 9000} for row in rows] + [row | {"hash": "0"} for row in rows]
    assert reported(rows + decoys, settings, TWO) == reported(rows, settings, TWO)


@pytest.mark.slow
def test_a_memoriser_behind_its_knob_is_found(cheat, tmp_path, monkeypatch):
    """The core, without a cage: what is run is what the rank rests on, also where calm."""
    monkeypatch.chdir(cheat.folder)
    _, verdict = of_form(cheat.folder, TWO)
    assert verdict.holds
    settings = ranked(cheat, own(cheat, TWO), TWO)
    assert {each.group for each in settings} == {
        "nominal, quieter setting", "nominal, noisier setting", "nuisance"}  # fmt: skip
    rows = list(read_rows(cheat.run / "scores.jsonl"))

    def make(text, scenario, seeds):
        found = Bench([scenario], None, MEANS).runs([scenario], [text], seeds)
        return dict(zip(seeds, found[scenario.hash, text], strict=True))

    known_ = reported(rows, settings, TWO)
    seeds = Draw("0123456789abcdef").seeds(8)
    found = agreements(list(pairs(settings, known_, seeds, lambda s: s, make)))
    wrong = [each.score for each in found if not each.holds]
    assert wrong and all(score.startswith("nominal") for score in wrong)
    assert any(each.score == "nuisance: excess" for each in found)


def test_who_is_better_on_reported_seeds_of_the_nuisance_track_alone_is_found(cheat):
    settings = ranked(cheat, own(cheat, TWO), TWO)
    honest = reported(list(read_rows(cheat.run / "scores.jsonl")), settings, TWO)

    def make(text, scenario, seeds):
        found = [rows for (what, _), rows in honest.items() if what == f"{scenario.name} {text}"]
        return {seed: found[k % len(found)] for k, seed in enumerate(seeds)}

    better = {
        key: [row | {"excess": row["excess"] / 100} for row in rows] if "load" in key[0] else rows
        for key, rows in honest.items()
    }
    seeds = Draw("0123456789abcdef").seeds(16)
    assert all(a.holds for a in agreements(list(pairs(settings, honest, seeds, _same, make))))
    found = agreements(list(pairs(settings, better, seeds, _same, make)))
    assert [a.score for a in found if not a.holds] == ["nuisance: excess"]


def _same(scenario):
    return scenario


def test_what_is_run_again_is_what_carries_the_rank():
    cases = [(h, text, seed) for h in "ab" for text in ("x", "y", "z", reference())
             for seed in range(24)]  # fmt: skip
    settings = {("a", "x"), ("a", "y"), ("b", "x"), ("b", "y")}
    found, words = sample(cases, settings, 8, Random(1))
    usual = [case for case in found if case[1] == reference()]
    assert len(usual) == 1 and len({*found}) == 9
    assert sorted(case[:2] for case in found if case not in usual) == sorted([*settings] * 2)
    # 96 cases, 10 of them forged: 1 - (86 over 8) / (96 over 8)
    assert "8 of 96" in words and "a chance of 60 %" in words


@pytest.mark.slow
def test_a_memoriser_behind_its_knob_is_found_in_the_cage(cheat):
    found = verify_entry(
        cheat.folder, Ask(6, 6, Draw.new("0123456789abcdef")), run_code=True,
        store=default_cache(), frozen=TWO,
    )  # fmt: skip
    wrong = [check for check in found.checks if check.holds is False]
    assert wrong and {check.name for check in wrong} <= {UNKNOWN, EARLIER}
    assert all("nominal" in check.seen for check in wrong)
