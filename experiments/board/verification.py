"""Verify an entry: its files, its reported rows again, and its scores where nobody knew them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board.entry import BoardEntry, EntryError, read
from flexaxis.experiments.board.hidden_seeds import Draw, Pair, agreements, sample
from flexaxis.experiments.board.ranking import (
    Board,
    Own,
    Stored,
    board,
    check_rows,
    own_of,
    reference_rows,
)
from flexaxis.experiments.board.sandbox import Sandbox
from flexaxis.experiments.building.code import require
from flexaxis.experiments.building.estimator_text import check_fits
from flexaxis.experiments.building.offer import offer_of, torque_of
from flexaxis.experiments.comparison import mismatch
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.case import identity_of, track_of
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.verify import differences
from flexaxis.experiments.scoring.summary import scored
from flexaxis.experiments.storage.files import dumps
from flexaxis.sim.record import Record
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

Rows = list[dict[str, Any]]

COMPARED = ("parameter", "changed", "lag", "std", "std_after", "excess", "score", "diverged",
            "detection")  # fmt: skip
"""What of a reported row has to come out again: all that a board says of it."""
UNKNOWN = "unknown cases"


@dataclass(frozen=True)
class Check:
    """One thing that was looked at: whether it holds, None where it does not apply, and what."""

    name: str
    holds: bool | None
    seen: str


@dataclass
class Verification:
    """What is found of an entry.

    Attributes
    ----------
    label, digest, contact : str
        Of the entry.
    quick : bool
    checks : list of Check
    confined : bool
        Whether its code could do no harm.
    isolation : dict of str to bool
        What held in the process of its code; empty where nothing was run.
    token : str
        What cases were drawn from; empty where nothing was run.
    sample, hidden : int
        How much was looked at, as in `Ask`; 0 where nothing was run.
    flexaxis : str
        Version that verified.
    """

    label: str
    digest: str
    contact: str
    quick: bool
    checks: list[Check] = field(default_factory=list)
    confined: bool = False
    isolation: dict[str, bool] = field(default_factory=dict)
    token: str = ""
    sample: int = 0
    hidden: int = 0
    flexaxis: str = field(default_factory=lambda: version("flexaxis"))

    @property
    def ran(self) -> bool:
        """Whether its code was run."""
        return bool(self.token)

    @property
    def holds(self) -> bool:
        """Whether nothing was found against it."""
        return all(check.holds is not False for check in self.checks)

    @property
    def accepted(self) -> bool:
        """Whether its code was run, shut in, and nothing was found."""
        return self.ran and self.holds and self.confined

    def as_json(self) -> dict[str, Any]:
        """Return it as it is stored and printed."""
        return asdict(self) | {"ran": self.ran, "holds": self.holds, "accepted": self.accepted}


@dataclass(frozen=True)
class Ask:
    """How much is looked at.

    Attributes
    ----------
    sample : int
        Reported cases that are run again.
    hidden : int
        Cases that nobody could know, of each setting that carries the rank.
    draw : Draw
    patience : float
        How long the code may take for an answer [s].
    confined : bool
        False for code of one's own, which then has the rights of the user.
    """

    sample: int = 10
    hidden: int = 8
    draw: Draw = field(default_factory=Draw.new)
    patience: float = 600.0
    confined: bool = True


def of_form(folder: Path, frozen: Board | None = None) -> tuple[BoardEntry, Verification]:
    """Return an entry, and what its files say; EntryError if it is not as it was written."""
    entry = read(folder)
    mine = mine_of(entry, frozen)
    found = Verification(entry.label, entry.digest, entry.about.contact, entry.quick)
    same = entry.suite == mine.hash
    words = f"{mine.name}, {len(mine.seeds)} seeds"
    wrong = check_rows(entry, mine) if same else ""
    rows = wrong or ("of each setting and seed once" if same else "not looked at")
    found.checks += [
        Check("as it was written", True, f"digest {entry.digest[:16]}"),
        Check("on the frozen suite", same, words if same else f"another suite than {words}"),
        Check("rows of this suite", not wrong if same else None, rows),
    ]
    return entry, found


def mine_of(entry: BoardEntry, frozen: Board | None = None) -> Board:
    """Return what an entry is scored on: the suite, or the same with few seeds."""
    frozen = frozen or board()
    return frozen.quick() if entry.quick else frozen


def verify_entry(
    folder: Path,
    ask: Ask,
    *,
    run_code: bool = False,
    command: str | None = None,
    means: Means | None = None,
    frozen: Board | None = None,
    told: Callable[[Check], object] = lambda check: None,
) -> Verification:
    """Return what is found of an entry, its code included.

    Parameters
    ----------
    folder : Path
    ask : Ask
    run_code : bool
        Whether its code may be run, if it names some.
    command : str, optional
        The line that was typed, as for `building.code.require`.
    means : Means, optional
        With what the reference is run.
    frozen : Board, optional
    told : callable, optional
        Called with each check when it is done.

    Raises
    ------
    EntryError
        If it is not as it was written.
    CodeRefused
        If it names code that may not be run.
    SandboxError
        If its code cannot be shut in, and `ask.confined` does not say to run it all the same.
    """
    entry, found = of_form(folder, frozen)
    for check in found.checks:
        told(check)
    require(run_code, [entry.estimator], source=str(folder), command=command)
    if not found.holds:
        return found
    mine, means = mine_of(entry, frozen), means or Means()
    with Sandbox(entry.folder, patience=ask.patience, confined=ask.confined) as sandbox:
        found.confined, found.isolation = ask.confined, sandbox.reached
        found.token, found.sample, found.hidden = ask.draw.token, ask.sample, ask.hidden
        own = own_of(entry, mine, reference_rows(mine, means))
        trial = _Trial(entry, mine, _ranked(entry, own, mine), ask, sandbox)
        for check in chain(trial.reported(means.store), trial.drawn()):
            found.checks.append(check)
            told(check)
    return found


@dataclass(frozen=True)
class _Ranked:
    """A setting of which a rank is made, and what it is compared together with."""

    scenario: Scenario
    text: str
    group: str

    @property
    def what(self) -> str:
        return f"{self.scenario.name} {self.text}"


def _ranked(entry: BoardEntry, own: Own, mine: Board) -> list[_Ranked]:
    """Return all settings that carry a rank: on either side of the match, or as entered.

    Between the two settings on either side of the reference's noise the match is interpolated: who
    is as honest at both as on reported seeds is so at the match.
    """
    known = {scenario.name: scenario for scenario in mine.scenarios}
    found: dict[tuple[str, str], _Ranked] = {}
    for row in own.at_excess:
        scenario = known[row["scenario"]]
        order = sorted(row["settings"], key=entry.settings(scenario).__getitem__)
        sides = ("quieter", "noisier") if len(order) > 1 else ("nearest",)
        for text, side in zip(order, sides, strict=True):
            group = f"{mismatch.track_of(scenario)}, {side} setting"
            found.setdefault((scenario.name, text), _Ranked(scenario, text, group))
    for row in own.as_set:
        scenario = known[row["scenario"]]
        found[scenario.name, ""] = _Ranked(scenario, entry.estimator, mismatch.NUISANCE)
    return list(found.values())


def rerun(sandbox: Sandbox, text: str, scenario: Scenario, record: Record) -> Rows:
    """Return the rows of a case, one a parameter, as JSON has them; errors as of `Sandbox.case`.

    The code gets sample after sample, each when the estimate before it is back: nothing can be
    known of what comes. Scores are taken here, where the truth is.
    """
    offer = offer_of(scenario).as_data() | {"name": "the scenario"}
    u, y = record.torque.tolist(), getattr(record, scenario.output).tolist()
    there = [True] * len(u) if record.valid is None else record.valid.tolist()
    asked = {"estimator": text, "offer": offer}
    with sandbox.case(asked, partial(torque_of, scenario)) as estimator:
        check_fits(text, estimator.names, estimator.output, scenario)
        samples = zip(u, y, there, strict=True)
        theta = np.array([estimator.step(a, b if ok else None) for a, b, ok in samples])
        found, names = estimator.findings, estimator.names
    track = track_of(scenario.drawn(record.seed or 0), record, names, theta, None, None, found)
    identity = identity_of(scenario, text, record.seed)
    case = scored(track, estimator=text, identity=identity, cost={})
    return [json.loads(dumps(row)) for row in case.rows]


@dataclass(frozen=True)
class _Trial:
    """An entry whose code runs in a sandbox, with the settings that carry its rank."""

    entry: BoardEntry
    board: Board
    ranked: Sequence[_Ranked]
    ask: Ask
    sandbox: Sandbox

    @cached_property
    def rows(self) -> dict[tuple[str, str], dict[int, Rows]]:
        return Stored(self.entry.rows()).by_setting

    def reported(self, store: RecordCache | None) -> Iterator[Check]:
        """Check that a sample of reported cases comes out again where nobody knows the truth."""
        random = self.ask.draw.random("sample")
        chosen, words = sample(self.ranked, self.board.seeds, self.ask.sample, random)
        wrong = []
        for each, seed in chosen:
            try:
                record = records(each.scenario, [seed], store)[0][0]
                made = rerun(self.sandbox, each.text, each.scenario, record)
                told = next(_differ(self.rows[each.scenario.hash, each.text][seed], made), "")
            except (EstimatorError, EntryError) as error:
                told = str(error)
            wrong += [f"{each.what}, seed {seed}: {told}"] if told else []
        held = f"{len(chosen) - len(wrong)} of {len(chosen)} reported cases come out again"
        held += f" where the code is given samples and nothing else ({words})"
        yield Check("reported rows", not wrong, f"{held}; {wrong[0]}" if wrong else held)

    def drawn(self) -> Iterator[Check]:
        """Check all that carries a rank in cases that nobody could know, each drawn for itself."""
        try:
            pairs = [self._pair(group) for group in dict.fromkeys(r.group for r in self.ranked)]
        except (EstimatorError, EntryError) as error:
            yield Check(UNKNOWN, False, str(error))
            return
        for found in agreements(pairs):
            yield Check(UNKNOWN, found.holds, found.in_words())

    def _pair(self, group: str) -> Pair:
        usual: dict[tuple[str, int], Rows] = {}
        drawn: dict[tuple[str, int], Rows] = {}
        for each in (each for each in self.ranked if each.group == group):
            runs = self.rows[each.scenario.hash, each.text]
            usual |= {(each.what, seed): runs[seed] for seed in self.board.seeds}
            for number in range(self.ask.hidden):
                scenario, seed = self.ask.draw.case(each.scenario, each.text, number)
                record = simulate(scenario, [seed])[0]
                drawn[each.what, number] = rerun(self.sandbox, each.text, scenario, record)
        return Pair(group, usual, drawn)


def _differ(rows: Sequence[Mapping[str, Any]], made: Rows) -> Iterator[str]:
    if len(rows) != len(made):
        yield f"{len(rows)} rows were, {len(made)} are"
        return
    for row, other in zip(rows, made, strict=True):
        one, two = ({key: each.get(key) for key in COMPARED} for each in (row, other))
        for text in differences(one, two, exact=False):
            yield f"{other['parameter']}: {text}"
