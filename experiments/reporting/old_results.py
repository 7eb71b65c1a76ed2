"""Results as the reports of today take them; goes with these."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis.experiments.running import results as new

Bins = Mapping[str, Sequence[float]]
NAMES = {"base": "scenario", "method": "estimator", "estimator": "setting"}


def axis_kind(values: Sequence[Any]) -> str:
    """Return "number" or "text" for the values of an axis."""
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    return "number" if numbers else "text"


class Results(new.Results):
    """Results under the names of today's reports."""

    def ran(self) -> Results:
        """Return those that have scores."""
        return self

    def values(self) -> dict[str, list[Any]]:
        """Return the values found on each axis."""
        every = {axis: list(self.frame[axis].dropna().unique()) for axis in self.axes}
        return {axis: sorted(found) if axis_kind(found) == "number" else found
                for axis, found in every.items()}  # fmt: skip

    def grouped(
        self, by: Sequence[str], *, bins: Bins | None = None, cases: bool = False
    ) -> Groups:
        """Return the rows that agree in some columns."""
        names = [NAMES.get(name, name) for name in by]
        more = [] if cases else ["parameter", "changed"]
        keys = list(dict.fromkeys([*names, *more]))
        found = [(dict(zip([*by, *more], key.values(), strict=False)), part)
                 for key, part in self.groups(*keys, bins=bins)]  # fmt: skip
        if cases:
            found = [(key, part.drop_duplicates("case")) for key, part in found]
        return Groups([key for key, _ in found], [part for _, part in found], self, list(by), bins)

    def lines(
        self, by: Sequence[str], *, bins: Bins | None = None, scores: Sequence[str] | None = None
    ) -> list[dict[str, Any]]:
        """Return pooled rows with the keys of `by`."""
        names = [NAMES.get(name, name) for name in by]
        rows = self.pooled(*names, scores=scores, bins=bins)
        return [{old: row[name] for old, name in zip(by, names, strict=True)} | row for row in rows]

    def failed(self) -> list[dict[str, Any]]:
        """Return the cases that failed."""
        return self.failures.to_dict("records")  # type: ignore[return-value]

    @property
    def rows(self) -> Rows:
        """The rows, one at a time."""
        return Rows(self)


@dataclass(frozen=True)
class Groups:
    """Rows of each group."""

    keys: list[dict[str, Any]]
    rows: list[pd.DataFrame]
    results: Results
    by: list[str]
    bins: Bins | None

    def __len__(self) -> int:
        return len(self.keys)

    def columns(self, group: int) -> dict[str, Any]:
        """Return the numbers of a group, and its seconds."""
        return new._Columns(self.rows[group])

    def first(self, number: int) -> Groups:
        """Return only so many of them."""
        return Groups(self.keys[:number], self.rows[:number], self.results, self.by, self.bins)

    def pooled(self, scores: Sequence[str]) -> list[dict[str, Any]]:
        """Return a pooled row a group."""
        return self.results.lines(self.by, bins=self.bins, scores=scores)[: len(self)]


@dataclass(frozen=True)
class Rows:
    """Rows of results, one at a time."""

    results: new.Results
    columns: Sequence[str] = ()

    def __iter__(self) -> Iterator[dict[str, Any]]:
        frame = self.results.frame.astype(object).where(self.results.frame.notna(), None)
        yield from frame[list(self.columns) or frame.columns].to_dict("records")  # type: ignore[misc]


@dataclass(frozen=True)
class Traces:
    """Traces of a folder."""

    folder: Path | None = None

    def find(self, key: str, estimator: str) -> dict[int, Any]:
        """Return the traces of an estimator on a scenario, by seed."""
        if self.folder is None:
            return {}
        return new.Results.load(self.folder, whole=True).traces(key, estimator)
