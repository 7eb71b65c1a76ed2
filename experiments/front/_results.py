"""Run, score and compare estimators with `benchmark`, `study`, `compare` and `tune`."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis._estimates import EstimatorLike
from flexaxis._records import axes_for, draw
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import select
from flexaxis.experiments.comparison.ranking import faults_of
from flexaxis.experiments.comparison.tune import Trials, match_noise, save
from flexaxis.experiments.files import REPORT
from flexaxis.experiments.gate import gate
from flexaxis.experiments.gate.report import as_dict, write
from flexaxis.experiments.reporting import figures
from flexaxis.experiments.reporting.sentences import answer, failures_in_words, fault_words
from flexaxis.experiments.reporting.study import over_axis
from flexaxis.experiments.reporting.tables import between
from flexaxis.experiments.running import results as engine
from flexaxis.experiments.running.estimators import text_of
from flexaxis.experiments.running.runner import rerun
from flexaxis.experiments.studies import benchmark as studies
from flexaxis.experiments.studies.definition import load_study, seeds_of, study_from, texts_of
from flexaxis.sim.errors import FlexaxisError
from flexaxis.sim.scenario import Scenario

Estimators = EstimatorLike | Iterable[EstimatorLike]
Scenarios = str | Path | Scenario | Iterable[str | Path | Scenario]
Place = str | Path | None
Seeds = int | str | Iterable[int] | None
SHOWN = (
    "scenario", "estimator", "parameter", "lag", "lag_interval", "t10", "std", "bias", "score",
    "diverged", "failed", "runs",
)  # fmt: skip
"""Columns of the score table. The score table of a study also contains the swept settings."""
TURNED = (
    "scenario", "parameter", "setting", "lag", "lag_interval", "std", "lag_bound", "diverged",
)  # fmt: skip
"""Columns of a sweep table, which contains one row per setting of the tuning parameter."""


class Results(engine.Results):
    """Results of a benchmark or a study, with methods for figures and for the report."""

    @property
    def table(self) -> pd.DataFrame:
        """Scores of the changed parameters, pooled over all seeds.

        If no parameter changed, the table contains the scores of all parameters. The columns `std`
        and `bias` are in % of the nominal parameter value.
        """
        rows = self.scores()
        changed = rows.query("changed")
        return (rows if changed.empty else changed)[[*self.axes, *SHOWN]].reset_index(drop=True)

    @property
    def problems(self) -> list[str]:
        """One sentence per failed estimator, with the first error and the number of failed runs."""
        failures = self.failures.to_dict("records")
        return [f"{text} ({n} cases)" for text, n in failures_in_words(failures)]

    def rerun(self, sample: int = 0, **work: Any) -> pd.DataFrame:
        """Repeat stored runs, and compare the new scores with the stored scores.

        Parameters
        ----------
        sample : int
            Approximate number of runs to repeat, or 0 to repeat all runs.
        **work
            The options ``jobs`` and ``time_limit`` of `benchmark`.

        Returns
        -------
        table : DataFrame
            Table with one row per run and parameter. The docstring of
            `flexaxis.experiments.running.runner.rerun` describes the columns.
        """
        with studies.working(**work) as runner:
            return rerun(self, runner, sample)

    def plot(self, x: str = "", *, ax: Any = None) -> Any:
        """Plot the lag against the noise or, for a study, against a swept setting.

        Parameters
        ----------
        x : str, optional
            Swept setting on the horizontal axis (default: the first swept setting of the study).
        ax : matplotlib axes, optional
            Matplotlib axes, one for each changed parameter (default: new axes).

        Returns
        -------
        axes : Axes or ndarray of Axes
            One Matplotlib axes object or, for a study, one object per changed parameter.
        """
        if key := x or next(iter(self.axes), ""):
            return draw(ax=ax, **over_axis(self, key, "lag"))
        axes = axes_for(ax, 1)
        figures.lag_against_noise(self.scores().query("changed"), axes=axes)
        return axes[0]

    def report(self) -> Path:
        """Write report.html to the results folder, and return the path of the report.

        Without a results folder, the method writes the report to the current folder.
        """
        path = (self.folder or Path()) / REPORT
        studies.write_report(self, path)
        return path

    def __repr__(self) -> str:
        text = f"{self.cases} cases, {len(self.failures)} of them failed"
        return f"{text}\n{_text(self.table)}"


def _text(table: pd.DataFrame) -> str:
    words, number = {"lag_interval": between}, "{:.3g}".format
    known = table.where(table.notna())  # pandas prints None as "None", but NaN as `na_rep`
    return known.to_string(index=False, formatters=words, float_format=number, na_rep="–")


def benchmark(
    estimators: Estimators = (),
    *,
    scenarios: Scenarios = "smoke",
    seeds: Seeds = None,
    folder: Place = None,
    **work: Any,
) -> Results:
    """Run estimators on scenarios with many random seeds, and score the estimates.

    Parameters
    ----------
    estimators : str, class, or several of them
        Estimator names from `flexaxis.estimators()`, any text that the option ``--estimator``
        accepts, or your own estimator classes (default: the estimators of the suite).
    scenarios : str, Path, Scenario, or several of them
        Names of scenarios or suites, paths of TOML files, or `Scenario` objects.
    seeds : int, str or iterable of int
        Number of random seeds (the first is 1000), a range of seeds such as ``"0:20"``, or a list
        of seeds (default: the number of seeds that the suite specifies).
    folder : str or Path, optional
        Folder for the result files. If you specify a folder, the function also compares the
        estimators of a suite at equal noise. Without a folder, the results stay in memory.
    **work
        ``jobs`` is the number of processes (default 1). ``shard`` is the pair (shard, number of
        shards). ``dask`` is the address of a Dask scheduler. ``overwrite=True`` deletes old scores.
        ``time_limit`` is the time limit for one run of your own estimator [s] (default 600).

    Returns
    -------
    results : Results
        Object with one row of scores per scenario, estimator, seed and parameter.

    Raises
    ------
    FlexaxisError, EstimatorError
        If a name is unknown, or an estimator cannot be created. If an estimator fails on a record,
        the function raises no error, but stores the error message (see `Results.failures`).
    """
    suite = select(scenarios)
    numbers, texts = seeds_of(seeds, suite.seeds), texts_of(estimators)
    with studies.working(folder, **work) as runner:
        results = studies.benchmark(suite, texts, numbers, runner)
    return Results(runner.store, results.study)


def study(definition: str | Path | dict[str, Any], *, folder: Place = None, **work: Any) -> Results:
    """Run a study, which varies settings of scenarios, faults and estimators.

    Parameters
    ----------
    definition : str, Path or dict
        Path of a TOML file, or a dict with the same content, such as ``{"scenario": "fm_step-v1",
        "estimators": ["glr"], "seeds": 20, "sweep": {"fault[0].factor": [1.2, 2.0]}}``. A dict can
        also contain estimator classes.
    folder : str or Path, optional
    **work
        The same options as for `benchmark`.

    Returns
    -------
    results : Results
        Object with the scores for each run and parameter, and the values of the swept settings.

    Raises
    ------
    StudyError
        If the study definition is invalid. The error message lists all mistakes.
    """
    is_file = isinstance(definition, str | Path)
    planned = load_study(definition) if is_file else study_from(definition)  # type: ignore[arg-type]
    with studies.working(folder, **work) as runner:
        results = studies.run(planned, runner)
    return Results(runner.store, results.study)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The comparison of a candidate estimator with a base estimator.

    Attributes
    ----------
    content : dict
        The object that `flexaxis compare --json` prints, with keys such as ``verdict``.
    status : int
        Exit status of the command `flexaxis compare`, which is 1 if the candidate is worse. The
        exit status is 3 if the verdict is undecided and the candidate has missing runs, or more
        failed or diverged runs than the base. In all other cases, the exit status is 0.
    """

    content: dict[str, Any]
    status: int

    @property
    def verdict(self) -> Any:
        """The verdict, which is "worse", "undecided", "better", "slight" or "same"."""
        return self.content["verdict"]

    def to_dataframe(self) -> pd.DataFrame:
        """Return the comparison as a DataFrame with one row per scenario and score."""
        return pd.DataFrame(self.content["rows"])

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the change of each score with its confidence interval and margin.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Matplotlib axes for the figure (default: new axes).
        """
        axes = axes_for(ax, 1)[0]
        figures.verdict_intervals(self.content["rows"], axes=axes)
        return axes

    def __repr__(self) -> str:
        c = self.content
        table = pd.DataFrame([row["text"] for row in c["rows"]], columns=c["columns"])
        lines = [c["headline"], *c["advice"], "", table.to_string(index=False), "", *c["legend"]]
        return "\n".join(lines)


def compare(
    base: EstimatorLike = "",
    candidate: EstimatorLike = "",
    *,
    scenarios: Scenarios = gate.SUITE,
    seeds: Seeds = None,
    runs: Sequence[str | Path] = (),
    max_seeds: int = 0,
    match_std: bool = False,
    margins: Mapping[str, float] | None = None,
    folder: Place = None,
    **work: Any,
) -> Comparison:
    """Run two estimators on the same records, and test whether the candidate is better or worse.

    Parameters
    ----------
    base, candidate : str or class
        Estimators, in any form that `benchmark` accepts.
    scenarios : str, Path, Scenario, or several of them
        Scenarios for the comparison. The function skips scenarios that either estimator rejects.
    seeds : int, str or iterable of int, optional
    **work
        The same options as for `benchmark`.
    runs : two paths, optional
        Results folders of two finished runs. If you pass folders, the function compares the stored
        scores, and runs no estimator.
    max_seeds : int
        Maximum number of seeds. While the verdict is undecided, seeds are added (0: add no seeds).
    match_std : bool
        If true, tune both estimators to the same noise, and compare only the lag. The noise measure
        is the standard deviation of the estimate of the changed parameter. If several parameters
        change, the noise measure is the excess prediction error.
    margins : mapping of str to float, optional
        Largest relative change in each score that counts as negligible, such as ``{"lag": 0.05}``
        (default: 0.02 for lag and std, 0.2 for bias).
    folder : str or Path, optional
        Folder for the result files compare.json, verdict.md and report.html.

    Returns
    -------
    comparison : Comparison
        Object with the verdict, and with one row per scenario and score.

    Raises
    ------
    FlexaxisError
        If the two estimators have fewer than two runs in common, or if `match_std` is true and an
        estimator cannot be tuned to the noise of rpem-forgetting.
    """
    checked = gate.check_margins(margins or {})
    sides = [text_of(each) if each else "" for each in (base, candidate)]
    if runs:
        numbers = seeds_of(seeds, 0) if seeds else None
        result = gate.compare_runs(
            *map(Path, runs), margins=checked, estimators=sides, seeds=numbers
        )
    else:
        suite = select(scenarios, default=gate.SUITE)
        numbers = seeds_of(seeds, suite.seeds)
        with studies.working(folder, **work) as runner:
            result = gate.compare(  # type: ignore[misc]
                *sides, suite.scenarios, numbers, runner, margins=checked,  # type: ignore[arg-type]
                max_seeds=max_seeds, match_std=match_std,
            )  # fmt: skip
    content = as_dict(result)
    if folder:
        content["report"] = write(Path(folder), content)
    return Comparison(content, result.status())


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """The lag and noise of estimators at several settings of their tuning parameters.

    Attributes
    ----------
    content : dict
        Dict with the entry ``tradeoff`` of summary.json. The entry contains ``points`` (one row per
        setting) and ``matched`` (one row per estimator, at the noise level of rpem-forgetting).
    """

    content: dict[str, Any]

    @property
    def table(self) -> pd.DataFrame:
        """Table of the lag [s] and the noise [% of the nominal value], with one row per setting."""
        return pd.DataFrame(self.content["tradeoff"]["points"])[[*TURNED]]

    def plot(self) -> Any:
        """Plot the lag against the noise, with one panel per fault and one line per estimator."""
        found = self.content["tradeoff"]
        return figures.speed_noise(faults_of(found["points"]), fault_words(found))

    def __repr__(self) -> str:
        sentence, facts = answer(self.content)
        return "\n".join([_text(self.table), f"{sentence}.", *facts])


def tune(
    *estimators: str,
    sweep: Scenarios = (),
    seeds: Seeds = "0:16",
    folder: Place = None,
    file: Place = None,
    **work: Any,
) -> pd.DataFrame | Sweep:
    """Tune each estimator to the noise of rpem-forgetting, or run it at several settings.

    The function tunes the estimators on the nominal axis without a fault.

    Parameters
    ----------
    *estimators : str
        Names of the estimators (default: all registered estimators with a tuning parameter).
    sweep : str, Path, Scenario, or several of them
        Scenarios with a fault. If you pass scenarios, the function runs the estimators on these
        scenarios at several settings, and does not tune the estimators.
    seeds : int, str or iterable of int
        Random seeds, in any form that `benchmark` accepts.
    folder : str or Path, optional
        Folder for the scores of all runs.
    file : str or Path, optional
        TOML file for the tuned settings, in the format of estimators/tuned.toml.
    **work
        The same options as for `benchmark`.

    Returns
    -------
    result : DataFrame or Sweep
        Table with one row per estimator, or a `Sweep` object if you pass `sweep`. The columns are
        ``estimator, problem, setting, knob, value, match, ratio``. The column ``ratio`` contains
        the noise relative to rpem-forgetting. If tuning fails, ``problem`` contains the reason.
    """
    numbers = seeds_of(seeds, 16)
    names, lines = estimators or [n for n, entry in REGISTRY.items() if entry.knob], []
    with studies.working(folder, **work) as runner:
        if sweep:
            found = studies.swept(select(sweep).scenarios, names, numbers, runner)
            return Sweep(
                {"title": "sweep", "estimators": names, "seeds": numbers, "tradeoff": found}
            )
        trials = Trials(numbers, runner.rows)
        for name in names:
            tuned, line = None, {"estimator": name, "problem": ""}
            try:
                tuned = match_noise(name, trials)
                line |= asdict(tuned)
            except FlexaxisError as error:
                line["problem"] = str(error)
            lines.append(line)
            if file:
                save(Path(file), name, tuned)
    return pd.DataFrame(lines)
