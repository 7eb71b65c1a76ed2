"""Many cases, scored and pooled: `benchmark`, `study`, and the results of both."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import Any

from flexaxis._given import (
    Estimators,
    Scenarios,
    scenarios_of,
    seeds_of,
    texts_of,
)
from flexaxis.experiments.running import results as kept
from flexaxis.experiments.running.cache import default_cache
from flexaxis.experiments.running.progress import progress
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.study import Study
from flexaxis.sim.errors import FlexaxisError, unknown


@contextmanager
def working(
    what: str, total: float, folder: Path | None = None, **options: Any
) -> Iterator[Runner]:
    """Give a runner with progress and the cache of records.

    Parameters
    ----------
    what : str
        What is done, for the progress.
    total : float
        Cases, at most.
    folder : Path, optional
    **options
        ``jobs, time_limit, overwrite`` of `Runner`.
    """
    with (
        progress(what, total) as advance,
        Runner(folder, cache=default_cache(), advance=advance, **options) as runner,
    ):
        yield runner
    for text in remarks_in_words(runner.remarks):  # at the line of the user: two calls up
        warnings.warn(text, stacklevel=5)


def remarks_in_words(remarks: Sequence[tuple[str, str]]) -> list[str]:
    """Return a sentence for each estimator that returned values that are not finite."""
    places: dict[str, list[str]] = {}
    for estimator, where in remarks:
        places.setdefault(estimator, []).append(where)
    return [
        f"{estimator} returned an estimate that is not finite in {len(where)} "
        f"run{'s'[: len(where) != 1]}, first {where[0]}: such a run counts as diverged"
        for estimator, where in places.items()
    ]


class Results(kept.Results):
    """Results with their figure; rows, selections and tables are those of every folder."""

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
        from flexaxis._draw import panels
        from flexaxis.experiments.reporting.figures import curves, lag_against_noise
        from flexaxis.experiments.reporting.study import over_axis

        if x and x not in self.axes:
            known = unknown("axis", x, self.axes) if self.axes else f"axis {x!r}: nothing was swept"
            raise FlexaxisError(f"{known}; leave it out for lag against noise")
        rows = self.scores("scenario", "estimator")
        rows = rows[rows["changed"].astype(bool) & rows["lag"].notna()]
        if rows.empty:
            raise FlexaxisError("no lag to draw: nothing changes here that is estimated")
        axes = panels(ax, 1)
        if key := x or next(iter(self.axes), ""):
            options = over_axis(self, key, "lag")
            first = dict(list(options["panels"].items())[:1])
            curves(**options | {"panels": first, "axes": axes})
        else:
            lag_against_noise(rows, axes=axes)
        return axes[0]

    def __repr__(self) -> str:
        names = ", ".join(self.study.get("estimators", ()))
        text = f"Results of {names}: {self.cases} case{'s'[: self.cases != 1]}"
        failed = len(self.failures)
        return text + (f", {failed} of them failed: see .failures" if failed else "")

    def _repr_html_(self) -> str:
        shown = ["scenario", "estimator", "parameter", "lag", "t10", "std", "bias", "diverged",
                 "failed", "runs"]  # fmt: skip
        table = self.scores()
        return f"<p>{escape(repr(self))}</p>{table[[*shown]].to_html(index=False)}"


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
        Processes.
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
    study = Study("benchmark", scenarios_of(scenarios), texts_of(estimators), seeds_of(seeds))
    return _run(study, folder, jobs=jobs, overwrite=overwrite, time_limit=time_limit)


def study(
    definition: str | Path | Mapping[str, Any],
    *,
    folder: str | Path | None = None,
    jobs: int = 1,
    overwrite: bool = False,
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

    Returns
    -------
    Results
        A row a case and parameter, with the value on each axis of the study.

    Raises
    ------
    StudyError
        With one line for each problem.
    """
    from flexaxis.experiments.studies.definition import load_study, study_from

    if isinstance(definition, str | Path):
        wanted = load_study(definition)
    else:
        content = {"name": "study"} | dict(definition)
        if "estimators" in content:
            content["estimators"] = list(texts_of(content["estimators"]))
        wanted = study_from(content)
    return _run(wanted, folder, jobs=jobs, overwrite=overwrite, time_limit=time_limit)


def _run(wanted: Study, folder: str | Path | None, **options: Any) -> Results:
    place, total = Path(folder) if folder else None, wanted.cases
    with working(f"{total} case{'s'[: total != 1]}", total, place, **options) as runner:
        found = runner.run(wanted, about={"title": wanted.name})
    return Results(runner.store, found.study)
