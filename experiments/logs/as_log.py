"""Write a record as a robot would log it: its units, its clock, its resolution, its gaps."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.files import WRITTEN
from flexaxis.experiments.logs.units import UNITS
from flexaxis.experiments.storage.files import new_file
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.record import Record

Array = NDArray[np.float64]

FORMATS = ("csv", "mat", "h5")
SIGNALS = ("torque", "angle", "speed")
LONGEST_GAP = 20  # samples
MOST_GAPS = 10_000
MAT_HEAD = 116  # bytes of text at the head of a MAT file of version 5, by its specification

_SI = {"time": "s", "torque": "Nm", "angle": "rad", "speed": "rad/s"}


@dataclass(frozen=True)
class LogStyle:
    """How a robot writes its log.

    Attributes
    ----------
    units : tuple of str
        Such as ``("deg", "A")``: each is that of the signals that can have it, SI else.
    header : bool
        Whether columns have names and units.
    decimal_comma : bool
        Whether a CSV has decimal commas, and semicolons between its columns.
    jitter : float
        Standard deviation of the time stamps [s]; the samples themselves are even.
    gaps : int
        Times at which up to `LONGEST_GAP` samples are missing.
    counts : int
        Counts of the encoder in a turn of the motor; 0 for the angle as it was measured.
    torque_step : float
        Resolution of the torque [N m]; 0 for none.
    offset : mapping of str to float
        What is added to a signal [SI].
    scale : mapping of str to float
        Factor that `flexaxis import --scale` has to undo, such as N m in an ampere.

    Raises
    ------
    LogError
        If a unit or a signal is unknown, or a size is below zero.
    """

    units: tuple[str, ...] = ()
    header: bool = True
    decimal_comma: bool = False
    jitter: float = 0.0
    gaps: int = 0
    counts: int = 0
    torque_step: float = 0.0
    offset: Mapping[str, float] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = [unit for table in UNITS.values() for unit in table]
        for unit in self.units:
            if unit not in known:
                raise LogError(f"--units: unknown unit {unit!r}.{did_you_mean(unit, known)}")
        for option in ("offset", "scale"):
            for name in getattr(self, option):
                if name not in SIGNALS:
                    raise LogError(
                        f"--{option}: there is no signal {name!r}.{did_you_mean(name, SIGNALS)} "
                        f"There are {', '.join(SIGNALS)}"
                    )
        if not all(np.isfinite(x) and x != 0 for x in self.scale.values()):
            raise LogError("--scale: give factors other than 0")
        for option in ("jitter", "gaps", "counts", "torque_step"):
            if not getattr(self, option) >= 0:
                given = getattr(self, option)
                raise LogError(f"--{option.replace('_', '-')} {given}: give 0 or more")
        if self.gaps > MOST_GAPS:
            raise LogError(f"--gaps {str(self.gaps)[:40]}: give at most {MOST_GAPS}")

    def unit(self, signal: str) -> str:
        """Return the unit of a signal."""
        return next((unit for unit in self.units if unit in UNITS[signal]), _SI[signal])


def logged(record: Record, style: LogStyle, rng: np.random.Generator) -> dict[str, Array]:
    """Return the columns (M,) of a log in its own units, time first; rows in gaps are left out.

    Parameters
    ----------
    record : Record
        What it does not have of the signals is left out.
    style : LogStyle
    rng : Generator
        Of jitter and gaps.
    """
    found = {"time": record.time + style.jitter * rng.standard_normal(len(record.time))}
    for name in SIGNALS:
        values = getattr(record, name)
        if values is not None:
            found[name] = values + style.offset.get(name, 0.0)
    steps = {"angle": 2 * np.pi / style.counts if style.counts else 0.0}
    for name, step in (steps | {"torque": style.torque_step}).items():
        if step and name in found:
            found[name] = np.rint(found[name] / step) * step
    kept = _kept(len(record.time), style.gaps, rng)
    if record.valid is not None:
        kept &= record.valid
    return {
        name: values[kept] / (UNITS[name][style.unit(name)] * style.scale.get(name, 1.0))
        for name, values in found.items()
    }


def _kept(samples: int, gaps: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    kept = np.ones(samples, bool)
    room = samples - LONGEST_GAP - 1
    for begin in rng.integers(1, max(room, 2), gaps):  # the first and the last sample are there
        kept[begin : min(begin + rng.integers(1, LONGEST_GAP + 1), samples - 1)] = False
    return kept


def write_log(
    path: Path, columns: Mapping[str, Array], style: LogStyle, *, date: str | None = None
) -> None:
    """Write columns as CSV, MAT or HDF5, by the suffix of the path.

    Parameters
    ----------
    path : Path
        Ends in one of `FORMATS`. The file says whose it is, for `own.spare_foreign`.
    columns : mapping of str to ndarray (M,)
        As from `logged`, and others in whatever unit their name says.
    style : LogStyle
        For names and units.
    date : str, optional
        When the log began, by ISO 8601; it goes into the file.
    """
    writer = {".csv": _write_csv, ".mat": _write_mat, ".h5": _write_h5}[path.suffix]
    with new_file(path) as part:
        writer(part, columns, style, date)


def _write_csv(path: Path, columns: Mapping[str, Array], style: LogStyle, date: str | None) -> None:
    units = {name: f"{name} [{style.unit(name)}]" for name in columns if name in UNITS}
    mark, point = (";", ",") if style.decimal_comma else (",", ".")
    lines = [f"# {WRITTEN}", *([f"# date: {date}"] if date else [])]
    if style.header:
        lines.append(mark.join(units.get(name, name) for name in columns))
    cells = zip(*(values.tolist() for values in columns.values()), strict=True)
    row = mark.join(["%.10g"] * len(columns))
    lines += [(row % values).replace(".", point) for values in cells]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_mat(path: Path, columns: Mapping[str, Array], style: LogStyle, date: str | None) -> None:
    from scipy.io import savemat

    # a MAT file has no place for units
    savemat(path, _variables(columns, style) | ({"date": date} if date else {}))
    with path.open("r+b") as file:  # over the date of the file: equal runs write equal files
        file.write(f"MATLAB 5.0 MAT-file, {WRITTEN}".encode().ljust(MAT_HEAD))


def _write_h5(path: Path, columns: Mapping[str, Array], style: LogStyle, date: str | None) -> None:
    import h5py

    memory = io.BytesIO()  # HDF5 cannot close a file on a full disk, and ends the process with that
    with h5py.File(memory, "w") as file:
        file.attrs.update({"flexaxis": WRITTEN} | ({"date": date} if date else {}))
        for name, values in _variables(columns, style).items():
            file[name] = values
            if name in UNITS:
                file[name].attrs["units"] = style.unit(name)
    path.write_bytes(memory.getvalue())  # a view in an error would keep HDF5 from closing


def _variables(columns: Mapping[str, Array], style: LogStyle) -> dict[str, Array]:
    """Return the variables of a file that has such: a matrix without names where they have none."""
    return dict(columns) if style.header else {"data": np.column_stack([*columns.values()])}


def import_words(path: Path, columns: Sequence[str], style: LogStyle) -> list[str]:
    """Return the command line that imports a log, as somebody would have to find it."""
    words = ["flexaxis", "import", str(path), "--torque-is", "held"]
    bare, named = not style.header, {n: k for k, n in enumerate(columns) if n in UNITS}
    for name, place in named.items() if bare else ():
        column = f"column{place + 1}" if path.suffix == ".csv" else f"data[{place}]"
        words += [f"--{name}", column]
    for name in named if bare or path.suffix == ".mat" else ():
        if style.unit(name) != _SI[name]:
            words += ["--unit", f"{name}={style.unit(name)}"]
    for name, factor in style.scale.items():
        words += ["--scale", f"{name}={factor:g}"]
    return words
