"""Verify an entry: its code in a cage, reported rows again, and its scores on unknown seeds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board.agreement import agreements
from flexaxis.experiments.board.cage import Cage
from flexaxis.experiments.board.entry import Entry
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.hidden import Draw
from flexaxis.experiments.board.rerun import How, rerun
from flexaxis.experiments.board.rules import rules
from flexaxis.experiments.board.stored import own
from flexaxis.experiments.board.suite import Board, board
from flexaxis.experiments.board.unseen import SEEDS, Rows, pairs, ranked, reported
from flexaxis.experiments.board.verdict import Check, Verdict, of_form
from flexaxis.experiments.building.consent import require
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.rows import read as read_rows
from flexaxis.experiments.running.rows import row_files
from flexaxis.experiments.running.verify import differences
from flexaxis.experiments.studies.sweep import reference
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Run = Callable[[str, Scenario, Sequence[int], How], dict[int, Rows]]
"""Runs an estimator on some seeds of a scenario, and gives its rows by seed."""


@dataclass(frozen=True)
class Ask:
    """How much is looked at.

    Attributes
    ----------
    sample : int
        Reported cases that are run again.
    hidden : int
        Unknown seeds, on each scenario; and as many others for faults that come earlier.
    draw : Draw
    patience : float
        How long the code may take for an answer [s].
    plain : bool
        Whether its code runs with the rights of the user, where it cannot be shut in.
    """

    sample: int = 10
    hidden: int = 8
    draw: Draw = field(default_factory=Draw.new)
    patience: float = 600.0
    plain: bool = False


def verify_entry(
    folder: Path,
    ask: Ask,
    *,
    run_code: bool = False,
    command: str | None = None,
    store: RecordCache | None = None,
    frozen: Board | None = None,
    told: Callable[[Check], object] = lambda check: None,
) -> Verdict:
    """Return what is found of an entry, its code included.

    Parameters
    ----------
    folder : Path
    ask : Ask
    run_code : bool
        Whether its code may be run, if it names some.
    command : str, optional
        The line that was typed, as for `consent.require`.
    store : RecordCache, optional
    frozen : Board, optional
    told : callable, optional
        Called with each check when it is done.

    Raises
    ------
    EntryError
        If it is not as it was written.
    CodeRefused
        If it names code that may not be run.
    CageError
        If its code cannot be shut in, and `ask.plain` does not say to run it all the same.
    """
    entry, found = of_form(folder, frozen)
    for check in found.checks:
        told(check)
    require(run_code, [entry.estimator], source=str(folder), command=command)
    if not found.holds:
        return found
    found.token = ask.draw.token
    frozen = frozen or board()
    mine = frozen.quick() if entry.quick else frozen
    with Cage(entry.folder, patience=ask.patience, plain=ask.plain) as cage:
        found.isolation = cage.reached
        for check in _said(_of_code(entry, mine, ask, cage, store)):
            found.checks.append(check)
            told(check)
    return found


def _said(checks: Iterator[Check]) -> Iterator[Check]:
    """Yield checks, and one that fails where rows are not what rows are."""
    try:
        yield from checks
    except FlexaxisError:
        raise
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        yield Check("rows", False, f"are not what rows are: {error!r}")


def _of_code(
    entry: Entry, frozen: Board, ask: Ask, cage: Cage, store: RecordCache | None
) -> Iterator[Check]:
    rows = [row for file in row_files(entry.run) for row in read_rows(file)]

    def run(text: str, scenario: Scenario, seeds: Sequence[int], how: How) -> dict[int, Rows]:
        found, _ = records(scenario, list(seeds), store)
        return {int(r.seed or 0): rerun(cage, text, scenario, r, how) for r in found}

    yield from _rules(entry, frozen, cage, store)
    yield _same(rows, entry, frozen, ask, run)
    yield from _unknown(rows, entry, frozen, ask, run)


def _rules(entry: Entry, frozen: Board, cage: Cage, store: RecordCache | None) -> Iterator[Check]:
    base = next((s for s in frozen.scenarios if s.name in entry.settings), frozen.scenarios[0])
    try:
        found = rules(cage, entry.estimator, base, store)
    except (EstimatorError, EntryError) as error:
        yield Check("rules", False, str(error))
        return
    broken = [rule for rule in found if rule.holds is False]
    for rule in broken:
        yield Check(f"rule: {rule.rule}", False, rule.seen)
    if not broken:
        held = sum(rule.holds is True for rule in found)
        yield Check("rules", True, f"{held} rules of `flexaxis check` hold")


def _same(
    rows: Sequence[Mapping[str, Any]], entry: Entry, frozen: Board, ask: Ask, run: Run
) -> Check:
    """Check that a sample of reported cases comes out again, also where nobody knows the truth."""
    known = {scenario.hash: scenario for scenario in frozen.scenarios}
    cases: dict[tuple[str, str, int], list[Mapping[str, Any]]] = {}
    for row in rows:
        if row["hash"] in known and row["seed"] in frozen.seeds:
            cases.setdefault((row["hash"], row["estimator"], row["seed"]), []).append(row)
    others = [key for key in sorted(cases) if key[1] == reference()]
    mine = {text for line in entry.settings.values() for text in line} | {entry.estimator}
    own_ = [key for key in sorted(cases) if key[1] in mine]  # rows of anything else are not run
    random = ask.draw.random("sample")
    chosen = random.sample(own_, min(ask.sample, len(own_)))
    chosen += random.sample(others, min(max(1, ask.sample // 5), len(others)))
    wrong: list[str] = []
    for key, text, seed in chosen:
        what = f"{known[key].name}, {text}, seed {seed}"
        try:
            made = run(text, known[key], [seed], "run")[seed]
        except (EstimatorError, EntryError) as error:
            wrong.append(f"{what}: {error}")
            continue
        told = next(iter(_differ(cases[key, text, seed], made)), "")
        wrong += [f"{what}: {told}"] if told else []
    words = f"{len(chosen) - len(wrong)} of {len(chosen)} reported cases come out again"
    words += " where the code is given samples and nothing else"
    return Check("reported rows", not wrong, f"{words}; {wrong[0]}" if wrong else words)


def _differ(rows: Sequence[Mapping[str, Any]], made: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    if len(rows) != len(made):
        yield f"{len(rows)} rows were, {len(made)} are"
        return
    for row, other in zip(rows, made, strict=True):
        mine = {key: row.get(key) for key in other}
        for text in differences(mine, dict(other), exact=False):
            yield f"{other['parameter']}: {text}"


def _unknown(
    rows: Sequence[Mapping[str, Any]], entry: Entry, frozen: Board, ask: Ask, run: Run
) -> Iterator[Check]:
    """Check all that carries a rank on unknown seeds, sample by sample, faults earlier too."""
    settings = ranked(entry, own(entry, frozen), frozen)
    known = reported(rows, settings, frozen)
    seeds = ask.draw.seeds(2 * ask.hidden)

    def make(text: str, scenario: Scenario, seeds: Sequence[int]) -> dict[int, Rows]:
        return run(text, scenario, seeds, "step")

    try:
        found = list(pairs(settings, known, seeds, ask.draw.moved, make))
    except (EstimatorError, EntryError) as error:
        yield Check(SEEDS, False, str(error))
        return
    for each in agreements(found):
        yield Check(each.name, each.holds, each.in_words())
