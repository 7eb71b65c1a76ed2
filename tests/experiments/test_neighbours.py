"""Estimators in files: each has the neighbours of its own folder, and takes no library's place."""

import statistics
import sys

import pytest

import flexaxis as fx
from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.running.estimators import digest
from flexaxis.experiments.running.estimators import parse

MINE = """
from __future__ import annotations
from dataclasses import dataclass

import helper_of_mine

class Mine:
    names, output = ("f_m",), "speed"

    def __init__(self, nominal, period):
        self.now = helper_of_mine.VALUE

    def step(self, u, y):
        import late_helper_of_mine
        return [self.now + late_helper_of_mine.VALUE]

@dataclass
class Data:
    value: int = 0
"""


@pytest.fixture
def two(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder, value in (("old", 1.0), ("new", 2.0)):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mine.py").write_text(MINE)
        (tmp_path / folder / "helper_of_mine.py").write_text(f"VALUE = {value}\n")
        (tmp_path / folder / "late_helper_of_mine.py").write_text(f"VALUE = {10 * value}\n")
    return tmp_path


def test_each_folder_has_its_own_helpers_also_those_imported_late(two, short):
    record = fx.simulate(short)
    specs = [parse(f"{folder}/mine.py:Mine") for folder in ("old", "new")]  # both before any runs
    found = [fx.estimate(record, spec.text).last["f_m"] for spec in [*specs, *specs]]
    assert found == [11.0, 22.0, 11.0, 22.0]


def test_a_helper_that_changed_changes_the_digest(two):
    text, before = "old/mine.py:Mine", digest("old/mine.py:Mine")
    assert before == digest(text)
    (two / "old/late_helper_of_mine.py").write_text("VALUE = 3\n")
    after = digest(text)
    assert after != before
    (two / "old/deep_helper_of_mine.py").write_text("A = 1\n")
    (two / "old/late_helper_of_mine.py").write_text("from deep_helper_of_mine import A\n")
    one = digest(text)
    (two / "old/deep_helper_of_mine.py").write_text("A = 2\n")
    assert len({before, after, one, digest(text)}) == 4


def test_a_file_with_the_name_of_a_library_hides_it_from_nobody(two, monkeypatch):
    (two / "old/statistics.py").write_text(MINE)
    monkeypatch.delitem(sys.modules, "statistics")
    parse("old/statistics.py:Mine")
    import statistics as library

    assert library.__file__ == statistics.__file__


def test_a_file_that_fails_is_not_left_half_imported(two):
    (two / "old/fails_in_the_end.py").write_text("class Mine: pass\n1 / 0\n")
    for _ in range(2):
        with pytest.raises(EstimatorError, match="ZeroDivisionError"):
            parse("old/fails_in_the_end.py:Mine")
    assert not [name for name in sys.modules if name.endswith("fails_in_the_end")]


def test_only_what_cannot_be_imported_is_told_to_be_renamed(two):
    (two / "old/random.py").write_text("MINE = 1\n")
    (two / "old/divides.py").write_text("1 / 0\n")
    (two / "old/wants.py").write_text("from random import MINE\n")
    with pytest.raises(EstimatorError) as seen:
        parse("old/divides.py:Mine")
    assert "rename" not in str(seen.value)
    with pytest.raises(EstimatorError, match="rename it"):
        parse("old/wants.py:Mine")


def test_a_class_is_told_from_one_of_nearly_its_name(two):
    with pytest.raises(EstimatorError, match="Did you mean 'Mine'"):
        parse("old/mine.py:Mone")


@pytest.mark.slow
def test_each_worker_process_has_them_apart_too(two, short):
    for folder, value in (("old", 0.05), ("new", 0.06)):  # near the truth, so that biases differ
        (two / folder / "helper_of_mine.py").write_text(f"VALUE = {value}\n")
        (two / folder / "late_helper_of_mine.py").write_text("VALUE = 0.0\n")
    names = ["old/mine.py:Mine", "new/mine.py:Mine"]
    for text in names:
        parse(text)  # as a command does before it starts processes, which inherit the import path
    rows = list(fx.benchmark(names, scenarios=short, seeds=4, jobs=2).rows)
    found = {name: {row["bias"] for row in rows if row["estimator"] == name} for name in names}
    assert found["old/mine.py:Mine"].isdisjoint(found["new/mine.py:Mine"])


@pytest.mark.parametrize("edited", ["mine.py", "helper_of_mine.py", "late_helper_of_mine.py"])
def test_the_digest_is_of_what_was_imported(two, edited):
    """Who edits a file while it runs has not run what he wrote."""
    text, before = "old/mine.py:Mine", digest("old/mine.py:Mine")
    parse(text)
    path = two / "old" / edited
    content = path.read_text()
    path.write_text(content + "# edited while it runs\n")
    assert digest(text) == before
    path.write_text(content)
    assert digest("new/mine.py:Mine") != before


def test_the_digest_of_a_module_is_of_what_was_imported(two, monkeypatch):
    (two / "module_of_mine.py").write_text("class Mine: pass\n")
    monkeypatch.syspath_prepend(str(two))
    before = digest("module_of_mine:Mine")
    parse("module_of_mine:Mine")
    (two / "module_of_mine.py").write_text("class Mine: x = 1\n")
    assert digest("module_of_mine:Mine") == before
