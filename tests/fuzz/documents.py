"""Good files of every kind that the commands read: what mutations begin with."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

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

MAP = """
time = "t"
torque = "u"
angle = "phi"
torque_is = "smooth"
[unit]
time = "ms"
[scale]
torque = 0.6
"""


def scenarios() -> list[dict[str, Any]]:
    """Return the tables of every shipped scenario."""
    return _tables(ROOT / "experiments/catalogue/scenarios")


def studies() -> list[dict[str, Any]]:
    """Return the tables of the studies of the documentation."""
    return _tables(ROOT / "docs/examples")


def lessons() -> list[dict[str, Any]]:
    """Return the tables of the shipped lessons."""
    return _tables(ROOT / "experiments/demo/lessons")


def axes() -> list[dict[str, Any]]:
    """Return the tables of an own axis."""
    return [tomllib.loads(AXIS)]


def maps() -> list[dict[str, Any]]:
    """Return the tables of a mapping of columns."""
    return [tomllib.loads(MAP)]


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
        case [only]:  # as deep as it may be
            depth = 1
            while isinstance(only, list) and len(only) == 1:
                depth, only = depth + 1, only[0]
            return "[" * depth + _value(only) + "]" * depth
        case list():
            return "[" + ", ".join(map(_value, value)) + "]"
        case float() if not math.isfinite(value):
            return {math.inf: "inf", -math.inf: "-inf"}.get(value, "nan")
        case float() | int() | bool() | str():
            return json.dumps(value).replace("\x7f", "\\u007f")
    return value.isoformat()  # a date or a time
