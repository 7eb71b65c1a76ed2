"""What identify tries by itself where something speaks against its result, and its progress."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from flexaxis.experiments.logs import obvious, ticker
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.obvious import with_the_obvious


@dataclass(frozen=True)
class Said:
    """As much of a verdict as is read."""

    warnings: tuple = ()
    remarks: tuple = ()


@dataclass(frozen=True)
class Found:
    """As much of an identification as is read."""

    verdict: Said
    axis: object

    @property
    def warnings(self):
        return self.verdict.warnings


RECORD = SimpleNamespace(versions={})
PLAIN = SimpleNamespace(highpass=None)
BAD, GOOD = Found(Said(("it drifts",)), PLAIN), Found(Said(), PLAIN)


@pytest.fixture
def advised(monkeypatch):
    monkeypatch.setattr(obvious, "advised_corner", lambda record: 3.0)


def test_a_high_pass_that_is_advised_is_tried_and_said(advised):
    found = with_the_obvious(RECORD, BAD, lambda corner: replace(GOOD, axis=corner))
    assert found.axis == 3.0 and not found.warnings
    assert "--highpass 3" in found.verdict.remarks[0] and "it drifts" in found.verdict.remarks[0]


def test_what_is_no_better_is_said_and_not_taken(advised):
    found = with_the_obvious(RECORD, BAD, lambda corner: BAD)
    assert found.warnings == BAD.warnings and "tried as well" in found.verdict.remarks[0]

    def fails(corner):
        raise LogError("too short")

    found = with_the_obvious(RECORD, BAD, fails)
    assert found.warnings == BAD.warnings and "too short" in found.verdict.remarks[0]


def test_nothing_is_tried_where_nothing_is_wrong_or_it_was_done(advised):
    def never(corner):
        raise AssertionError

    assert with_the_obvious(RECORD, GOOD, never) is GOOD
    filtered = replace(BAD, axis=SimpleNamespace(highpass=2.0))
    assert with_the_obvious(RECORD, filtered, never) is filtered
    imported = SimpleNamespace(versions={"highpass": "5"})
    assert with_the_obvious(imported, BAD, never) is BAD


def test_progress_is_told_to_a_file_as_well(monkeypatch, capsys):
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(ticker.time, "monotonic", lambda: clock.now)
    with ticker.ticker("identifying") as tell:
        for _ in range(61):
            tell()
            clock.now += 1.0
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 4 and all(line.startswith("identifying: ") for line in told)
