"""A benchmark from names to a folder: run, write rows as they come, pool, report."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import happens
from flexaxis.experiments.reporting.run_page import render
from flexaxis.experiments.running import files as results
from flexaxis.experiments.running import harness
from flexaxis.experiments.running.cache import RecordCache
from flexaxis.experiments.scoring.pooling import pool
from flexaxis.experiments.scoring.ranking import overall
from flexaxis.experiments.studies import sweep
from flexaxis.sim.scenario import Scenario


@dataclass(frozen=True)
class Plan:
    """What a benchmark runs.

    Attributes
    ----------
    title : str
        Headline of the report.
    scenarios : sequence of Scenario
    estimators : sequence of str
        Texts as for `--estimator`.
    seeds : sequence of int
    command : str
        The line that runs it again.
    swept_scenarios : sequence of Scenario
    swept_estimators : sequence of str
        Those to sweep over their knobs on these, to compare them at equal noise.
    """

    title: str
    scenarios: Sequence[Scenario]
    estimators: Sequence[str]
    seeds: Sequence[int]
    command: str
    swept_scenarios: Sequence[Scenario] = ()
    swept_estimators: Sequence[str] = ()

    @property
    def cases(self) -> int:
        """Number of cases: one estimator, at one setting, on one record."""
        plain = len(self.scenarios) * len(self.estimators)
        swept = len(self.swept_scenarios) * len(sweep.texts(sweep.settings(self.swept_estimators)))
        return (plain + swept) * len(self.seeds)


def benchmark(
    plan: Plan,
    folder: Path,
    *,
    jobs: int = 1,
    store: RecordCache | None = None,
    advance: Callable[[harness.Done], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> results.Results:
    """Run a plan and write scores.jsonl, summary.json, curves.nc and report.html to a folder.

    Parameters
    ----------
    plan : Plan
    folder : Path
        Made if it is missing. An older complete result in it is replaced when this one is
        complete.
    jobs : int
        Processes.
    store : RecordCache, optional
        Where records are kept for the next run.
    advance : callable, optional
        Called with what was done since the last call.
    say : callable, optional
        Called with what goes on after the last case, which may take a while.

    Raises
    ------
    OutputError
        If the folder cannot be written to; that is tried before anything is computed.
    EstimatorError, SimulationError
        As from `harness.run`; the rows so far are in scores.part.jsonl.
    """
    cases: list[harness.Case] = []
    # Wrong estimators are found here, before the folder is touched.
    tasks = harness.run(plan.scenarios, plan.estimators, plan.seeds, jobs=jobs, store=store)
    with results.RowWriter(folder) as writer:
        for done in tasks:
            writer.write([row for case in done.cases for row in case.rows])
            cases += done.cases
            if advance:
                advance(done)
        swept = _sweep(plan, jobs=jobs, store=store, advance=advance)
        if say:
            say("pooling scores and drawing the report …")
        rows, curves = pool(cases, plan.scenarios)
        summary = _summary(plan, rows) | {"as_set": sweep.as_set(cases), "tradeoff": swept}
        found = results.Results(summary, curves)
        results.save(folder, found)
        results.write_text(folder / results.REPORT, render(found))
        writer.finish()
    return found


def _sweep(
    plan: Plan,
    *,
    jobs: int,
    store: RecordCache | None,
    advance: Callable[[harness.Done], None] | None,
) -> dict[str, Any] | None:
    """Return the points of the trade-off figure, and the lags at equal noise."""
    if not plan.swept_scenarios:
        return None
    found = sweep.sweep(
        plan.swept_scenarios,
        plan.swept_estimators,
        plan.seeds,
        jobs=jobs,
        store=store,
        advance=advance,
    )
    return asdict(found) | {
        "overall": overall(found.at_excess),
        "faults": {s.name: happens(s) for s in plan.swept_scenarios},
    }


def _summary(plan: Plan, rows: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "title": plan.title,
        "command": plan.command,
        "versions": {name: version(name) for name in ("flexaxis", "mujoco", "numpy", "numba")},
        "seeds": list(plan.seeds),
        "scenarios": {s.name: {"hash": s.hash, "definition": s.resolved()} for s in plan.scenarios},
        "estimators": {text: describe(text) for text in plan.estimators},
        "rows": rows,
    }


def describe(text: str) -> str:
    """Return what an estimator is, in a line: of the registry, or the user's own."""
    name = text.partition("[")[0].strip()
    return REGISTRY[name].summary if name in REGISTRY else "an estimator of your own"


def command_line(words: Sequence[str]) -> str:
    """Return the line that runs a command again, quoted for a shell."""
    return shlex.join(["flexaxis", *words])
