"""Good files of every kind that the commands read: what mutations begin with."""

import json
import math
import struct
import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat

from flexaxis.experiments.storage.schema import row_files
from flexaxis.experiments.storage.store import rows_in

ROOT = Path(__file__).parents[2]

AXIS = """
name = "belt"
states = ["twist", "speed_motor", "speed_load"]
A = [["0", "r", "-1"], ["-r*k/J_m", "-f_m/J_m", "0"], ["k/J_l", "0", "-f_l/J_l"]]
B = ["0", "k_T/J_m", "0"]
C = ["0", "1", "0"]
delay = 0.001
whitening = [1.0, -0.5]
noise = 0.1
[nominal]
k_T = 1.0
J_m = 1e-3
J_l = 0.02
k = 300.0
f_m = 1e-3
f_l = 1e-2
r = 0.2
"""

SHORT = """
name = "short"
duration = 8.0
burn_in = 1.0
[[fault]]
kind = "step"
parameter = "f_m"
at = 6.0
factor = 1.5
"""

MAP = """
time = "t"
torque = "u"
angle = "phi"
torque_is = "smooth"
[unit]
time = "s"
[scale]
torque = 0.6
"""


SAMPLES = 1600  # of SHORT

ANSWERS = """
import os, select, sys
kind, path = sys.argv[1:]
with open(path, "rb") as file:
    if kind == "lines":
        for line in file:
            sys.stdin.readline()
            os.write(1, line)
    else:
        os.read(0, 1 << 16)
        os.write(1, file.read(56))
        # what is silent is waited for, and that is tried elsewhere: this one gives up soon
        while select.select([0], [], [], 0.5)[0] and (asked := os.read(0, 1 << 16)):
            os.write(1, file.read(8 * ((len(asked) - 8) // 16)))
"""


def scenarios(_: Path) -> list[dict[str, Any]]:
    """Return the tables of every shipped scenario."""
    return _tables(ROOT / "experiments/catalogue/scenarios")


def studies(_: Path) -> list[dict[str, Any]]:
    """Return the tables of the studies of the documentation."""
    return _tables(ROOT / "docs/examples")


def lessons(_: Path) -> list[dict[str, Any]]:
    """Return the tables of the shipped lessons."""
    return _tables(ROOT / "experiments/demo/lessons")


def axes(_: Path) -> list[dict[str, Any]]:
    """Return the tables of an own axis."""
    return [tomllib.loads(AXIS)]


def maps(_: Path) -> list[dict[str, Any]]:
    """Return the tables of a mapping of columns."""
    return [tomllib.loads(MAP)]


def estimators(_: Path) -> list[bytes]:
    """Return estimators as one types them."""
    return [
        b"rpem-forgetting[forgetting=0.99]", b"glr[walk=0.001, jump=0.3]", b"ekf",
        b"rpem-drift[P0=[1.0, 2.0, 3.0], drift=[1e-6, 1e-6, 1e-6]]", b"frozen[identify=['k_T']]",
    ]  # fmt: skip


def records(folder: Path) -> list[bytes]:
    """Return a record."""
    return [(folder / "record.nc").read_bytes()]


def tables(folder: Path) -> list[dict[str, Any]]:
    """Return logs as rows of cells, the names first; one has units, decimal commas and a gap."""
    rows = [line.split(",") for line in (folder / "log.csv").read_text().splitlines()]
    comma = [[cell.replace(".", ",") for cell in row] for row in rows[1:]]
    units = ["t [ms]", "u (N m)", "phi [deg]"]
    return [
        {"separator": ",", "rows": rows},
        {"separator": ";", "rows": [units, *comma[:200], *comma[230:]]},
    ]


def separated(content: Any) -> str:
    """Return a table of text; whatever is no table is written as it is."""
    rows, separator = content.get("rows", []), content.get("separator", ",")
    if not isinstance(separator, str):  # it may be nested deeper than str() can go
        separator = ","
    rows = rows if isinstance(rows, list) else [rows]
    cells = [row if isinstance(row, list) else [row] for row in rows]
    return "\n".join(separator.join(_text(_cell(cell)) for cell in row) for row in cells)


def _text(value: Any) -> str:
    try:
        return str(value)
    except RecursionError:  # a table in a list in a table, and so on
        return "[" * 1000


def _cell(value: Any) -> Any:
    """Return a cell as text can be made of it: of lists in lists, what is inside."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 1e300:
        return "1" + 400 * "0"  # Python refuses to write a number so long
    return _depth(value)[1] if isinstance(value, list) else value


def mats(folder: Path) -> list[bytes]:
    """Return MAT files, compressed and not."""
    found = []
    for compressed in (False, True):
        path = folder / "good.mat"
        savemat(path, _signals(folder), do_compression=compressed)
        found.append(path.read_bytes())
    return found


def hdf5s(folder: Path) -> list[bytes]:
    """Return HDF5 files, one with compressed pieces."""
    found = []
    for options in ({}, {"compression": "gzip", "chunks": (100,)}):
        path = folder / "good.h5"
        with h5py.File(path, "w") as file:
            for name, values in _signals(folder).items():
                file.create_dataset(name, data=values, **options)
        found.append(path.read_bytes())
    return found


def _signals(folder: Path) -> dict[str, Any]:
    names, *rows = [line.split(",") for line in (folder / "log.csv").read_text().splitlines()]
    return dict(zip(names, np.array(rows, float).T, strict=True))


def blocks(_: Path) -> list[bytes]:
    """Return what programs answer over a binary pipe."""
    head = struct.pack("<8sIIII", b"FLEXAXIS", 1, 0x01020304, 1, 0) + b"f_m".ljust(32, b"\0")
    return [head + np.full(SAMPLES, 0.05).tobytes(), head]


def rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of a run."""
    return [{"lines": [row for path in row_files(folder / "run") for row in rows_in(path)]}]


def told(folder: Path) -> list[dict[str, Any]]:
    """Return what a run says of itself."""
    return [json.loads((folder / "run/study.json").read_text("utf-8"))]


def summaries(folder: Path) -> list[dict[str, Any]]:
    """Return the summary of a run."""
    return [json.loads((folder / "run/summary.json").read_text("utf-8"))]


def lines(content: Any) -> str:
    """Return JSON on a line; of a file of lines, each entry on its own."""
    entries = content.get("lines", [content])
    entries = entries if isinstance(entries, list) else [entries]
    return "".join(_json(entry) + "\n" for entry in entries)


def _json(value: Any) -> str:
    match value:
        case dict():
            inner = (f"{json.dumps(key)}: {_json(entry)}" for key, entry in value.items())
            return "{" + ", ".join(inner) + "}"
        case list():
            depth, only = _depth(value)
            inner = _json(only) if depth else ", ".join(map(_json, value))
            return "[" * max(depth, 1) + inner + "]" * max(depth, 1)
    return json.dumps(value, default=str)


def _depth(value: list[Any]) -> tuple[int, Any]:
    """Return how often a list of one is in a list of one, and what is in it: as deep as may be."""
    depth, only = 0, value
    while isinstance(only, list) and len(only) == 1:
        depth, only = depth + 1, only[0]
    return depth, only


def _tables(folder: Path) -> list[dict[str, Any]]:
    return [tomllib.loads(path.read_text("utf-8")) for path in sorted(folder.glob("*.toml"))]


def toml(tables: dict[str, Any]) -> str:
    """Return TOML of any tables, a line for each key, whatever their values are."""
    return "".join(f"{json.dumps(key)} = {_value(value)}\n" for key, value in tables.items())


def _value(value: Any) -> str:
    match value:
        case dict():
            pairs = (f"{json.dumps(key)} = {_value(entry)}" for key, entry in value.items())
            return "{" + ", ".join(pairs) + "}"
        case list():
            depth, only = _depth(value)
            inner = _value(only) if depth else ", ".join(map(_value, value))
            return "[" * max(depth, 1) + inner + "]" * max(depth, 1)
        case float() if not math.isfinite(value):
            return {math.inf: "inf", -math.inf: "-inf"}.get(value, "nan")
        case float() | int() | bool() | str():
            return json.dumps(value).replace("\x7f", "\\u007f")
    return value.isoformat()  # a date or a time
