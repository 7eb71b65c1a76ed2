"""A record: what was measured in one run, the truth where it is known, and where it is from."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.sim.errors import RecordError
from flexaxis.sim.parameters import PARAMETER_NAMES
from flexaxis.sim.storage.record_file import ALL, SIGNALS, file_length, read_netcdf, write_netcdf
from flexaxis.sim.timing import rate

Array = NDArray[np.float64]

ROUNDING = 2e-7  # of a period; nobody's clock is so exact

OUTPUTS = ("speed", "increment", "angle")
"""The signals of which a record needs one."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Record:
    """One run, sampled at times t_k: torque in, motor angle out.

    The output k is measured at t_k, before the torque k acts on [t_k, t_{k+1}). Whatever is not
    known of a log from outside is None: only time, torque and one of speed, increment and angle
    must be there.

    Attributes
    ----------
    time : ndarray (N,)
        Sample times, evenly spaced [s].
    torque : ndarray (N,)
        Torque command [N m].
    angle, speed, increment : ndarray (N,), optional
        Motor angle [rad], motor speed [rad/s] and difference of motor angles over the period
        [rad/s], as measured.
    true_speed, true_angle_m, true_angle_g, true_angle_a, true_angle_l : ndarray (N,), optional
        True motor speed [rad/s], and true angle of motor, gear, arm and load [rad], of those that
        the plant has.
    true_parameters : ndarray (N, P), optional
        True parameters that act on [t_k, t_{k+1}), a column each of `parameter_names`.
    parameter_names : tuple of str
        Those of the plant, in the order of `parameter_names`, and then those of its laws.
    valid : ndarray (N,) of bool, optional
        False where a sample is missing; without it all are there.
    scenario : dict
        The scenario with all its values written out, its name included; empty if unknown.
    hash : str
        Content hash of the scenario.
    seed : int, optional
        Number of the run.
    burn_in : float
        Time from the start that is not to be scored [s].
    versions : dict
        Versions of the programs that made it.
    first : int
        Number of the first sample, where this is a piece of a longer record.

    Raises
    ------
    RecordError
        If a needed array is missing, shapes differ, a value is not finite, or time does not
        advance evenly.
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
    first: int = 0

    def __post_init__(self) -> None:
        for name in (*SIGNALS, "true_parameters", "valid"):
            object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        _check(self)
        if self.valid is not None:
            object.__setattr__(self, "valid", self.valid.astype(bool, copy=False))

    def __repr__(self) -> str:
        name = self.scenario.get("name", "of no scenario")
        seed = "" if self.seed is None else f", seed {self.seed}"
        return f"Record {name}{seed}: {len(self.time)} samples of {1000 * self.period:g} ms"

    @property
    def period(self) -> float:
        """Sampling period [s]."""
        span = self.time[-1] - self.time[0]
        mean = float(span / (len(self.time) - 1))
        # A simulated grid is exact; a mean over it would be off by rounding.
        whole = rate(mean)
        return 1 / whole if whole and abs(mean * whole - 1) < ROUNDING else mean

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the record as NetCDF-4; a file of that name is replaced at once or not at all.

        Parameters
        ----------
        path : path-like
            File to write; by custom it ends in ``.nc``.

        Returns
        -------
        Path
            The file written.

        Raises
        ------
        RecordError
            If the folder does not exist or cannot be written.
        """
        path = Path(path)
        if not path.parent.is_dir():
            raise RecordError(f"{path}: there is no folder {path.parent}.")
        try:
            write_netcdf(vars(self), path)
        except OSError as error:
            raise RecordError(f"{path}: cannot be written: {error}.") from error
        return path


def load_record(path: str | os.PathLike[str]) -> Record:
    """Read a record from a NetCDF-4 file, and check it.

    Parameters
    ----------
    path : path-like
        File written by `Record.save`, or one of your own with variables ``time``, ``torque`` and
        ``speed``, ``increment`` or ``angle`` on a dimension ``time``.

    Returns
    -------
    Record
        The record; what the file does not have is None.

    Raises
    ------
    RecordError
        If the file is missing, broken, no record, or holds impossible values.
    """
    return _read(Path(path))


def record_pieces(path: str | os.PathLike[str], *, samples: int = 100_000) -> Iterator[Record]:
    """Read a record piece by piece, so that one of any length needs little memory.

    Parameters
    ----------
    path : path-like
        As for `load_record`.
    samples : int
        Samples in a piece.

    Yields
    ------
    Record
        The next piece, checked, its `first` the number of its first sample.

    Raises
    ------
    RecordError
        As from `load_record`, when the piece is reached.
    """
    path = Path(path)
    total = count_samples(path)
    # A piece of one sample would have no period: it joins the one before.
    starts = [k for k in range(0, max(total, 1), samples) if k == 0 or total - k > 1]
    before: Record | None = None
    for start, stop in zip(starts, [*starts[1:], total], strict=True):
        piece = _read(path, slice(start, stop))
        if before is not None:
            _check_grid(np.append(before.time[-2:], piece.time[:1]), first=start - 2, name=path)
        yield piece
        before = piece


def count_samples(path: str | os.PathLike[str]) -> int:
    """Return the number of samples in a record file; errors as from `load_record`."""
    return int(_guarded(Path(path), file_length))


def _read(path: Path, span: slice = ALL) -> Record:
    fields = _guarded(path, lambda file: read_netcdf(file, span))
    try:
        return Record(**fields, first=span.start or 0)
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from error


def _guarded(path: Path, read: Callable[[Path], Any]) -> Any:
    """Read from a file, and say in one line what is wrong with it."""
    if not path.is_file():
        raise RecordError(f"{path}: no such file.")
    try:
        return read(path)
    except RecordError as error:
        raise RecordError(f"{path}: {error}") from error
    except Exception as error:
        # The HDF5 stack has many exceptions for a broken file, and no common one.
        raise RecordError(f"{path}: no NetCDF-4 file, or a broken one ({error}).") from error


def _numbers(name: str, values: object) -> Array | None:
    """Return a signal as an array of float; such an array, or one of bool, is left as it is."""
    if values is None or (isinstance(values, np.ndarray) and values.dtype == bool):
        return values  # type: ignore[return-value]
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise RecordError(f"{name} is no array of numbers: {error}.") from None


def _check(record: Record) -> None:
    """Raise a RecordError for what would make a record useless or misleading."""
    if all(getattr(record, name) is None for name in OUTPUTS):
        raise RecordError(f"a record needs one of {', '.join(OUTPUTS)}; there is none of them.")
    samples = np.size(record.time)
    if samples < 2:
        raise RecordError(f"a record needs at least 2 samples; time has {samples}.")
    for name in (*SIGNALS, "valid"):
        _check_array(record, name, (samples,))
    _check_array(record, "true_parameters", (samples, len(record.parameter_names)))
    _check_grid(record.time, first=record.first)


def _check_array(record: Record, name: str, shape: tuple[int, ...]) -> None:
    values = getattr(record, name)
    if values is None:
        return
    if np.shape(values) != shape:
        raise RecordError(
            f"{name} has shape {np.shape(values)}; with {shape[0]} samples of time it must be "
            f"{shape}."
        )
    bad = ~np.isfinite(values)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        where = f"sample {record.first + index[0]}"
        if len(index) > 1:
            where += f", {record.parameter_names[index[1]]}"
        raise RecordError(
            f"{name} is {values[index]} at {where} ({bad.sum()} such values); mark missing "
            "samples with valid = False and give them any finite value."
        )


def _check_grid(time: Array, *, first: int = 0, name: object = "") -> None:
    """Raise a RecordError if time does not advance evenly; `first` numbers its first sample."""
    where = f"{name}: " if name else ""
    steps = np.diff(time)
    if (steps <= 0).any():
        k = first + int(np.argmax(steps <= 0)) + 1
        raise RecordError(f"{where}time does not advance at sample {k}.")
    uneven = np.abs(steps / np.median(steps) - 1) > 0.01
    if uneven.any():
        k = int(np.argmax(uneven))
        raise RecordError(
            f"{where}time is not even: {steps[k]:.6g} s from sample {first + k} to "
            f"{first + k + 1}, but {np.median(steps):.6g} s mostly; resample, or mark gaps with "
            "valid = False."
        )
