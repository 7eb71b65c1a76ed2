"""Many cases, scored and pooled: `benchmark`, `study`, and the results of both."""

from __future__ import annotations

import tempfile
import warnings
import weakref
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexaxis._given import (
    Estimators,
    Scenarios,
    scenarios_of,
    seeds_of,
    texts_of,
)
from flexaxis._table import ShownTable
from flexaxis.experiments.building.guest import in_words
from flexaxis.experiments.building.processes import check_jobs
from flexaxis.experiments.results import results as kept
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.running.study import Study
from flexaxis.sim.errors import FlexaxisError, unknown

if TYPE_CHECKING:
    from flexaxis.experiments.building.guest import Remark


@contextmanager
def working(
    what: str, total: float, *, jobs: int = 1, time_limit: float | None = None
) -> Iterator[Means]:
    """Give the means to run cases.

    Parameters
    ----------
    what : str
        What is done, for the progress.
    total : float
        Cases, at most.
    jobs : int
        Processes.
    time_limit : float, optional
        How long code of a user may take for one run [s].
    """
    check_jobs(jobs)
    remarks: list[Remark] = []
    means = Means(jobs=jobs, store=default_cache())
    with means.shown(
        what, total, lambda outcome: remarks.extend(outcome.remarks), time_limit=time_limit
    ) as (shown, _):
        yield shown
    for text in in_words(remarks):  # at the line of the user, who called through two of ours
        warnings.warn(text, stacklevel=5)


_SHOWN = (
    "estimator",
    "scenario",
    "parameter",
    "lag",
    "t10",
    "std",
    "bias",
    "diverged",
    "failed",
    "runs",
)


class Results(kept.Results):
    """Results with their figure; rows, selections and tables are those of every folder."""

    def scores(self, *by: str) -> ShownTable:
        """Return pooled scores, a line for all rows that agree in some columns.

        Parameters
        ----------
        *by : str
            Columns to tell apart; scenario, estimator and all axes by default.
        """
        columns = list(by) or ["base", "method", *self.axes]
        lines = [self._named(row) for row in self.pooled(columns)]
        first = [_NAMES.get(column, column) for column in columns]
        return ShownTable(lines, list(dict.fromkeys([*first, *_SHOWN])) if lines else ())

    def plot(self, x: str = "", *, ax: Any = None) -> Any:
        """Draw the lag after a fault: against the noise before it, or over an axis of a study.

        Parameters
        ----------
        x : str, optional
            A swept key; the first of the study by default. Where nothing is swept, the standard
            deviation before the fault is the abscissa, and each estimator a point.
        ax : matplotlib axes, optional
            Where to draw; new ones by default.

        Returns
        -------
        Axes

        Raises
        ------
        FlexaxisError
            If no such key is swept.
        """
        import pandas as pd

        from flexaxis._draw import panels
        from flexaxis.experiments.reporting.figures import curves, lag_against_noise
        from flexaxis.experiments.reporting.study import over_axis

        if x and x not in self.axes:
            known = unknown("axis", x, self.axes) if self.axes else f"axis {x!r}: nothing was swept"
            raise FlexaxisError(f"{known}; leave it out for lag against noise")
        rows = pd.DataFrame([self._named(row) for row in self.pooled(["base", "method"])])
        rows = rows[rows["changed"] & rows["lag"].notna()]
        if rows.empty:
            raise FlexaxisError("no lag to draw: nothing changes here that is estimated")
        axes = panels(ax, 1)
        if key := x or next(iter(self.axes), ""):
            options = over_axis(self, key, "lag")
            first = dict(list(options["panels"].items())[:1])
            curves(**options | {"panels": first, "axes": axes})
        else:
            rows["setting"] = rows["estimator"] + " on " + rows["scenario"]
            lag_against_noise(rows, list(rows["estimator"].unique()), axes=axes)
        return axes[0]

    def _named(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """Return a pooled row under the names that rows have."""
        return {_NAMES.get(column, column): value for column, value in row.items()}

    def __repr__(self) -> str:
        names = ", ".join(self.study.get("estimators", ()))
        failed = len(self.failures())
        text = f"Results of {names}: {self.cases} case{'s'[: self.cases != 1]}"
        return text + (f", {failed} of them failed: see .failures()" if failed else "")

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{self.scores()._repr_html_()}"


_NAMES = {"base": "scenario", "method": "estimator"}


def benchmark(
    estimators: Estimators,
    *,
    scenarios: Scenarios = "smoke",
    seeds: int | str | Iterable[int] = 8,
    folder: str | Path | None = None,
    jobs: int = 1,
    overwrite: bool = False,
    time_limit: float | None = None,
) -> Results:
    """Run estimators on scenarios over many seeds, and score them.

    Parameters
    ----------
    estimators : str, class, or several of them
        Names of `flexaxis.estimators()`, any text as for ``--estimator``, or classes of your own,
        which are run.
    scenarios : str, Scenario, or several of them
        Names of scenarios and suites, paths to TOML files, or scenarios.
    seeds : int, str or iterable of int
        A number of them from 1000 on, a range ``"0:20"``, or those listed.
    folder : str or Path, optional
        Where the rows are kept; else they go with the results.
    jobs : int
        Processes. A script that asks for several runs itself in each, and so needs
        ``if __name__ == "__main__":``.
    overwrite : bool
        Whether to remove what `folder` holds first; else it is kept, and what is missing run.
    time_limit : float, optional
        How long code of your own may take for one run [s]; 600 by default.

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
    study = Study(
        "benchmark", scenarios_of(scenarios), texts_of(estimators, jobs=jobs), seeds_of(seeds)
    )
    return _run(study, folder, jobs=jobs, overwrite=overwrite, time_limit=time_limit)


def study(
    definition: str | Path | Mapping[str, Any],
    *,
    folder: str | Path | None = None,
    jobs: int = 1,
    overwrite: bool = False,
    run_code: bool = False,
    time_limit: float | None = None,
) -> Results:
    """Run a study: estimators over values of any key of scenario, fault or estimator.

    Parameters
    ----------
    definition : str, Path or mapping
        A TOML file, or its keys: ``{"scenario": "fm_step-v1", "estimators": ["glr"], "seeds":
        20, "sweep": {"fault[0].factor": [1.2, 2.0]}}``; classes may stand among the estimators.
    folder, jobs, overwrite, time_limit
        As for `benchmark`.
    run_code : bool
        Whether code that a file names may be run; what stands in a mapping is yours.

    Returns
    -------
    Results
        A row a case and parameter, with the value on each axis of the study.

    Raises
    ------
    StudyError
        With one line for each problem.
    CodeRefused
        If the file names code, and `run_code` was not given.
    """
    from flexaxis.experiments.studies.definition import load_study, study_from

    if isinstance(definition, str | Path):
        wanted = load_study(definition)
    else:
        run_code, content = True, {"name": "study"} | dict(definition)
        if "estimators" in content:
            content["estimators"] = list(texts_of(content["estimators"], jobs=jobs))
        wanted = study_from(content)
    return _run(
        wanted, folder, jobs=jobs, overwrite=overwrite, run_code=run_code, time_limit=time_limit
    )


def _run(
    wanted: Study,
    folder: Any,
    *,
    jobs: int,
    overwrite: bool,
    run_code: bool = True,
    time_limit: float | None = None,
) -> Results:
    from flexaxis.experiments.running.engine import run_study

    place = Path(folder) if folder else Path(tempfile.mkdtemp(prefix="flexaxis-"))
    total = len(wanted.scenarios) * len(wanted.points) * len(wanted.estimators) * len(wanted.seeds)
    with working(
        f"{total} case{'s'[: total != 1]}", total, jobs=jobs, time_limit=time_limit
    ) as means:
        run_study(wanted, place, means, overwrite=overwrite, run_code=run_code)
    found = Results.load(place)
    if not folder:  # the rows go when nobody reads them any more
        weakref.finalize(found.source, _remove, place)
    return found


def _remove(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder, ignore_errors=True)
