"""Logs in parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading.csv_layout import names_and_units
from flexaxis.experiments.logs.reading.log import LONGEST, Array, Log


def open_file(path: Path) -> Log:
    """Open one; see `reader.open_log`."""
    try:
        from pyarrow import ArrowException, parquet, types
    except ImportError as error:
        raise LogError(
            f"{path}: this is parquet, and pyarrow is not installed: pip install "
            "pyarrow, or save the log as CSV"
        ) from error
    try:
        told = parquet.read_metadata(path)  # the footer: how much there is, before it is read
        schema = told.schema.to_arrow_schema()
    except (ArrowException, OSError) as error:
        raise LogError(f"{path}: no parquet file, or a broken one ({error})") from error
    if told.num_rows > LONGEST:
        raise LogError(
            f"{path} says that it holds {told.num_rows} rows; no more than {LONGEST} can be read, "
            "so take a piece of it"
        )
    fields = [
        f.name
        for f in schema
        if types.is_floating(f.type) or types.is_integer(f.type) or types.is_boolean(f.type)
    ]
    names, units = names_and_units(fields)
    place = dict(zip(names, fields, strict=True))

    def read(names: Sequence[str], *, strict: bool = True) -> dict[str, Array]:
        try:
            table = parquet.read_table(path, columns=[place[name] for name in names])
        except (ArrowException, OSError) as error:
            raise LogError(f"{path}: broken parquet ({error})") from error
        return {name: np.asarray(table[place[name]].to_numpy(), float) for name in names}

    return Log(path.name, tuple(names), read, units)
