"""How the data of charts lie in a page: one block, JSON for words and bytes for arrays.

The block is 4 bytes with the length n of the JSON (little endian), n bytes of JSON, then the bytes
of all arrays; deflated, then in base64. In the JSON an array is either a list of numbers, for a
short one, or ``[kind, offset, length, low, step]``, an object ``{"array": …}``:

- ``even``: low + step · i;
- ``i2``: 16-bit integers q, first differences modulo 2^16, low + step · q, and −32768 is a gap;
- ``f4``: 32-bit floats.

The bytes of ``i2`` and ``f4`` are regrouped by their place in the number, all first ones first:
what varies slowly is then deflated to little.
"""

from __future__ import annotations

import base64
import json
import struct
import zlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHORT = 48  # numbers: a list of them is smaller than an array with its description
LEVELS = 65_000  # of 16-bit integers; the rest is for gaps
FINE = 2000  # levels that the middle 90 % of the values must have, or they are kept as floats
ON_GRID = 1e-3  # of its step, by which a value on a grid may be off
LEVEL = 7  # of deflating: the highest takes eight times as long for 2 % less
DIGITS = 6  # significant, of numbers in a list: a screen has 2000 points


def packed(content: Any) -> str:
    """Return plain values, arrays and dataclasses as the text of a page's block of data.

    Parameters
    ----------
    content : object
        Mappings, sequences, dataclasses, arrays, text, numbers. Fields at their default are left
        out, and so are fields that are None.
    """
    heap = _Heap()
    text = json.dumps(heap.plain(content), ensure_ascii=False, separators=(",", ":")).encode()
    block = struct.pack("<I", len(text)) + text + b"".join(heap.parts)
    return base64.b64encode(zlib.compress(block, LEVEL)).decode()


class _Heap:
    """The bytes of arrays, each kept once."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self._size = 0
        self._places: dict[bytes, int] = {}

    def plain(self, value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return self._array(np.asarray(value, dtype=float))
        if is_dataclass(value) and not isinstance(value, type):
            return {name: self.plain(v) for name, v in _said(value)}
        if isinstance(value, dict):
            return {str(name): self.plain(v) for name, v in value.items()}
        if isinstance(value, (list, tuple)):
            return [self.plain(v) for v in value]
        if isinstance(value, (float, np.floating)):
            return _number(float(value))
        return value.item() if isinstance(value, np.generic) else value

    def _array(self, values: NDArray[np.float64]) -> Any:
        if values.ndim > 1:
            return [self._array(row) for row in values]
        if len(values) <= SHORT:
            return [_number(v) for v in values]
        if np.isfinite(values).all():
            step = (values[-1] - values[0]) / (len(values) - 1)
            even = values[0] + step * np.arange(len(values))
            if np.allclose(values, even, rtol=0, atol=1e-6 * abs(step)):
                return {"array": ["even", 0, len(values), values[0], step]}
        finite = values[np.isfinite(values)]
        low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
        grid = _grid(finite)
        step = grid or (high - low) / LEVELS
        middle = np.subtract(*np.percentile(finite, (95, 5))) if finite.size else 0.0
        # A burst takes the whole range and would leave the rest in a few levels.
        if step == 0 or (middle < FINE * step and not grid):
            return self._kept("f4", values.astype("<f4"), 0.0, 1.0)
        level = np.full(len(values), -32768)
        level[np.isfinite(values)] = np.rint((finite - low) / step) - LEVELS // 2
        return self._kept(
            "i2",
            np.diff(level, prepend=0).astype("<i8").astype("<i2"),
            low + step * (LEVELS // 2),
            step,
        )

    def _kept(self, kind: str, values: NDArray[Any], low: float, step: float) -> dict[str, Any]:
        raw = values.view(np.uint8).reshape(-1, values.itemsize).T.tobytes()
        if raw not in self._places:
            self._places[raw] = self._size
            self.parts.append(raw)
            self._size += len(raw)
        return {"array": [kind, self._places[raw], len(values), float(low), float(step)]}


def _grid(values: NDArray[np.float64]) -> float:
    """Return the step of values that were rounded to one, 0 where there is none.

    Their differences then are small numbers, and deflate to half.
    """
    there = np.unique(values)
    if len(there) < 2:
        return 0.0
    least = float(np.diff(there).min())
    span = float(there[-1] - there[0])
    for step in (least, least / 2, least / 3):
        if not span < LEVELS * step:  # nor where the step is none, of numbers that are next to 0
            continue
        places = (there - there[0]) / step
        if abs(places - np.rint(places)).max() < ON_GRID:
            return step
    return 0.0


def _said(value: Any) -> list[tuple[str, Any]]:
    """Return the fields of a dataclass that say something."""
    pairs = [(each, getattr(value, each.name)) for each in fields(value)]
    return [(each.name, v) for each, v in pairs if v is not None and v is not each.default]


def _number(value: float) -> float | None:
    return float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None
