"""What a run comes to, pooled over its seeds: summary.json and curves.nc, in and out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.scoring.curves import Curve
from flexaxis.experiments.storage.files import (
    CURVES,
    STUDY,
    SUMMARY,
    OutputError,
    json_table,
    write_json,
    writing,
)

LARGEST = 1e9  # bytes that all curves of a run may have


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


def save(folder: Path, pooled: Pooled) -> None:
    """Write curves.nc and summary.json, each at once or not at all."""
    with writing(folder / CURVES):
        _save_curves(folder / CURVES, pooled.curves)
    write_json(folder / SUMMARY, pooled.summary)  # last: without it a folder is not complete


def load(folder: Path) -> Pooled:
    """Return what was pooled in the folder of a run.

    Raises
    ------
    OutputError
        If a file is missing or damaged.
    """
    try:
        summary = json_table(folder / SUMMARY, OutputError)
        return Pooled(summary, _load_curves(folder / CURVES), folder)
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise OutputError(
            f"{folder} holds no complete result of a run ({SUMMARY} and {CURVES} are needed): "
            f"{error}.{_how_to_go_on(folder)}"
        ) from error


def _how_to_go_on(folder: Path) -> str:
    command = ""
    with suppress(OutputError):
        command = str(json_table(folder / STUDY, OutputError).get("command"))
    if not command.startswith("flexaxis run"):
        return " Make one with `flexaxis run … -o FOLDER`"
    return f" Go on with: {command} --resume"


_ARRAYS = ("truth", "low", "median", "high")
_NEAR = "near_"  # before the names of what is about the first fault, sample by sample


def _save_curves(path: Path, curves: Sequence[Curve]) -> None:
    from flexaxis.sim.netcdf import new_hdf5, scale

    with new_hdf5(path) as file:
        for number, curve in enumerate(curves):
            group = file.create_group(str(number), track_order=True)
            group.attrs["scenario"], group.attrs["estimator"] = curve.scenario, curve.estimator
            group.attrs["names"] = json.dumps(curve.names)
            group.attrs["percentiles"] = "low 10, median 50, high 90; all over nominal"
            estimate = scale(group, "estimate", len(curve.names))
            _add(group, curve, estimate, "")
            if curve.near is not None:
                _add(group, curve.near, estimate, _NEAR)


def _add(group: Any, curve: Curve, estimate: Any, before: str) -> None:
    from flexaxis.sim.netcdf import along, scale

    time = scale(group, f"{before}time", curve.time, units="s")
    for name in _ARRAYS:
        values = np.asarray(getattr(curve, name), np.float32)
        along(group, before + name, values, (time, estimate))


def _load_curves(path: Path) -> list[Curve]:
    import h5py  # which finds a group at once; h5netcdf goes through all dimensions for each

    from flexaxis.sim.hdf5_apart import gone_through
    from flexaxis.sim.hdf5_inside import only_inside

    def refuse(text: str) -> OutputError:
        return OutputError(f"{path}: {text}")

    gone_through(path, refuse, most=LARGEST)
    with h5py.File(path, "r") as file:
        only_inside(file, refuse)
        groups = [group for _, group in sorted(file.items(), key=lambda item: int(item[0]))]
        return [_curve(group, "", _near(group)) for group in groups]


def _near(group: Any) -> Curve | None:
    return _curve(group, _NEAR) if f"{_NEAR}time" in group else None  # older files have none


def _curve(group: Any, before: str, near: Curve | None = None) -> Curve:
    return Curve(
        scenario=group.attrs["scenario"],
        estimator=group.attrs["estimator"],
        names=tuple(json.loads(group.attrs["names"])),
        time=group[f"{before}time"][:],
        **{name: group[before + name][:].astype(float) for name in _ARRAYS},
        near=near,
    )
