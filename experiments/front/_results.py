"""Run, score and compare estimators on many records: `benchmark`, `study`, `compare`, `tune`."""

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
from flexaxis.experiments.reporting.study import over_axis
from flexaxis.experiments.reporting.tables import between
from flexaxis.experiments.reporting.words import answer, failures_in_words, fault_words
from flexaxis.experiments.running import results as engine
from flexaxis.experiments.running.estimators import text_of
from flexaxis.experiments.running.run import rerun
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
"""Columns of the table of pooled scores. The table of a study also contains the swept keys."""
TURNED = (
    "scenario", "parameter", "setting", "lag", "lag_interval", "std", "lag_bound", "diverged",
)  # fmt: skip
"""Columns of the table of a sweep, which has one row per setting."""


class Results(engine.Results):
    """Results of a run or a study, with methods that draw figures and write the report."""

    @property
    def table(self) -> pd.DataFrame:
        """Pooled scores of the parameters that changed, or of all parameters if none changed.

        The intervals follow from the scatter between seeds; std and bias are in % of nominal.
        """
        rows = self.scores()
        changed = rows.query("changed")
        return (rows if changed.empty else changed)[[*self.axes, *SHOWN]].reset_index(drop=True)

    @property
    def problems(self) -> list[str]:
        """One sentence per failed estimator, with the first failure and the number of failures."""
        failures = self.failures.to_dict("records")
        return [f"{text} ({n} cases)" for text, n in failures_in_words(failures)]

    def rerun(self, sample: int = 0, **work: Any) -> pd.DataFrame:
        """Run cases again and compare the new scores with the stored scores.

        Parameters
        ----------
        sample : int
            Approximate number of cases to run, evenly spaced in the list; 0 runs all cases.
        **work
            ``jobs`` and ``time_limit``, as for `benchmark`.

        Returns
        -------
        DataFrame
            One row per case and parameter, with the columns that
            `flexaxis.experiments.running.run.rerun` describes.
        """
        with studies.working(**work) as runner:
            return rerun(self, runner, sample)

    def plot(self, x: str = "", *, ax: Any = None) -> Any:
        """Draw the lag after a fault against the noise, or against a swept key of a study.

        Parameters
        ----------
        x : str, optional
            The swept key (default: the first swept key of the study).
        ax : matplotlib axes, optional
            Axes to draw on, one for each parameter that changes (default: new axes).

        Returns
        -------
        Axes, or ndarray of Axes
            One axes or, for a study, one axes for each parameter that changes.
        """
        if key := x or next(iter(self.axes), ""):
            return draw(ax=ax, **over_axis(self, key, "lag"))
        axes = axes_for(ax, 1)
        figures.lag_against_noise(self.scores().query("changed"), axes=axes)
        return axes[0]

    def report(self) -> Path:
        """Write report.html to the results folder, or to the current folder if there is none.

        The result is the path of the report.
        """
        path = (self.folder or Path()) / REPORT
        studies.write_report(self, path)
        return path

    def __repr__(self) -> str:
        text = f"{self.cases} cases, {len(self.failures)} of them failed"
        return f"{text}\n{_text(self.table)}"


def _text(table: pd.DataFrame) -> str:
    words, number = {"lag_interval": between}, "{:.3g}".format
    return table.to_string(index=False, formatters=words, float_format=number)


def benchmark(
    estimators: Estimators = (),
    *,
    scenarios: Scenarios = "smoke",
    seeds: Seeds = None,
    folder: Place = None,
    **work: Any,
) -> Results:
    """Run estimators on scenarios with many seeds, and compute the scores of the estimates.

    Parameters
    ----------
    estimators : str, class, or several of them
        Names from `flexaxis.estimators()`, any texts that ``--estimator`` accepts, or classes of
        your own (default: the estimators of the suite).
    scenarios : str, Path, Scenario, or several of them
        Names of scenarios and suites, paths of TOML files, or scenarios.
    seeds : int, str or iterable of int
        Number of seeds (the first seed is 1000), a range such as ``"0:20"``, or a list of seeds
        (default: the number of seeds of the suite).
    folder : str or Path, optional
        Folder for the rows, summary.json and report.html. With a folder, the estimators of a suite
        are also compared at equal noise. Without a folder, the rows are kept in memory.
    **work
        ``jobs`` (number of processes, default 1), ``shard`` (number of the shard to run, and number
        of shards), ``dask`` (address of a scheduler), ``overwrite`` (whether to delete old results
        in `folder`, default False), and ``time_limit`` (time limit for one run of your own
        estimator [s], default 600).

    Returns
    -------
    Results
        One row per scenario, estimator, seed and parameter.

    Raises
    ------
    FlexaxisError, EstimatorError
        If a name does not exist, or an estimator cannot be constructed. An estimator that fails on
        a record raises no error. The rows of that case contain the error message (see
        `Results.failures`).
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
        Path of a TOML file, or a dict with the same content: ``{"scenario": "fm_step-v1",
        "estimators": ["glr"], "seeds": 20, "sweep": {"fault[0].factor": [1.2, 2.0]}}``. In a dict,
        an estimator may also be a class.
    folder, **work
        Options with the same meaning as for `benchmark`.

    Returns
    -------
    Results
        One row per case and parameter, with the values of the swept keys.

    Raises
    ------
    StudyError
        If the definition is invalid. The message contains one line for each problem.
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
        The object that `flexaxis compare --json` prints, with keys such as ``verdict``,
        ``headline``, ``advice``, ``rows`` and ``legend``.
    status : int
        Exit status of the command: 1 if the candidate is worse; 3 if the verdict is undecided and
        the candidate has missing runs, or more failed or diverged runs than the base; 0 otherwise.
    """

    content: dict[str, Any]
    status: int

    @property
    def verdict(self) -> Any:
        """The verdict in one word: worse, undecided, better, slight or same."""
        return self.content["verdict"]

    def to_dataframe(self) -> pd.DataFrame:
        """Return the comparison as a DataFrame, one row per score."""
        return pd.DataFrame(self.content["rows"])

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the change of each score with its interval and margin.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Axes to draw on (default: new axes).
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
        Estimators, as for `benchmark`.
    scenarios : str, Path, Scenario, or several of them
        Scenarios to run. The comparison leaves out scenarios on which an estimator cannot run. The
        headline mentions the scenarios on which only one of the two estimators cannot run.
    seeds, **work
        Options with the same meaning as for `benchmark`.
    runs : two paths, optional
        Folders of two finished runs to compare. In this case, no estimator is run.
    max_seeds : int
        Largest number of seeds. While the verdict is undecided, further seeds are run, up to this
        number.
    match_std : bool
        Whether to tune both estimators to the same noise, and then compare only the lag. The noise
        is the std of the parameter that changes or, if several parameters change, the excess
        prediction error.
    margins : mapping of str to float, optional
        Largest relative change that counts as negligible, keyed by score, such as ``{"lag": 0.05}``
        (default: 0.02 for lag and std, 0.2 for bias).
    folder : str or Path, optional
        Folder for the rows, compare.json, verdict.md and report.html.

    Returns
    -------
    Comparison
        The verdict, with one row per scenario and score.

    Raises
    ------
    FlexaxisError
        If the two estimators have fewer than two runs in common. With `match_std`, the error also
        occurs if an estimator has no tuning parameter or cannot be tuned to the noise of the
        reference.
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
        Dict with the key ``tradeoff``, as in summary.json. ``tradeoff`` contains ``points`` (one
        row per setting) and ``matched`` (one row per estimator, at the noise of rpem-forgetting).
    """

    content: dict[str, Any]

    @property
    def table(self) -> pd.DataFrame:
        """Lag and noise of each setting; ``std`` is in % of nominal, ``lag_bound`` is in s."""
        return pd.DataFrame(self.content["tradeoff"]["points"])[[*TURNED]]

    def plot(self) -> Any:
        """Draw the lag against the noise: one panel per fault, one line per estimator."""
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
    """Find the setting at which each estimator is as noisy as rpem-forgetting, or sweep settings.

    The estimators are tuned on the nominal axis without a fault.

    Parameters
    ----------
    *estimators : str
        Estimators to tune (default: all registered estimators with a tuning parameter).
    sweep : str, Path, Scenario, or several of them
        Scenarios with a fault. If scenarios are given, the function runs the estimators on them at
        several settings, instead of tuning the estimators.
    seeds : int, str or iterable of int
        Seeds, as for `benchmark`.
    folder : str or Path, optional
        Folder for the rows.
    file : str or Path, optional
        TOML file for the settings, in the format of estimators/tuned.toml.
    **work
        Options with the same meaning as for `benchmark`.

    Returns
    -------
    DataFrame or Sweep
        One row per estimator, or a `Sweep` if `sweep` is given. The columns are ``estimator,
        problem, setting, knob, value, match`` and ``ratio``, the noise of the estimator divided by
        the noise of the reference. If no setting matches, ``problem`` gives the reason.
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
