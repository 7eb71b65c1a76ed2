"""What a run comes to, pooled over its seeds: what its report is made of."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.scoring.curves import Curve, curve_of
from flexaxis.experiments.storage.files import STUDY, SUMMARY, OutputError, json_table
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import stored_scenario


@dataclass(frozen=True)
class Pooled:
    """What the report of a run is made of.

    Attributes
    ----------
    summary : dict
        As in summary.json: command, versions, seeds, scenarios, estimators, pooled rows.
    curves : list of Curve
        Trajectories of each estimator on each scenario.
    folder : Path
        Where it is from.
    """

    summary: dict[str, Any]
    curves: list[Curve]
    folder: Path

    @property
    def rows(self) -> Rows:
        """The rows behind, one at a time; `rows.results` selects and pools them."""
        return Results.load(self.folder).rows


def with_curves(folder: Path, summary: dict[str, Any]) -> Pooled:
    """Return what a summary says with the trajectories of the runs, one estimator at a time."""
    scenarios = {
        name: stored_scenario(entry["definition"], source=str(folder))
        for name, entry in summary["scenarios"].items()
    }
    traces = Traces(folder, read_study(folder).get("code", {}), summary["seeds"])
    curves = []
    for name, text in dict.fromkeys((r["scenario"], r["estimator"]) for r in summary["rows"]):
        if known := list(traces.find(scenarios[name].hash, text).values()):
            runs, near = [t.curve for t in known], [t.detail.near for t in known]
            curves.append(curve_of(scenarios[name], text, known[0].names, runs, near))
    return Pooled(summary, curves, folder)


def load(folder: Path) -> Pooled:
    """Return what was pooled in the folder of a run.

    Raises
    ------
    OutputError
        If a file is missing or damaged.
    """
    try:
        return with_curves(folder, json_table(folder / SUMMARY, OutputError))
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise OutputError(
            f"{folder} holds no complete result of a run ({SUMMARY} is needed): "
            f"{error}.{_how_to_go_on(folder)}"
        ) from error


def _how_to_go_on(folder: Path) -> str:
    command = ""
    with suppress(OutputError):
        command = str(json_table(folder / STUDY, OutputError).get("command"))
    if not command.startswith("flexaxis run"):
        return " Make one with `flexaxis run … -o FOLDER`"
    return f" Go on with: {command} --resume"
