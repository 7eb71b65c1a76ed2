"""Logs that cannot be used, or not as they stand: each a file, options, and what must be said."""

import gzip
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

N = 2000
RATE = 1000.0


def signals(seconds=N / RATE, seed=0):
    """Return time, torque and angle of an inertia that is shaken, as a good log."""
    rng = np.random.default_rng(seed)
    count = round(seconds * RATE)
    torque = rng.standard_normal(count)
    speed = np.concatenate([[0], np.cumsum(torque)[:-1]])  # held, so it acts until the next
    angle = np.concatenate([[0], np.cumsum(speed[:-1] + torque[:-1] / 2)]) * 1e-5
    return {"time": np.arange(count) / RATE, "torque": torque, "angle": angle}


def text_of(columns, separator=",", form="{:.12g}"):
    rows = zip(*columns.values(), strict=True)
    lines = [separator.join(form.format(v) for v in row) for row in rows]
    return "\n".join([separator.join(columns), *lines]) + "\n"


@dataclass(frozen=True)
class Hostile:
    """A log, how it is imported, and words that the answer must have.

    Attributes
    ----------
    name : str
        Of the file.
    write : callable
        Writes it.
    words : tuple of str
        Options.
    says : tuple of str
    """

    name: str
    write: Callable[[Path], object]
    words: tuple[str, ...]
    says: tuple[str, ...]


def csv(change=None, *, words=(), says=(), name="log.csv", edit=None):
    """Return a hostile CSV from a change of the columns, or of the text of the good log."""

    def write(path):
        columns = signals() | (change or {})
        text = text_of(columns)
        path.write_text(edit(text) if edit else text, encoding="utf-8")

    return Hostile(name, write, tuple(words), tuple(says))


def raw(content, says, name="log.csv", words=()):
    return Hostile(name, lambda path: path.write_bytes(content), tuple(words), tuple(says))


def line(text, number, new):
    """Return a text with one of its lines replaced, from 1."""
    lines = text.split("\n")
    lines[number - 1] = new
    return "\n".join(lines)


def _zip(path):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("xl/workbook.xml", "<x/>")


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in signals().items():
            file[name] = values


def _cut(write, share):
    def cut(path):
        write(path)
        content = path.read_bytes()
        path.write_bytes(content[: int(share * len(content))])

    return cut


def _endless(path):
    with h5py.File(path, "w") as file:
        for name in ("time", "torque", "angle"):
            file.create_dataset(name, shape=(10**10,), chunks=(1024,), dtype=float)


def _mat(path):
    from scipy.io import savemat

    savemat(path, signals())


def _mat_of_texts(path):
    from scipy.io import savemat

    savemat(path, {"a": "text", "b": np.array(["x", "y"], object)})


def _broken_inside(path):
    """A MAT file whose lengths lie."""
    _mat(path)
    content = bytearray(path.read_bytes())
    content[132:136] = b"\xff\xff\xff\x7f"
    path.write_bytes(content)


def _parquet(path):
    import pyarrow
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(signals()), path)


good = signals()
turning = np.cumsum(np.full(N, 0.05)) + good["angle"]
back = good["time"].copy()
back[500:] -= 0.1
gone = good["time"].copy()
gone[700] = np.nan
SIGNALS = ("--time", "time", "--torque", "torque", "--angle", "angle")

HOSTILE: dict[str, Hostile] = {
    # files
    "empty": raw(b"", ["log.csv", "is empty"]),
    "names only": raw(b"time,torque,angle\n", ["holds no rows of numbers"]),
    "prose": raw(b"This is no log.\nIt says nothing.\n" * 30, ["holds no rows of numbers"]),
    "web page": raw(b"<!doctype html>\n<p>Log in first</p>\n" * 9, ["holds no rows of numbers"]),
    "noise": raw(bytes(range(256)) * 40, ["neither CSV nor MAT"]),
    "workbook": Hostile("log.xlsx", _zip, (), ("ZIP archive", "save it as CSV")),
    "compressed": raw(gzip.compress(b"time,torque\n1,2\n"), ["unpack it"], "log.csv.gz"),
    "document": raw(b"%PDF-1.7\n" + b"x" * 99, ["export the log as CSV"], "log.pdf"),
    "old netcdf": raw(b"CDF\x01" + b"\0" * 99, ["nccopy"], "log.nc"),
    "cut hdf5": Hostile("log.h5", _cut(hdf5, 0.5), (), ("no HDF5 file, or a broken one",)),
    "hdf5 of ten thousand million samples": Hostile("log.h5", _endless, (), ("10000000000",)),
    "cut mat": Hostile("log.mat", _cut(_mat, 0.4), (), ("no MAT file, or a broken one",)),
    "mat whose lengths lie": Hostile("log.mat", _broken_inside, (), ("--torque COLUMN",)),
    "mat of noise": raw(bytes(range(256)) * 40, ["no MAT file"], "log.mat"),
    "mat of texts": Hostile("log.mat", _mat_of_texts, (), ("holds no columns of numbers",)),
    "cut parquet": Hostile("log.parquet", _cut(_parquet, 0.5), (), ("no parquet file",)),
    "cut bag": raw(b"\x89MCAP0\r\n" + b"x" * 50, ["export its topics as CSV"], "log.mcap"),
    "folder": Hostile("logs", lambda path: path.mkdir(), (), ("is a folder",)),
    # rows
    "row too long": csv(edit=lambda t: line(t, 800, "1,2,3,4"), says=["line 800 has 4 cells"]),
    "text in a column": csv(
        edit=lambda t: line(t, 900, "0.898,OVERRUN,1"),
        says=["line 900, column torque", "'OVERRUN' is not a number"],
    ),
    "two logs in one file": csv(edit=lambda t: t + t, says=["line 2002, column time", "'time'"]),
    "names of other number": csv(
        edit=lambda t: line(t, 1, "time,torque,angle,a,b"), says=["5 cells, but the rows have 3"]
    ),
    "decimal commas between commas": csv(
        edit=lambda t: "\n".join(
            row if k == 0 else row.replace(".", ",") for k, row in enumerate(t.split("\n"))
        ),
        says=["line 2 has", "decimal commas"],
    ),
    "cell of a million letters": csv(
        edit=lambda t: line(t, 900, f"0.898,{'x' * 10**6},1"), says=["line 900, column torque"]
    ),
    # columns
    "column misspelt": csv(words=["--torque", "torqe"], says=["'torqe'", "Did you mean 'torque'"]),
    "no torque": csv(
        edit=lambda t: t.replace("torque", "u", 1), says=["--torque COLUMN", "time, u, angle"]
    ),
    "no time": csv(
        edit=lambda t: "\n".join(row.partition(",")[2] for row in t.split("\n")),
        says=["--rate HZ"],
    ),
    "one column for two": csv(words=["--speed", "angle"], says=["named for angle, speed"]),
    "unknown unit that is given": csv(words=["--unit", "angle=furlong"], says=["rad"]),
    "unknown unit": csv(
        edit=lambda t: t.replace("angle", "angle [furlong]", 1),
        says=["'furlong' of angle", "--unit angle="],
    ),
    "angle missing everywhere": csv(
        edit=lambda t: "\n".join(
            row if k == 0 else row.rpartition(",")[0] + "," for k, row in enumerate(t.split("\n"))
        ),
        says=["log.csv", "angle holds no numbers"],
    ),
    # numbers
    "constant": csv({"torque": np.ones(N)}, says=["log.csv: torque is constant"]),
    "absurd": csv(
        {"torque": np.where(np.arange(N) == 700, -1e30, good["torque"])},
        says=["torque is -1e+30 at 0.7 s (sample 700)", "that is no torque"],
    ),
    "backwards": csv({"time": back}, says=["at sample 500", "--rate HZ"]),
    "time missing": csv({"time": gone}, says=["time is missing at sample 700"]),
    "microseconds": csv({"time": good["time"] * 1e6}, says=["--unit time=us"]),
    "degrees": csv({"angle": np.degrees(turning) % 360}, says=["--unit angle=deg"]),
    "counts": csv({"angle": np.rint(turning * 65536)}, says=["--scale angle=FACTOR"]),
    "rpm": csv(
        {"speed": np.gradient(good["angle"], good["time"]) * 9.5493}, says=["--unit speed=rpm"]
    ),
    "too short": csv({k: v[:50] for k, v in good.items()}, says=["50 samples; 200 or more"]),
    "irregular": csv(
        {"time": 1e-3 * np.cumsum(np.random.default_rng(1).pareto(0.5, N) + 1e-6)},
        says=["stamps are too irregular"],
    ),
    # options
    "resample to nothing": csv(words=["--resample", "0"], says=["--resample 0 Hz"]),
    "resample to no number": csv(words=["--resample", "nan"], says=["--resample nan"]),
    "resample beyond all": csv(words=["--resample", "1e9"], says=["--resample 1e+09 Hz"]),
    "resample to few": csv(words=["--resample", "20"], says=["200 are needed"]),
    "rate of nothing": csv(words=["--rate", "0"], says=["rate is 0"]),
    "scale of no number": csv(words=["--scale", "torque=nan"], says=["scale.torque"]),
    "scale of a word": csv(words=["--scale", "torque=x"], says=["not a number"]),
    "scale of what": csv(words=["--scale", "torq=2"], says=["Did you mean 'torque'"]),
    "burn-in beyond the end": csv(words=["--burn-in", "99"], says=["--burn-in 99 s"]),
}
