"""Run a study or a benchmark, and write a summary and a report of the results."""

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import Suite
from flexaxis.experiments.comparison import sweep
from flexaxis.experiments.comparison.ranking import REFERENCE, faults_of, overall, widest
from flexaxis.experiments.files import (
    REPORT,
    SUMMARY,
    optional_package,
    summary_of,
    write_json,
    write_text,
)
from flexaxis.experiments.reporting import run as run_report
from flexaxis.experiments.reporting import study as study_report
from flexaxis.experiments.running.cache import default_cache, keep_nominal_runs
from flexaxis.experiments.running.case import Options, run_unit
from flexaxis.experiments.running.progress import LINE, remark
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.running.runner import Runner
from flexaxis.experiments.running.store import CSV
from flexaxis.experiments.running.study import Study, units
from flexaxis.experiments.studies.definition import load_study
from flexaxis.sim.scenario import Scenario, scenario_from


@contextmanager
def working(
    folder: str | Path | None = None, *, dask: str | None = None, **options: Any
) -> Iterator[Runner]:
    """Yield a `Runner`, which runs estimators on this computer or on a Dask cluster."""
    with ExitStack() as stack:
        kept = default_cache()
        stack.enter_context(keep_nominal_runs(kept))
        if dask:
            client = stack.enter_context(optional_package("distributed").Client(dask))
            options["executor"] = client.get_executor(retries=2)
            options["jobs"] = sum(client.nthreads().values())
        place = Path(folder) if folder else None
        runner = stack.enter_context(Runner(place, cache=kept, **options))
        yield runner


def benchmark(
    suite: Suite, estimators: Sequence[str], seeds: Sequence[int], runner: Runner
) -> Results:
    """Run a suite of scenarios with the estimators of the suite or with other estimators.

    Parameters
    ----------
    suite : Suite
        Suite from `select`.
    estimators : sequence of str
        Estimators that replace the estimators of the suite. If the sequence is empty, the function
        runs the estimators of the suite. The function omits each scenario on which one of the given
        estimators cannot run.
    seeds : sequence of int
        Seeds of the records.
    runner : Runner
        Runner for the cases.
    """
    own, swept, turned = suite.scenarios, suite.swept_scenarios, suite.swept_estimators
    if estimators:
        left_out = runner.misfits([*own, *swept], estimators)
        for name, reason in left_out.items():
            remark(f"scenario {name} is omitted: {reason}")
        # If no scenario is left, running all of them raises the error.
        own = [s for s in own if s.name not in left_out] or own
        swept = [s for s in swept if s.name not in left_out]
        turned = estimators
    texts = tuple(estimators or suite.estimators)
    study = Study(suite.name, tuple(own), texts, tuple(seeds))
    return run(study, runner, swept=(swept, turned))


def run(
    study: Study,
    runner: Runner,
    *,
    swept: tuple[Sequence[Scenario], Sequence[str]] = ((), ()),
) -> Results:
    """Run a study; if the study is not split into shards, also write the summary and the report.

    Parameters
    ----------
    study : Study
        Study to run. A study without swept values is a benchmark.
    runner : Runner
        Runner for the cases.
    swept : (sequence of Scenario, sequence of str)
        Scenarios and estimators for the comparison at equal noise of the estimates.

    Raises
    ------
    OutputError, StudyError, EstimatorCrash, NotRun
        If `Runner.run` raises one of these exceptions.
    """
    tradeoff = {"scenarios": [s.resolved() for s in swept[0]], "estimators": list(swept[1])}
    about = {"title": study.name, "command": LINE.get(), "tradeoff": tradeoff}
    results = runner.run(study, traces=not study.axes, about=about)
    if results.folder and runner.shard == (1, 1):
        finish(results, runner)
    return results


def merge(shards: Sequence[Path], folder: Path, **options: Any) -> None:
    """Merge the results of several shards into one folder, and write the report.

    Parameters
    ----------
    shards : sequence of Path
        Folders of the shards.
    folder : Path
        Folder for the merged results.
    **options
        Options of the `Runner` that compares the estimators at equal noise of the estimates.
    """
    with Runner(folder, **options) as runner:
        for shard in shards:
            runner.store.take(shard)
        results = Results.load(folder)
        results.to_csv(folder / CSV)
        finish(results, runner)


def finish(results: Results, runner: Runner) -> None:
    """Write the report of a study; for a benchmark, also write summary.json with pooled scores."""
    assert results.folder is not None
    if not results.axes:
        study = results.study
        plans = study["tradeoff"]
        scenarios = [scenario_from(each, source="sweep") for each in plans["scenarios"]]
        summary = {
            "title": study["title"],
            "command": study["command"],
            "versions": {name: version(name) for name in ("flexaxis", "mujoco", "numpy", "numba")},
            "seeds": list(study["seeds"]),
            "scenarios": {e["definition"]["name"]: e for e in study["scenarios"]},
            "estimators": {text: _describe(text) for text in study["estimators"]},
            "rows": results.pooled("scenario", "estimator"),
            "failures": results.failures.to_dict("records"),
            "tradeoff": scenarios and swept(scenarios, plans["estimators"], study["seeds"], runner),
        }
        write_json(results.folder / SUMMARY, summary)
    write_report(results, results.folder / REPORT)


def write_report(results: Results, path: Path) -> None:
    """Write the report of a study; the report of a benchmark also uses its summary.json."""
    html = (study_report.render(results) if results.axes
            else run_report.render(results, summary_of(results.folder or Path())))  # fmt: skip
    write_text(path, html)


def _describe(text: str) -> str:
    name = text.partition("[")[0].strip()
    return REGISTRY[name].summary if name in REGISTRY else "a user-written estimator"


def swept(
    scenarios: Sequence[Scenario], estimators: Sequence[str], seeds: Sequence[int], runner: Runner
) -> dict[str, Any]:
    """Compute the curves of lag against noise, and the lags of all estimators at equal noise.

    Parameters
    ----------
    scenarios : sequence of Scenario
        Scenarios with faults.
    estimators : sequence of str
        Estimators to compare. The function adds the reference estimator to the comparison. The
        function omits every estimator that fails for at least one value of its tuning parameter in
        the first sweep.
    seeds : sequence of int
        Seeds of the records.
    runner : Runner
        Runner for the cases.
    """
    names = list(dict.fromkeys([REFERENCE, *estimators]))
    able = sweep.able(scenarios, names, seeds, runner.rows)
    result = sweep.sweep(scenarios, able, seeds, runner.rows)
    matched = faults_of(result.matched)
    if not matched.empty:  # run these cases again to keep the curves for the report
        own = matched[matched["fault"] == widest(matched)]
        drawn = [s for s in scenarios if s.name == own["scenario"].iloc[0]]
        runner.rows(drawn, own["nearest"].tolist(), seeds, traces=True)
    return asdict(result) | {
        "left_out": [name for name in names if name not in able],
        "overall": overall(result.at_excess),
        "definitions": {s.name: s.resolved() for s in scenarios},
    }


def plan(path: Path) -> dict[str, Any]:
    """Return the number of runs in a study, and estimate its computing time from a test run.

    Returns
    -------
    dict
        The list ``variants`` contains one dict for each scenario and each combination of swept
        values. The entry ``cases`` is the number of estimator runs in the study. The entry
        ``seconds`` is the computing time on one core [s], estimated from a run of the registered
        estimators. The entry ``megabytes`` is the expected size of the results [MB].
    """
    study = load_study(path)
    first = units(study)[0]
    settings = tuple(each for each in first.settings if not each.spec.is_users)
    one = replace(first, settings=settings, seeds=study.seeds[:1])
    run_unit(one, Options())  # the first run compiles the filters
    start = time.process_time()
    run_unit(one, Options())
    seconds = (time.process_time() - start) / max(1, len(settings))
    variants = product([s.name for s in study.scenarios], study.points)
    return {
        "variants": [{"scenario": name, **point} for name, point in variants],
        "cases": study.cases,
        "seconds": seconds * study.cases,
        "megabytes": BYTES * study.cases / 1e6,
    }


BYTES = 4000  # size of a case in SQLite and scores.csv together [bytes]
