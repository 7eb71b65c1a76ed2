"""What a run comes to, pooled over its seeds: what its report is made of."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.running.folder import read_study
from flexaxis.experiments.scoring.curves import Curve, curve_of
from flexaxis.experiments.storage.files import STUDY, SUMMARY, OutputError, json_table
from flexaxis.experiments.storage.traces import Traces
from flexaxis.sim.scenario import scenario_from
from flexaxis.sim.storage.reading import shown

Number = float | bool | None
Numbers = list[Number]


class _Row(BaseModel):
    """A row of a summary: texts are those that are named, all else is numbers."""

    model_config = ConfigDict(extra="allow", strict=True)
    __pydantic_extra__: dict[str, Number | Numbers | dict[str, Number | Numbers]]
    scenario: str = ""
    hash: str = ""
    estimator: str = ""
    parameter: str = ""
    how: str = ""
    setting: str = ""
    settings: list[str] = []
    values: Numbers | dict[str, Numbers | None] = []

    @model_validator(mode="after")
    def _shapes(self) -> _Row:
        for name, value in self.__pydantic_extra__.items():
            ends = len(value) if isinstance(value, list) else None
            if value is not None and ends != (2 if name.endswith("_interval") else None):
                raise ValueError(f"{name}: an interval has two ends, a score is a number")
        return self


class _Sweep(BaseModel):
    points: list[_Row]
    matched: list[_Row]
    overall: list[_Row]
    faults: dict[str, str]
    left_out: list[str] = []


class _Summary(BaseModel):
    """What summary.json holds, as far as a report is made of it."""

    title: str
    command: str
    versions: dict[str, str]
    seeds: list[int]
    scenarios: dict[str, dict[str, Any]]
    estimators: dict[str, str]
    rows: list[_Row]
    as_set: list[_Row]
    failures: list[dict[str, Any]] = []
    tradeoff: _Sweep | None = None


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
        name: scenario_from(entry["definition"], source=str(folder))
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
        content = json_table(folder / SUMMARY, OutputError)
        _Summary.model_validate(content)
        return with_curves(folder, content)
    except ValidationError as error:
        wrong = error.errors()[0]
        place = ".".join(map(str, wrong["loc"][:3]))
        raise OutputError(
            f"{folder / SUMMARY}: damaged, or changed by hand: {shown(place)}: {wrong['msg']}."
            f"{_how_to_go_on(folder)}"
        ) from error
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
