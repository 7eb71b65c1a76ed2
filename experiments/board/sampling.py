"""Which reported cases are run again: those that a rank rests on, setting by setting."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import chain, zip_longest
from math import comb
from random import Random

from flexaxis.experiments.studies.sweep import reference

Case = tuple[str, str, int]
"""Hash of the scenario, setting, seed."""
FORGED = 0.1  # share of forged cases of which the chance to see one is told


def sample(
    cases: Collection[Case], settings: Collection[tuple[str, str]], number: int, random: Random
) -> tuple[list[Case], str]:
    """Return the cases to be run again, and in words what they would see.

    Parameters
    ----------
    cases : collection
        All that are reported, of the reference too.
    settings : collection
        Hash and text of those that carry a rank. In turn a case is drawn of each, so that no
        setting is drawn twice before all are drawn once; then of the reference, a fifth as many.
        Settings that carry no rank are not run again.
    number : int
    random : Random
    """
    strata = []
    for setting in sorted(settings):
        mine = sorted(case for case in cases if case[:2] == setting)
        strata.append(random.sample(mine, len(mine)))
    random.shuffle(strata)
    every = [case for case in chain(*zip_longest(*strata)) if case is not None]
    chosen = every[:number]
    usual = sorted(case for case in cases if case[1] == reference() and case not in {*chosen})
    few = random.sample(usual, min(max(1, number // 5), len(usual)))
    return [*chosen, *few], _chance(len(every), len(chosen), strata)


def _chance(cases: int, drawn: int, strata: Iterable[object]) -> str:
    """Return the chance to see one of forged cases that are spread over all that carry a rank."""
    forged = max(1, round(FORGED * cases))
    seen = 1 - comb(cases - forged, drawn) / comb(cases, drawn) if cases else 0.0
    text = f"{drawn} of {cases} that carry the rank, at {len(list(strata))} settings: were a tenth "
    return f"{text}forged, one would be seen with a chance of {100 * seen:.0f} %"
