"""Define the record of a run: measured signals, true values and the scenario."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.models_mjcf import DEFAULT
from flexaxis.sim.errors import RecordError
from flexaxis.sim.parameters import LAW_NAMES, PARAMETER_NAMES, model_with, parameter_names
from flexaxis.sim.text_files import atomic
from flexaxis.sim.timing import rate

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

ROUNDING = 2e-7  # relative tolerance for an integer sampling rate; real clocks are less exact

OUTPUTS = ("speed", "increment", "angle")
"""Names of the measured motor signals; a record must contain at least one of these signals."""

SIGNALS = {
    "time": ("s", "time of the sample"),
    "torque": ("N m", "torque command, which is constant until the next sample"),
    "angle": ("rad", "measured motor angle"),
    "speed": ("rad/s", "measured motor speed"),
    "increment": ("rad/s", "difference of successive measured motor angles divided by the period"),
    "true_speed": ("rad/s", "true motor speed"),
    "true_angle_m": ("rad", "true motor angle"),
    "true_angle_g": ("rad", "true angle of the gear on the arm side"),
    "true_angle_a": ("rad", "true arm angle"),
    "true_angle_l": ("rad", "true load angle"),
}
"""Unit and description of each signal in a record, keyed by signal name."""

_ATTRIBUTES: dict[str, Callable[[Any], Any]] = {
    "scenario": json.loads,
    "versions": json.loads,
    "hash": str,
    "seed": int,
    "burn_in": float,
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Record:
    """The signals of one run, sampled at the times t_k.

    The motion signals at index k are measured at the time t_k, and the torque at index k acts from
    t_k to t_{k+1}. A record must have the fields `time` and `torque`, and at least one of the
    fields `speed`, `increment` and `angle`. All other fields of a record can be None.

    Attributes
    ----------
    time : ndarray (N,)
        Evenly spaced sample times [s].
    torque : ndarray (N,)
        Torque command [N m].
    angle, speed, increment : ndarray (N,), optional
        Measured motor angle [rad], measured motor speed [rad/s], and difference between successive
        measured angles, divided by the sampling period [rad/s].
    true_speed, true_angle_m, true_angle_g, true_angle_a, true_angle_l : ndarray (N,), optional
        True motor speed [rad/s], and true angles of motor, gear, arm and load [rad]. If the plant
        does not have one of these masses, the angle of this mass is None.
    true_parameters : ndarray (N, P), optional
        True parameter values. The values in row k apply from t_k to t_{k+1}, and column i contains
        the parameter `parameter_names[i]`.
    parameter_names : tuple of str
        Names of the P parameters: first the parameters of the linear axis, then the parameters of
        nonlinear effects.
    valid : ndarray (N,) of bool, optional
        Array that is False at each sample with a missing measurement, or None if no measurement is
        missing.
    scenario : dict
        All keys and values of the scenario, or an empty dict if the scenario is unknown.
    hash : str
        Hash of the scenario content.
    seed : int, optional
        Seed of the run.
    burn_in : float
        Length of the initial interval that is excluded from all scores [s].
    versions : dict
        Versions of the programs that produced the record, keyed by name.

    Raises
    ------
    RecordError
        If a required array is missing, if an array has the wrong shape or contains a value that is
        not finite, or if the sample times are not evenly spaced.
    """

    time: Array
    torque: Array
    angle: Array | None = None
    speed: Array | None = None
    increment: Array | None = None
    true_speed: Array | None = None
    true_angle_m: Array | None = None
    true_angle_g: Array | None = None
    true_angle_a: Array | None = None
    true_angle_l: Array | None = None
    true_parameters: Array | None = None
    parameter_names: tuple[str, ...] = PARAMETER_NAMES
    valid: NDArray[np.bool_] | None = None
    scenario: dict[str, Any] = field(default_factory=dict)
    hash: str = ""
    seed: int | None = None
    burn_in: float = 0.0
    versions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*SIGNALS, "true_parameters", "valid"):
            if (values := getattr(self, name)) is not None:
                object.__setattr__(self, name, np.asarray(values, dtype=float))
        _check(self)
        if self.valid is not None:
            object.__setattr__(self, "valid", self.valid.astype(bool))

    def __repr__(self) -> str:
        name = self.scenario.get("name", "of no scenario")
        seed = "" if self.seed is None else f", seed {self.seed}"
        return f"Record {name}{seed}: {len(self.time)} samples of {1000 * self.period:g} ms"

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        span = self.time[-1] - self.time[0]
        mean = float(span / (len(self.time) - 1))
        # The period of a simulated grid is exact, but the mean over the grid has rounding errors.
        whole = rate(mean)
        return 1 / whole if whole and abs(mean * whole - 1) < ROUNDING else mean

    def to_xarray(self) -> xarray.Dataset:
        """Convert the record to an xarray Dataset with the dimensions `time` and `parameter`."""
        import xarray

        data: dict[str, Any] = {
            name: ("time", getattr(self, name), {"units": unit, "long_name": meaning})
            for name, (unit, meaning) in SIGNALS.items()
            if getattr(self, name) is not None
        }
        if self.valid is not None:
            data["valid"] = ("time", self.valid.astype(np.int8))
        if self.true_parameters is not None:
            meaning = {"long_name": "true parameters, which are constant until the next sample"}
            data["true_parameters"] = (("time", "parameter"), self.true_parameters, meaning)
            data["parameter"] = ("parameter", np.array(self.parameter_names, object))
        attributes = {"burn_in": self.burn_in, "hash": self.hash}
        attributes |= {key: json.dumps(getattr(self, key)) for key in ("scenario", "versions")}
        if self.seed is not None:
            attributes["seed"] = self.seed
        return xarray.Dataset(data, attrs=attributes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the record to a NetCDF-4 file; an existing file is replaced atomically.

        Parameters
        ----------
        path : path-like
            Path of the NetCDF-4 file, usually with the extension ``.nc``.

        Returns
        -------
        Path
            Path of the written file.

        Raises
        ------
        RecordError
            If the folder does not exist, or if the file cannot be written.
        """
        path, data = Path(path), self.to_xarray()
        # Constant columns compress well. The file is first written to memory, because HDF5 aborts
        # the process if the disk is full.
        packed = {"true_parameters": {"zlib": True, "complevel": 1}}
        encoding = packed if self.true_parameters is not None else {}
        content = data.to_netcdf(engine="h5netcdf", encoding=encoding)
        try:
            with atomic(path) as new:
                new.write_bytes(content)
        except OSError as error:
            raise RecordError(f"{path}: cannot be written: {error}.") from error
        return path


def load_record(path: str | os.PathLike[str]) -> Record:
    """Read a record from a NetCDF-4 file and check it.

    Parameters
    ----------
    path : path-like
        Path of a file that `Record.save` has written, or of another NetCDF-4 file. The file must
        contain the variables ``time`` and ``torque``, and at least one of the variables ``speed``,
        ``increment`` and ``angle``. Each of the signals must have the dimension ``time``.

    Returns
    -------
    Record
        The record. If the file does not contain an optional variable, the record field of the same
        name keeps its default value.

    Raises
    ------
    RecordError
        If the file is missing or damaged, if the file is not a record, or if a value in the file is
        invalid.
    """
    import xarray

    path = Path(path)
    if not path.is_file():
        raise RecordError(f"{path}: no such file.")
    try:
        # Plain HDF5 files, for example from MATLAB, are accepted although they have no named
        # dimensions.
        with xarray.open_dataset(
            path, engine="h5netcdf", phony_dims="sort", decode_cf=False
        ) as file:
            return Record(**_fields(file))
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from error
    except Exception as error:
        # The HDF5 libraries raise many types of exceptions, which have no common base class.
        raise RecordError(f"{path}: the file is damaged or not NetCDF-4 ({error}).") from error


def _fields(file: xarray.Dataset) -> dict[str, Any]:
    """Read the fields of a record from an open NetCDF-4 file, and return them keyed by name."""
    for name in ("time", "torque"):
        if name not in file.variables:
            present = ", ".join(map(str, file.variables)) or "none"
            raise RecordError(f"the variable {name!r} is missing; the file contains: {present}.")
    content = {name: file[name].values for name in (*SIGNALS, "valid") if name in file.variables}
    if "true_parameters" in file.variables:
        content |= _parameters(file)
    for name, kind in _ATTRIBUTES.items():
        if name in file.attrs:
            content[name] = kind(file.attrs[name])
    return content


def _parameters(file: xarray.Dataset) -> dict[str, Any]:
    """Read the true parameters and their names, and sort the parameters into the standard order."""
    if "parameter" not in file.variables:
        raise RecordError("the variable 'parameter', which holds the parameter names, is missing.")
    names = [str(name) for name in file["parameter"].values]
    model = model_with(name for name in names if name not in LAW_NAMES)
    order = [*parameter_names(model or DEFAULT), *(name for name in LAW_NAMES if name in names)]
    if sorted(names) != sorted(order):
        raise RecordError(
            "the variable 'parameter' must contain all parameter names of one plant model (for "
            f"{DEFAULT}: {', '.join(PARAMETER_NAMES)}), and can also contain "
            f"{', '.join(LAW_NAMES)}; the variable contains {names}."
        )
    values = file["true_parameters"].values[:, [names.index(name) for name in order]]
    return {"true_parameters": values, "parameter_names": tuple(order)}


def _check(record: Record) -> None:
    """Raise a RecordError if a signal is missing, has the wrong shape or has invalid values."""
    if all(getattr(record, name) is None for name in OUTPUTS):
        raise RecordError(f"a record needs at least one of the signals {', '.join(OUTPUTS)}.")
    samples = np.size(record.time)
    if samples < 2:
        raise RecordError(f"a record needs at least 2 samples; this record has {samples}.")
    for name in (*SIGNALS, "valid"):
        _check_array(record, name, (samples,))
    _check_array(record, "true_parameters", (samples, len(record.parameter_names)))
    _check_grid(record.time)


def _check_array(record: Record, name: str, shape: tuple[int, ...]) -> None:
    values = getattr(record, name)
    if values is None:
        return
    if np.shape(values) != shape:
        raise RecordError(f"{name} has shape {np.shape(values)}, but the shape must be {shape}.")
    bad = ~np.isfinite(values)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        where = "".join(f", {record.parameter_names[i]}" for i in index[1:])
        raise RecordError(
            f"{name} is {values[index]} at sample {index[0]}{where} ({bad.sum()} values are not "
            "finite). Set valid = False at missing samples, and fill them with any finite value."
        )


def _check_grid(time: Array) -> None:
    """Raise a RecordError if the sample times are not evenly spaced."""
    steps = np.diff(time)
    if (steps <= 0).any():
        raise RecordError(f"time does not increase at sample {np.argmax(steps <= 0) + 1}.")
    uneven = np.abs(steps / np.median(steps) - 1) > 0.01
    if uneven.any():
        k = int(np.argmax(uneven))
        raise RecordError(
            f"time is not evenly spaced: samples {k} and {k + 1} are {steps[k]:.6g} s apart, but "
            f"most samples are {np.median(steps):.6g} s apart. Resample the signals, or insert "
            "the missing samples with valid = False."
        )
