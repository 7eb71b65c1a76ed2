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
from flexaxis.experiments.comparison import sweep
from flexaxis.experiments.comparison.ranking import overall
from flexaxis.experiments.files import REPORT, SUMMARY, write_json, write_text
from flexaxis.experiments.reporting import run as run_report
from flexaxis.experiments.reporting import study as study_report
from flexaxis.experiments.reporting.inputs import RunInputs
from flexaxis.experiments.reporting.words import faults_of, widest
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.study import Study
from flexaxis.experiments.scoring.scores import failed_track, relative_error
from flexaxis.experiments.scoring.summary import of_trajectories
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
    wanted: Benchmark, runner: Runner, *, shard: tuple[int, int] = (1, 1),
    say: Callable[[str], object] | None = None,
) -> Results:  # fmt: skip
    """Run what is missing, and write summary.json and report.html to the folder of the runner.

    Parameters
    ----------
    wanted : Benchmark
    runner : Runner
        With a folder.
    shard : (int, int)
        As in `Runner.run`. A shard has no summary: `take` puts shards together first.
    say : callable, optional
        Called with what goes on after the last case.

    Raises
    ------
    OutputError, StudyError, EstimatorCrash, NotRun
        As from `Runner.run`.
    """
    sweeping = {
        "scenarios": [s.resolved() for s in wanted.swept_scenarios],
        "estimators": list(wanted.swept_estimators),
    }
    about = {"title": wanted.title, "command": wanted.command, "tradeoff": sweeping}
    results = runner.run(wanted.study, shard=shard, traces=True, about=about)
    if shard == (1, 1):
        finish(results, runner, say=say)
    return results


def finish(results: Results, runner: Runner, *, say: Callable[[str], object] | None = None) -> None:
    """Sweep what is to be swept, pool the rows of a run, and write its summary and report.

    Parameters
    ----------
    results : Results
        All cases of a run.
    runner : Runner
        Of the same folder.
    say : callable, optional
        As for `benchmark`.
    """
    assert results.folder is not None
    swept = _sweep(results, runner)
    if say:
        say("pooling scores and drawing the report …")
    rows = results.pooled("scenario", "estimator")
    failures = results.failures.to_dict("records")
    if swept:
        failures += swept.pop("failures")
    summary = _summary(results.study, _with_trajectories(results, rows)) | {
        "failures": [{key: row[key] for key in FAILURE} for row in failures],
        "as_set": as_set(results, rows),
        "tradeoff": swept,
    }
    (results.folder / SUMMARY).unlink(missing_ok=True)  # of another question
    write_text(results.folder / REPORT, run_report.render(RunInputs(results, summary)))
    write_json(results.folder / SUMMARY, summary)  # last: a folder without one is not complete


def _with_trajectories(results: Results, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the pooled rows of a run with what takes trajectories.

    Those of one estimator on one scenario are in memory at a time.
    """
    scenarios = {entry["definition"]["name"]: scenario_from(entry["definition"], source="run")
                 for entry in results.study["scenarios"]}  # fmt: skip
    found = []
    for (name, estimator), own in groupby(rows, key=lambda r: (r["scenario"], r["estimator"])):
        scenario = scenarios[name]
        known = list(results.traces(scenario.hash, estimator).values())
        nothing = failed_track(scenario, scenario.true_parameters())
        lost = {name: each.astype(np.float32) for name, each in relative_error(nothing).items()}
        for row in own:
            errors = [t.relative[row["parameter"]] for t in known if row["parameter"] in t.relative]
            errors += [lost[row["parameter"]]] * row["failed"] if row["parameter"] in lost else []
            identity = {"scenario": name, "hash": scenario.hash, "estimator": estimator}
            further = of_trajectories(errors, row["bound"], period=scenario.period)
            found.append(row | identity | further)
    return found


FAILURE = ("scenario", "estimator", "seed", "error")


def _sweep(results: Results, runner: Runner) -> dict[str, Any] | None:
    """Return the points of the trade-off figure, the lags at equal noise, and what failed."""
    wanted, seeds = results.study.get("tradeoff") or {"scenarios": []}, results.study["seeds"]
    if not wanted["scenarios"]:
        return None
    scenarios = [scenario_from(s, source="sweep") for s in wanted["scenarios"]]
    able = sweep.able(scenarios, wanted["estimators"], seeds, runner.rows)
    found = sweep.sweep(scenarios, able, seeds, runner.rows)
    _keep_traces(scenarios, found, seeds, runner)
    left_out = [name for name in wanted["estimators"] if name not in able]
    failures: list[dict[str, Any]] = []
    if left_out:
        texts = sweep.texts(sweep.settings(left_out))
        study = Study("sweep", tuple(scenarios), tuple(texts), tuple(seeds))
        failures = runner.run(study).failures.to_dict("records")  # type: ignore[assignment]
    return asdict(found) | {
        "left_out": left_out,
        "failures": failures,
        "overall": overall(found.at_excess),
        "faults": {s.name: happens(s) for s in scenarios},
        "definitions": {s.name: s.resolved() for s in scenarios},
    }


def _keep_traces(
    scenarios: Sequence[Scenario], found: sweep.Sweep, seeds: Sequence[int], runner: Runner
) -> None:
    """Run the settings nearest to equal noise once more, with what the report draws of them."""
    matched = faults_of(found.matched)
    if matched.empty:
        return
    own = matched[matched["fault"] == widest(matched)]
    drawn = [s for s in scenarios if s.name == own["scenario"].iloc[0]]
    runner.rows(drawn, own["nearest"].tolist(), seeds, traces=True)


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


def report(folder: Path, runner: Runner) -> Path:
    """Write report.html into a folder with rows, of a study or of a run, and return its path.

    A study without axes is a run, and gets the summary and the report of one.

    Parameters
    ----------
    folder : Path
    runner : Runner
        Of this folder: a run is swept over its knobs, as far as that is not done.

    Raises
    ------
    StudyError, OutputError
        If the folder is of neither, or cannot be written.
    """
    results = Results.load(folder)
    if results.axes:
        write_text(folder / REPORT, study_report.render(results))
        return folder / REPORT
    finish(results, runner)
    return folder / REPORT
