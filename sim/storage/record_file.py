"""Records as NetCDF-4 files: the layout, in and out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import numpy as np
from numpy.typing import NDArray

from flexaxis.models_mjcf import DEFAULT
from flexaxis.sim.errors import RecordError
from flexaxis.sim.law_parameters import LAW_NAMES
from flexaxis.sim.parameters import PARAMETER_NAMES, PARAMETER_UNITS, model_with, parameter_names
from flexaxis.sim.storage.netcdf import new_netcdf
from flexaxis.sim.storage.reading import json_value

Array = NDArray[np.float64]

ALL = slice(None)

LARGEST = 8_000_000_000
"""Bytes that are read at once: 45 million samples with all signals and a dozen parameters."""

SIGNALS = {
    "time": ("s", "time of the sample"),
    "torque": ("N m", "torque command, held from this sample to the next"),
    "angle": ("rad", "motor angle as measured"),
    "speed": ("rad/s", "motor speed as measured"),
    "increment": ("rad/s", "difference of measured motor angles over the period"),
    "true_speed": ("rad/s", "motor speed"),
    "true_angle_m": ("rad", "motor angle"),
    "true_angle_g": ("rad", "gear angle, arm side"),
    "true_angle_a": ("rad", "arm angle"),
    "true_angle_l": ("rad", "load angle"),
}
"""Unit and meaning of each signal (N,), by name."""


def _table(text: Any) -> dict[str, Any]:
    content = json_value(text, source="it", refuse=ValueError)
    if not isinstance(content, dict):
        raise ValueError("it is no table")
    return content


_ATTRIBUTES: dict[str, Callable[[Any], Any]] = {
    "scenario": _table,
    "versions": _table,
    "hash": str,
    "seed": int,
    "burn_in": float,
}


def write_netcdf(fields: Mapping[str, Any], path: Path) -> None:
    """Write the fields of a record to a file; the folder must exist.

    Raises
    ------
    OSError
        If it cannot be written; an older file stays.
    """
    with new_netcdf(path) as file:
        file.dimensions = {"time": len(fields["time"])}
        for name, (unit, meaning) in SIGNALS.items():
            if fields[name] is not None:
                values = np.asarray(fields[name], float)
                variable = file.create_variable(name, ("time",), data=values)
                variable.attrs.update({"units": unit, "long_name": meaning})
        if fields["valid"] is not None:
            file.create_variable("valid", ("time",), data=np.asarray(fields["valid"], np.int8))
        if fields["true_parameters"] is not None:
            _write_parameters(file, fields["parameter_names"], fields["true_parameters"])
        file.attrs["burn_in"] = fields["burn_in"]
        file.attrs["hash"] = fields["hash"]
        file.attrs["scenario"] = json.dumps(fields["scenario"])
        file.attrs["versions"] = json.dumps(fields["versions"])
        if fields["seed"] is not None:
            file.attrs["seed"] = fields["seed"]


def _write_parameters(file: Any, known: Sequence[str], values: Array) -> None:
    file.dimensions["parameter"] = len(known)
    names = file.create_variable("parameter", ("parameter",), dtype=h5py.string_dtype())
    names[:] = np.array(known, dtype=object)
    # Columns that hardly ever change: compression makes them vanish.
    variable = file.create_variable(
        "true_parameters",
        ("time", "parameter"),
        data=np.asarray(values, float),
        compression="gzip",
        compression_opts=1,
        shuffle=True,
    )
    variable.attrs["long_name"] = "true parameters that act from this sample to the next"


def file_length(path: Path) -> int:
    """Return the number of samples in a file, 0 without time; all signals must have as many."""
    with h5py.File(path, "r") as file:
        return _length(file)


def _length(file: h5py.File) -> int:
    # The arrays themselves: a named dimension may say another length than they have.
    lengths = {name: file[name].shape for name in (*SIGNALS, "valid") if name in file}
    samples = lengths.get("time", (0,))
    for name, length in lengths.items():
        if length != samples:
            raise RecordError(
                f"{name} has shape {length}; with {samples[0]} samples of time it must be "
                f"({samples[0]},)."
            )
    return int(samples[0])


def _check_form(file: h5py.File) -> None:
    """Refuse variables of another kind or shape than those of a record, before any is read."""
    samples = _length(file) if "time" in file else None
    for name in (*SIGNALS, "valid", "true_parameters"):
        if name in file and file[name].dtype.kind not in "fiub":
            raise RecordError(f"{name} holds no numbers.")
    if samples is None or "true_parameters" not in file:
        return
    most = len(PARAMETER_UNITS) + len(LAW_NAMES)
    shape = file["true_parameters"].shape
    if len(shape) != 2 or shape[0] != samples or shape[1] > most:
        raise RecordError(
            f"true_parameters has shape {shape}; with {samples} samples of time it must be "
            f"({samples}, up to {most})."
        )
    if "parameter" in file and file["parameter"].shape != shape[1:]:
        raise RecordError(
            f"parameter has shape {file['parameter'].shape}; it names {shape[1]} columns."
        )


def _check_size(file: h5py.File, span: slice) -> None:
    """Refuse what is too large to be read at once."""
    there = [file[name] for name in (*SIGNALS, "valid", "true_parameters") if name in file]
    samples = there[0].shape[0] if there else 0
    row = sum(8 * math.prod(each.shape[1:]) for each in there)  # bytes, as floats
    size = len(range(samples)[span]) * row
    if size > LARGEST:
        raise RecordError(
            f"its {samples} samples take {size / 1e9:.0f} GB at once, and no more than "
            f"{LARGEST / 1e9:.0f} GB are read: take a piece of it (in Python, record_pieces)."
        )


def read_netcdf(path: Path, span: slice = ALL) -> dict[str, Any]:
    """Return the fields of a record as they stand in a file, or those of some of its samples."""
    with h5py.File(path, "r") as plain:
        _check_form(plain)
        _check_size(plain, span)
    # Plain HDF5, as from MATLAB, has no named dimensions; it is just as good.
    with h5netcdf.File(path, "r", phony_dims="sort") as file:
        content: dict[str, Any] = {
            name: np.asarray(file.variables[name][span], dtype=float)
            for name in SIGNALS
            if name in file.variables
        }
        _check_needed(content, file.variables)
        if "valid" in file.variables:
            content["valid"] = np.asarray(file.variables["valid"][span], dtype=bool)
        if "true_parameters" in file.variables:
            content |= _read_parameters(file, span)
        attributes: Mapping[str, Any] = dict(file.attrs)
    for name, kind in _ATTRIBUTES.items():
        if name in attributes:
            try:
                content[name] = kind(attributes[name])
            except (TypeError, ValueError) as error:
                raise RecordError(f"attribute {name!r} cannot be read: {error}.") from error
    return content


def _check_needed(content: Mapping[str, Any], present: Mapping[str, Any]) -> None:
    for name in ("time", "torque"):
        if name not in content:
            raise RecordError(
                f"variable {name!r} is missing; there are {', '.join(present) or 'none'}."
            )


def _read_parameters(file: Any, span: slice) -> dict[str, Any]:
    """Return the true parameters with their columns in our order, and the names of these."""
    values = np.asarray(file.variables["true_parameters"][span], dtype=float)
    if "parameter" not in file.variables:
        raise RecordError("variable 'parameter', the names of the columns, is missing.")
    names = [n.decode() if isinstance(n, bytes) else str(n) for n in file.variables["parameter"]]
    model = model_with(name for name in names if name not in LAW_NAMES)
    order = [*parameter_names(model or DEFAULT), *(name for name in LAW_NAMES if name in names)]
    if sorted(names) != sorted(order):
        raise RecordError(
            f"parameter must name all of a model ({', '.join(PARAMETER_NAMES)}, say), and may "
            f"name {', '.join(LAW_NAMES)}; it has {names}."
        )
    return {
        "true_parameters": values[:, [names.index(name) for name in order]],
        "parameter_names": tuple(order),
    }
