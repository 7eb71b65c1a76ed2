"""The glossary names what there is."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "glossary.md"
ROWS = [
    re.split(r"\s*\|\s*", line.strip("| "))
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("| ") and not line.startswith("| term ")
]
PLACES = sorted({place for row in ROWS for place in re.findall(r"`([\w.]+)`", row[-1])})


def found(place):
    """A module, or a name in one: what a place of the glossary is."""
    try:
        return importlib.import_module(f"flexaxis.{place}")
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        return getattr(importlib.import_module(f"flexaxis.{module}"), name)


@pytest.mark.parametrize("place", PLACES)
def test_every_place_is_there(place):
    assert found(place) is not None


def test_a_place_that_is_not_there_is_seen():
    with pytest.raises(AttributeError):
        found("sim.timing.Clock")
    with pytest.raises(ModuleNotFoundError):
        found("sim.clocks.Clock")


def test_it_stays_a_page_and_each_row_has_a_place():
    assert 40 < len(ROWS) <= 60
    assert all(len(row) == 5 and re.search(r"`[\w.]+`", row[-1]) for row in ROWS)
    terms = [row[0] for row in ROWS]
    assert len({*terms}) == len(terms)
