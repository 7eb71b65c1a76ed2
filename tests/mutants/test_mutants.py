"""The planted errors fit the code; that the tests see every one is what `make mutants` shows."""

import importlib.util
from pathlib import Path

import pytest

place = importlib.util.spec_from_file_location("mutants_run", Path(__file__).with_name("run.py"))
run = importlib.util.module_from_spec(place)
place.loader.exec_module(run)

MUTANTS = run.mutants()


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_it_can_be_planted(mutant):
    assert mutant.problem() is None
    assert mutant.new != mutant.old


def test_no_two_have_one_name():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)


def test_nine_of_ten_are_seen_by_the_fast_tests():
    assert 10 * sum(run.is_slow(mutant.killer) for mutant in MUTANTS) <= len(MUTANTS)
