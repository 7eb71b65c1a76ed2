"""Many runs, scored, pooled and compared: `benchmark`, `study`, `compare`, `tune`."""

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
"""The columns of a table of pooled scores, with the axes of a study."""
TURNED = (
    "scenario", "parameter", "setting", "lag", "lag_interval", "std", "lag_bound", "diverged",
)  # fmt: skip
"""The columns of a table of settings."""


class Results(engine.Results):
    """Results with their figure; rows, selections and tables are those of every folder."""

    @property
    def table(self) -> pd.DataFrame:
        """Pooled scores of what changed: an interval is over seeds, std and bias in % of nominal.

        If nothing changed, the scores of all parameters.
        """
        rows = self.scores()
        changed = rows.query("changed")
        return (rows if changed.empty else changed)[[*self.axes, *SHOWN]].reset_index(drop=True)

    @property
    def problems(self) -> list[str]:
        """The first failure of each estimator in a sentence, with the number of such cases."""
        failures = self.failures.to_dict("records")
        return [f"{text} ({n} cases)" for text, n in failures_in_words(failures)]

    def rerun(self, sample: int = 0, **work: Any) -> pd.DataFrame:
        """Run cases again, such as those of somebody else's folder, and compare the scores.

        Parameters
        ----------
        sample : int
            Number of cases, spread over all; 0 for all.
        **work
            ``jobs`` and ``time_limit``, as of `benchmark`.

        Returns
        -------
        DataFrame
            As from `flexaxis.experiments.running.run.rerun`: a row a case and parameter.
        """
        with studies.working(**work) as runner:
            return rerun(self, runner, sample)

    def plot(self, x: str = "", *, ax: Any = None) -> Any:
        """Draw the lag after a fault: against the noise, or over an axis of a study.

        Parameters
        ----------
        x : str, optional
            A swept key; the first of the study by default.
        ax : matplotlib axes, optional
            One for each parameter that changes; new ones by default.

        Returns
        -------
        Axes, or ndarray of Axes
        """
        if key := x or next(iter(self.axes), ""):
            return draw(ax=ax, **over_axis(self, key, "lag"))
        axes = axes_for(ax, 1)
        figures.lag_against_noise(self.scores().query("changed"), axes=axes)
        return axes[0]

    def report(self) -> Path:
        """Write report.html to the folder, or here if there is none; return its path."""
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
    """Run estimators on scenarios over many seeds, and score them.

    Parameters
    ----------
    estimators : str, class, or several of them
        Names of `flexaxis.estimators()`, any text as for ``--estimator``, or classes of your own,
        which are run; those of the suite by default.
    scenarios : str, Path, Scenario, or several of them
        Names of scenarios and suites, paths to TOML files, or scenarios.
    seeds : int, str or iterable of int
        A number of them from 1000 on, a range ``"0:20"``, or those listed; by default the number
        of the suite.
    folder : str or Path, optional
        Where to keep the rows, with summary.json and report.html; a suite's estimators are then
        compared at equal noise, too. Without it the rows are in memory.
    **work
        ``jobs`` (processes, 1 by default), ``shard`` (number of the part to run, and of all parts),
        ``dask`` (address of a scheduler), ``overwrite`` (whether to remove what
        `folder` holds, False by default), ``time_limit`` (for a run of your own code, 600 s by
        default).

    Returns
    -------
    Results
        A row a scenario, estimator, seed and parameter.

    Raises
    ------
    FlexaxisError, EstimatorError
        If a name is wrong, or an estimator cannot be made. One that fails on a record is a row
        with its error (`Results.failures`).
    """
    suite = select(scenarios)
    numbers, texts = seeds_of(seeds, suite.seeds), texts_of(estimators)
    with studies.working(folder, **work) as runner:
        results = studies.benchmark(suite, texts, numbers, runner)
    return Results(runner.store, results.study)


def study(
    definition: str | Path | dict[str, Any],
    *,
    folder: Place = None,
    **work: Any,
) -> Results:
    """Run a study: estimators over values of any key of scenario, fault or estimator.

    Parameters
    ----------
    definition : str, Path or dict
        A TOML file, or its keys: ``{"scenario": "fm_step-v1", "estimators": ["glr"], "seeds":
        20, "sweep": {"fault[0].factor": [1.2, 2.0]}}``; classes may stand among the estimators.
    folder, **work
        As for `benchmark`.

    Returns
    -------
    Results
        A row a case and parameter, with the value on each axis of the study.

    Raises
    ------
    StudyError
        With one line for each problem.
    """
    is_file = isinstance(definition, str | Path)
    planned = load_study(definition) if is_file else study_from(definition)  # type: ignore[arg-type]
    with studies.working(folder, **work) as runner:
        results = studies.run(planned, runner)
    return Results(runner.store, results.study)


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The verdict on a candidate beside a base.

    Attributes
    ----------
    content : dict
        All that `flexaxis compare --json` prints: ``verdict, headline, advice, rows, legend`` …
    status : int
        Exit status of the command: 0 no regression, 1 worse, 3 undecided.
    """

    content: dict[str, Any]
    status: int

    @property
    def verdict(self) -> Any:
        """The one word: worse, undecided, better, slight or same."""
        return self.content["verdict"]

    def to_dataframe(self) -> pd.DataFrame:
        """Return a pandas DataFrame, a line a score."""
        return pd.DataFrame(self.content["rows"])

    def plot(self, *, ax: Any = None) -> Any:
        """Draw the change of each score with its interval, and the margin that matters.

        Parameters
        ----------
        ax : matplotlib axes, optional
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
    """Say whether a candidate is better or worse than a base, run on the same records.

    Parameters
    ----------
    base, candidate : str or class
        As for `benchmark`.
    scenarios : str, Path, Scenario, or several of them
        Those that one of the two cannot read are left out; the verdict says so.
    seeds, **work
        As for `benchmark`.
    runs : two paths, optional
        Folders of finished runs, which are compared as they are.
    max_seeds : int
        Seeds are added up to so many while it is undecided.
    match_std : bool
        Whether to tune both to one noise first, and judge the lag at equal noise: equal std of the
        parameter that changes, or, where several do, equal excess prediction error.
    margins : mapping of str to float, optional
        Changes that do not matter, as shares: ``{"lag": 0.05}``; 2 % by default.
    folder : str or Path, optional
        Where to keep the rows, compare.json, verdict.md and report.html.

    Returns
    -------
    Comparison
        The verdict, and a line a scenario and score.

    Raises
    ------
    FlexaxisError
        If they have nothing in common; with `match_std` if one has no tuning parameter, or cannot
        be as noisy as the reference.
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
    """Estimators at several settings of their tuning parameters.

    Attributes
    ----------
    content : dict
        ``tradeoff`` with ``points`` (a setting each) and ``matched`` (at the noise of
        rpem-forgetting), as in summary.json.
    """

    content: dict[str, Any]

    @property
    def table(self) -> pd.DataFrame:
        """Lag and noise of each setting, std in % of nominal; lag_bound is the Cramér–Rao bound."""
        return pd.DataFrame(self.content["tradeoff"]["points"])[[*TURNED]]

    def plot(self) -> Any:
        """Return a figure: lag against noise, a line an estimator, a panel a fault, the bound."""
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
    """Find the settings at which estimators are as noisy as rpem-forgetting, or compare settings.

    Each is tuned on the nominal axis without a fault.

    Parameters
    ----------
    *estimators : str
        All registered ones with a tuning parameter by default.
    sweep : str, Path, Scenario, or several of them
        Scenarios with a fault: run several settings on these instead of tuning.
    seeds
        As for `benchmark`.
    folder : str or Path, optional
        Where rows are kept.
    file : str or Path, optional
        TOML file for the settings, in the format of estimators/tuned.toml.
    **work
        As for `benchmark`.

    Returns
    -------
    DataFrame
        A line an estimator: ``setting, knob, value, match, ratio`` (of its noise to the
        reference), and ``problem`` if there is no such setting. A `Sweep` with `sweep`.
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
