"""What the self-test tries once, for there is no chance in it: stored rows, and equal noise."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from flexaxis.experiments.comparison.ranking import REFERENCE
from flexaxis.experiments.gate.decide import BETTER, SAME, UNDECIDED, WORSE
from flexaxis.experiments.gate.gate import Question, at_equal_noise, compare
from flexaxis.experiments.gate.pairs import Table
from flexaxis.experiments.gate.stored import compare_rows
from flexaxis.experiments.running.bench import Bench, Runs
from flexaxis.sim.scenario import Scenario

FAILED = 0.85  # share of the candidate's cases that fail
SLOWER = 1.5  # times the lag of the candidate, at every turn of its knob
MARK = "1e-12"
TURNED = f"{REFERENCE}[forgetting=0.99,regularization={MARK}]"
"""The reference with its knob elsewhere; the other option, which does nothing, tells its rows."""

Tried = tuple[str, bool]  # what should be said, and whether it is


def stored(base: Table, margins: Mapping[str, float]) -> Iterator[Tried]:
    """Yield what is said of an estimator's rows beside the same with something the matter.

    Parameters
    ----------
    base : mapping
        As from `flexaxis.experiments.gate.pairs.table`.
    margins : mapping of metric to float
    """
    same = compare_rows(base, base, margins)
    yield "stored, the same rows: called the same", same.verdict == SAME
    cases = list(dict.fromkeys(key[:2] for key in base))
    gone = {*cases[: round(FAILED * len(cases))]}
    found = compare_rows(base, _failing(base, gone), margins)
    yield f"stored, {100 * FAILED:g} % of the cases failed: called worse", found.verdict == WORSE
    found = compare_rows(base, _failing(base, {*cases[:1]}), margins)
    yield "stored, one case failed: status 3", found.status() == 3
    fewer = {key: row for key, row in base.items() if key[0] != cases[0][0]}
    if fewer:
        found = compare_rows(base, fewer, margins)
        right = (found.verdict, found.status()) == (UNDECIDED, 3)
        yield "stored, the candidate lacks a scenario: undecided, status 3", right
        found = compare_rows(fewer, base, margins)
        yield "stored, the base lacks a scenario: undecided", found.verdict == UNDECIDED


def _failing(rows: Table, cases: set[tuple[str, int]]) -> Table:
    lost = {"failed": True, "diverged": True}
    return {key: dict(row) | lost if key[:2] in cases else row for key, row in rows.items()}


def equal_noise(
    scenarios: Sequence[Scenario],
    margins: Mapping[str, float],
    seeds: Sequence[int],
    bench: Bench,
) -> Iterator[Tried]:
    """Yield what is said of the reference beside itself with its knob elsewhere, and slower.

    Parameters
    ----------
    scenarios : sequence of Scenario
    margins : mapping of metric to float
    seeds : sequence of int
    bench : Bench
    """
    question = at_equal_noise(Question(REFERENCE, TURNED, scenarios, seeds, margins), bench)
    word = compare(question, bench).verdict
    yield "equal noise, another knob: not worse, not better", word not in {WORSE, BETTER}
    word = compare(question, _Slower(bench)).verdict
    yield f"equal noise, {SLOWER:g} × the lag: called worse", word == WORSE


class _Slower(Bench):
    """A bench on which one estimator lags more than it does, and is as noisy."""

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def runs(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the rows of some cases."""
        return self.with_failed(scenarios, estimators, seeds)

    def with_failed(
        self, scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int]
    ) -> dict[tuple[str, str], Runs]:
        """Return the same."""
        found = self._bench.with_failed(scenarios, estimators, seeds)
        return {
            key: [[_slower(row) for row in run] for run in runs] if MARK in key[1] else runs
            for key, runs in found.items()
        }


def _slower(row: dict[str, Any]) -> dict[str, Any]:
    return row | {"lag": row["lag"] and SLOWER * row["lag"]}
