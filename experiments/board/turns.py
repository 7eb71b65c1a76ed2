"""Whether the settings of an entry are turns of one knob, the same on every scenario."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.suite import Board
from flexaxis.experiments.studies.knobs import turned
from flexaxis.experiments.studies.sweep import FACTORS, WIDER
from flexaxis.sim.reading import shown

TURNS = (*FACTORS, *WIDER, *(1 / factor for factor in WIDER))
"""Turns that `flexaxis submit` tries."""

_NUMBER = r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?"
Line = Mapping[str, float]


def of_one_knob(entry: Entry, board: Board) -> Iterator[str]:
    """Yield what is wrong with the settings of an entry; nothing of it is built.

    What is run again is then what was agreed to, and what is compared at equal noise is one
    estimator: the value of its knob follows from the turn, everywhere alike.
    """
    names = {*dict(entry.suite)["scenarios"]}
    for name in sorted({*entry.settings, *entry.left_out} - names):
        yield f"{shown(name)} is no scenario of the suite"
    mine = re.compile(re.escape(entry.estimator) + rf"(?:\[(\w+)=({_NUMBER})\])?", re.ASCII)
    texts = {text for line in entry.settings.values() for text in line}
    strange = sorted(text for text in texts if not mine.fullmatch(text))
    yield from (f"{shown(text)} is another estimator" for text in strange)
    if strange:
        return
    for scenario in board.nuisances:
        line = entry.settings.get(scenario.name, {entry.estimator: 1})
        if dict(line) != {entry.estimator: 1}:
            yield f"{scenario.name}: is run as entered, and its settings are {shown(dict(line))}"
    lines = {s.name: entry.settings[s.name] for s in board.faults if s.name in entry.settings}
    yield from _alike(lines, mine)


def _alike(lines: Mapping[str, Line], mine: re.Pattern[str]) -> Iterator[str]:
    """Yield the settings that are not the turn of the knob that they are said to be."""
    usual = {text for line in lines.values() for text, turn in line.items() if turn == 1}
    if len(usual) > 1:
        yield f"several settings are said to be the usual one: {', '.join(sorted(usual))}"
    if len(usual) != 1:
        return
    found = mine.fullmatch(one := usual.pop())
    assert found is not None
    knob, value = found[1], found[2]
    first = {turn for line in lines.values() for turn in line.values() if turn in FACTORS}
    for name, line in lines.items():
        if one not in line or (knob and first - {*line.values()}):
            yield f"{name}: lacks settings that other scenarios have"
        for text, turn in line.items():
            each = mine.fullmatch(text)
            assert each is not None
            if turn not in TURNS or each[1] != knob:
                yield f"{name}: {text} is no turn of the knob that `flexaxis submit` tries"
            elif knob and not _is(float(each[2]), turned(knob, float(value), turn)):
                yield f"{name}: {text} is not the knob of {one} turned {turn:g} times"


def _is(value: float, wanted: float) -> bool:
    """Whether a value is one that was written with twelve digits."""
    return math.isclose(value, wanted, rel_tol=1e-9, abs_tol=1e-11)
