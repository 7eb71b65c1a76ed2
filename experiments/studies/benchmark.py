"""A run, from names to a folder: a study without axes, with its summary, figures and report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.card import happens
from flexaxis.experiments.comparison.ranking import overall
from flexaxis.experiments.reporting.run.page import render
from flexaxis.experiments.reporting.study.page import write_report
from flexaxis.experiments.results.pooled import Pooled, with_curves
from flexaxis.experiments.results.results import Results
from flexaxis.experiments.running.bench import Bench
from flexaxis.experiments.running.cache import kept_runs
from flexaxis.experiments.running.engine import Means, run_study
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.running.plan import make_plan
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.scoring.scores import failed_track, relative_error
from flexaxis.experiments.scoring.summary import POOLED, of_trajectories
from flexaxis.experiments.storage.files import (
    REPORT,
    STUDY,
    SUMMARY,
    SWEEP,
    StudyError,
    write_json,
    write_text,
)
from flexaxis.experiments.storage.schema import row_files
from flexaxis.experiments.storage.traces import Traces
from flexaxis.experiments.studies import sweep
from flexaxis.experiments.studies.as_set import as_set
from flexaxis.sim.scenario import Scenario, scenario_from


@dataclass(frozen=True)
class Benchmark:
    """What a run runs.

    Attributes
    ----------
    study : Study
        Without axes.
    title : str
        Headline of the report.
    command : str
        The line that runs it again.
    swept_scenarios : sequence of Scenario
    swept_estimators : sequence of str
        Those to sweep over their knobs on these, to compare them at equal noise.
    """

    study: Study
    title: str
    command: str
    swept_scenarios: Sequence[Scenario] = ()
    swept_estimators: Sequence[str] = ()

    @property
    def cases(self) -> int:
        """Number of cases: one estimator, at one setting, on one record."""
        plain = len(self.study.scenarios) * len(self.study.estimators)
        swept = len(self.swept_scenarios) * len(sweep.texts(sweep.settings(self.swept_estimators)))
        return (plain + swept) * len(self.study.seeds)


def benchmark(
    wanted: Benchmark,
    folder: Path,
    means: Means | None = None,
    *,
    shard: tuple[int, int] = (1, 1),
    overwrite: bool = False,
    say: Callable[[str], None] | None = None,
) -> Pooled | None:
    """Run what is missing, and write summary.json and report.html to the folder.

    Parameters
    ----------
    wanted : Benchmark
    folder : Path
        Made if it is missing. Cases that it holds are kept, and not run again.
    means : Means, optional
    shard : (int, int)
        As in `Plan`. A share has no summary, so None is returned; `run --from` reports on all.
    overwrite : bool
        Whether to remove what is there first.
    say : callable, optional
        Called with what goes on after the last case, which may take a while.

    Raises
    ------
    OutputError
        If the folder cannot be written to; that is tried before anything is computed.
    StudyError, EstimatorCrash
        If an estimator cannot be made, or as from `run_study`. One that fails on a record is a row
        with its error.
    """
    means = means or Means()
    sweeping = {
        "scenarios": [s.resolved() for s in wanted.swept_scenarios],
        "estimators": list(wanted.swept_estimators),
    }
    about = {"title": wanted.title, "command": wanted.command, "tradeoff": sweeping}
    how: dict[str, Any] = {"overwrite": overwrite, "traced": True, "run_code": True}
    with kept_runs(means.store), means.kept() as means:
        plan = make_plan(wanted.study, shard=shard, run_code=True)
        run_study(plan, folder, means, about=about, **how)
        return finish(folder, means, say=say) if shard == (1, 1) else None


def finish(
    folder: Path, means: Means | None = None, *, say: Callable[[str], None] | None = None
) -> Pooled:
    """Sweep what is still to be swept, pool the rows in the folder of a run, write its report.

    Parameters
    ----------
    folder : Path
        All cases of its study.json are there, as after `run_study` or `merge`.
    means : Means, optional
    say : callable, optional
        As for `benchmark`.
    """
    study = read_study(folder)
    scenarios = [scenario_from(s["definition"], source=str(folder)) for s in study["scenarios"]]
    swept = _sweep(study, folder, means)
    if say:
        say("pooling scores and drawing the report …")
    results = Results.load(folder)
    groups = results.grouped(["base", "method"])
    rows = groups.pooled(POOLED)
    whole = _with_trajectories(folder, study, {s.name: s for s in scenarios}, rows)
    summary = _summary(study, whole) | {
        "failures": _failures(folder, swept, study["seeds"]),
        "as_set": as_set(groups, rows),
        "tradeoff": swept,
    }
    found = with_curves(folder, summary)
    (folder / SUMMARY).unlink(missing_ok=True)  # of another question
    write_text(folder / REPORT, render(found))
    write_json(folder / SUMMARY, summary)  # last: a folder without one is not complete
    return found


def _with_trajectories(
    folder: Path,
    study: Mapping[str, Any],
    scenarios: Mapping[str, Scenario],
    rows: Sequence[Mapping[str, Any]],
) -> list[dict[str, Any]]:
    """Return the pooled rows of a run with what takes trajectories.

    Those of one estimator on one scenario are in memory at a time.
    """
    traces = Traces(folder, study.get("code", {}), study["seeds"])
    found = []
    for (name, estimator), own in groupby(rows, key=lambda row: (row["base"], row["method"])):
        scenario = scenarios.get(name)
        if scenario is None:
            raise StudyError(
                f"{folder}: its rows are of a scenario {name!r}, of which {STUDY} says nothing: "
                "one of the two was changed"
            )
        known = list(traces.find(scenario.hash, estimator).values())
        nothing = failed_track(scenario, scenario.true_parameters())
        lost = {name: each.astype(np.float32) for name, each in relative_error(nothing).items()}
        for row in own:
            errors = [t.relative[row["parameter"]] for t in known if row["parameter"] in t.relative]
            errors += [lost[row["parameter"]]] * row["failed"] if row["parameter"] in lost else []
            identity = {"scenario": name, "hash": scenario.hash, "estimator": estimator,
                        "parameter": row["parameter"], "changed": row["changed"],
                        "seeds": row["seeds"], "runs": row["runs"]}  # fmt: skip
            scores = {key: value for key, value in row.items() if key not in OF_A_STUDY}
            further = of_trajectories(errors, row["bound"], period=scenario.period)
            found.append(identity | scores | further)
    return found


OF_A_STUDY = ("base", "method", "hours", "false_alarms_per_hour", "false_alarms_per_hour_interval")
FAILURE = ("scenario", "estimator", "seed", "error")


def _sweep(study: Mapping[str, Any], folder: Path, means: Means | None) -> dict[str, Any] | None:
    """Return the points of the trade-off figure, and the lags at equal noise."""
    wanted = study.get("tradeoff") or {"scenarios": []}
    if not wanted["scenarios"]:
        return None
    scenarios = [scenario_from(s, source=str(folder)) for s in wanted["scenarios"]]
    with Bench(scenarios, folder / SWEEP, means) as bench:
        able = sweep.able(scenarios, wanted["estimators"], study["seeds"], bench)
        found = sweep.sweep(scenarios, able, study["seeds"], bench)
    return asdict(found) | {
        "left_out": [name for name in wanted["estimators"] if name not in able],
        "overall": overall(found.at_excess),
        "faults": {s.name: happens(s) for s in scenarios},
    }


def _failures(
    folder: Path, swept: Mapping[str, Any] | None, seeds: Sequence[int]
) -> list[dict[str, Any]]:
    """Return what could not be run; of the sweep what left an estimator out of it."""
    found = Results.load(folder).failures()
    if swept and swept["left_out"]:
        mine = sweep.texts(sweep.settings(swept["left_out"]))
        there = Results.load(folder / SWEEP).select({"seed": list(seeds)}).failures()
        names = set(swept["faults"])
        found += [r for r in there if r["estimator"] in mine and r["scenario"] in names]
    return [{key: row[key] for key in FAILURE} for row in found]


def _summary(study: Mapping[str, Any], pooled: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "title": study.get("title", study["name"]),
        "command": study.get("command", ""),
        "versions": {name: version(name) for name in ("flexaxis", "mujoco", "numpy", "numba")},
        "seeds": list(study["seeds"]),
        "scenarios": {e["definition"]["name"]: e for e in study["scenarios"]},
        "estimators": {text: describe(text) for text in study["estimators"]},
        "rows": pooled,
    }


def describe(text: str) -> str:
    """Return what an estimator is, in a line: of the registry, or the user's own."""
    name = text.partition("[")[0].strip()
    return REGISTRY[name].summary if name in REGISTRY else "an estimator of your own"


def report(folder: Path, means: Means | None = None) -> Path:
    """Write report.html into a folder with rows, of a study or of a run, and return its path.

    A study without axes is a run, and gets the summary and the report of one.

    Parameters
    ----------
    folder : Path
    means : Means, optional
        With what a run is swept over its knobs, as far as that is not done.

    Raises
    ------
    StudyError
        If the folder is of neither.
    OutputError
        If it cannot be written.
    """
    if read_study(folder)["axes"]:
        return write_report(Results.load(folder))
    finish(folder, means)
    return folder / REPORT


def inputs(folder: Path) -> list[Path]:
    """Return the files in a folder that a report or an export is made of."""
    return [*(folder / name for name in (STUDY, SUMMARY)), *row_files(folder)]
