"""Logs in bags of ROS 1 and 2, and in MCAP: numbers of all messages, by topic."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.log import WIDEST, Array, Log

Samples = dict[str, list[float]]


def open_file(path: Path) -> Log:
    """Open one; see `reader.open_log`.

    Columns are ``topic.field``, arrays ``topic.field[i]``; where a message names its entries, as
    JointState does, ``topic.position[joint_1]``. ``topic.stamp`` is the time of the measurement
    from the header of a message, ``topic.arrival`` that of its arrival in the bag [s].
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise LogError(
            f"{path}: this is a bag of ROS, and rosbags is not installed: pip install "
            "'flexaxis[ros]'"
        ) from error
    try:
        store = get_typestore(Stores.ROS2_HUMBLE)
        with AnyReader([path], default_typestore=store) as reader:
            found = _gathered(reader)
    except Exception as error:  # of the reader, its storage and its decompression
        raise LogError(f"{path}: no bag of ROS, or a broken one ({error})") from error
    columns = {
        f"{topic}.{name}": np.asarray(values, float)
        for topic, samples in found.items()
        for name, values in samples.items()
    }
    clock = {
        f"{topic}.{name}": f"{topic}.{'stamp' if 'stamp' in samples else 'arrival'}"
        for topic, samples in found.items()
        for name in samples
    }

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        return {name: columns[name] for name in names}

    return Log(path.name, tuple(columns), read, dict.fromkeys(clock.values(), "s"), clock)


def _gathered(reader: Any) -> dict[str, Samples]:
    """Return the numbers of all messages by topic and name, NaN where a message has none."""
    found: dict[str, Samples] = {}
    first: int | None = None  # of all topics, so that they share a clock
    start = reader.start_time
    for connection, arrival, raw in reader.messages():
        message = reader.deserialize(raw, connection.msgtype)
        topic = connection.topic.strip("/")
        samples = found.setdefault(topic, {})
        row = {"arrival": 1e-9 * (arrival - start)}
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        if stamp is not None:
            seconds = int(getattr(stamp, "sec", getattr(stamp, "secs", 0)))
            parts = int(getattr(stamp, "nanosec", getattr(stamp, "nsecs", 0)))
            nanoseconds = seconds * 10**9 + parts
            # doubles have a quarter of a microsecond of resolution for stamps of today
            first = nanoseconds if first is None else first
            row["stamp"] = 1e-9 * (nanoseconds - first)
        row |= dict(_numbers(message, ""))
        before = len(samples["arrival"]) if samples else 0
        for name in row.keys() - samples.keys():
            samples[name] = [np.nan] * before
        for name, values in samples.items():
            values.append(row.get(name, np.nan))
    return found


def _numbers(message: Any, before: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a message and of those within it."""
    labels = getattr(message, "name", None)
    fields = getattr(message, "__dataclass_fields__", {})
    for name in fields:
        value = getattr(message, name)
        if name == "header" or name.startswith("__"):
            continue
        if isinstance(value, bool | int | float | np.number):
            yield before + name, float(value)
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(value, f"{before}{name}.")
        elif isinstance(value, np.ndarray | list) and 0 < len(value) <= WIDEST:
            array = np.asarray(value)
            if array.dtype.kind in "fiub" and array.ndim == 1:
                named = isinstance(labels, list) and len(labels) == len(array)
                for j, entry in enumerate(array):
                    yield f"{before}{name}[{labels[j] if named else j}]", float(entry)  # type: ignore[index]
