"""The planted errors fit the code, and (slow) the tests see every one."""

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


@pytest.mark.slow
def test_every_one_is_seen(capsys):
    status = run.main([])
    assert status == 0, capsys.readouterr().out
