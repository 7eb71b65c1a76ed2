"""What was done to the axis and what each estimator said; as a table, as CSV, as a lesson."""

from __future__ import annotations

import csv
import io
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isnan
from typing import Any

from flexaxis.experiments.demo.racer import SHOWN
from flexaxis.experiments.demo.tracking import Tracking
from flexaxis.sim.files import toml_text
from flexaxis.sim.timing import PERIOD, sample_index

KEPT = 300
"""Entries that are kept; those before are forgotten."""
ACTS = 5000
"""The same of acts: a slider that is dragged is one entry, and many acts."""
SOON = sample_index(1.0, PERIOD)
"""Samples within which the same slider is dragged on, and its entry replaced."""
LEAD = 8.0
"""Seconds of the axis before the first act that a lesson shows."""
TAIL = 6.0
"""Seconds that it shows at least after the last."""


@dataclass
class HistoryLine:
    """One thing that was done, and what came of it.

    Attributes
    ----------
    at : int
        Sample from which on it acts.
    key : str
        What kind of thing: entries of the same slider share it.
    what : str
        In words.
    racers : tuple of str
        Who raced then.
    tracking : Tracking or None
        How they followed, where the truth changed.
    estimates : list of float
        Of what has changed, one for each racer, as long as it is followed; NaN: it has none.
    found : list of (float, str)
        What each racer itself says has changed, and how long after it [s]; empty if nothing.
    """

    at: int
    key: str
    what: str
    racers: tuple[str, ...]
    tracking: Tracking | None = None
    estimates: list[float] = field(default_factory=list)
    found: list[list[tuple[float, str]]] = field(default_factory=list)

    @property
    def time(self) -> float:
        """When [s]."""
        return self.at * PERIOD

    @property
    def lags(self) -> list[float | None]:
        """Lag of each racer so far [s]; None where none is defined."""
        known = self.tracking.lags if self.tracking else []
        return [*known] if known else [None] * len(self.racers)

    @property
    def allowed(self) -> tuple[float | None, float | None]:
        """Lags that theory allows: told which parameter has changed, and not told [s]."""
        allowed = self.tracking.allowed if self.tracking else None
        return allowed.lag if allowed else (None, None)

    @property
    def says(self) -> list[str]:
        """What each estimator said of a change: what it found and when, or where it got to."""
        return [self._said(racer) for racer in range(len(self.racers))]

    def _said(self, racer: int) -> str:
        if self.found and self.found[racer]:
            after, what = self.found[racer][0]
            return f"{what} after {after:.2g} s"
        changed = self.tracking.changed if self.tracking else None
        if not self.estimates or changed is None:
            return "nothing"
        value = self.estimates[racer]
        return f"has no {changed}" if isnan(value) else f"{changed} = {value:.3g}"


class History:
    """All that was done to a session.

    Attributes
    ----------
    entries : deque of HistoryLine
        The last ones.
    """

    def __init__(self) -> None:
        self.entries: deque[HistoryLine] = deque(maxlen=KEPT)
        self._acts: deque[tuple[int, dict[str, Any]]] = deque(maxlen=ACTS)
        self._forgotten = 0

    @property
    def last(self) -> HistoryLine | None:
        """The last change of the truth."""
        return next((entry for entry in reversed(self.entries) if entry.tracking), None)

    def add(self, entry: HistoryLine, act: Mapping[str, Any]) -> None:
        """Take down what was done; ``act`` as in the table ``[[act]]`` of a lesson."""
        if dragged(self.entries, entry):
            self.entries.pop()
        self.entries.append(entry)
        self._forgotten += len(self._acts) == ACTS
        self._acts.append((entry.at, dict(act)))

    def csv(self) -> str:
        """Return a row for each entry and racer, with a line of names on top."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(COLUMNS)
        for entry in self.entries:
            writer.writerows(_rows(entry))
        return out.getvalue()

    def lesson(self, *, estimators: Sequence[str], seed: int, now: int) -> str:
        """Return a lesson that does the same again, as TOML.

        Parameters
        ----------
        estimators : sequence of str
            The two that began.
        seed : int
        now : int
            Samples so far.
        """
        first = self._acts[0][0] * PERIOD if self._acts else 0.0
        last = self._acts[-1][0] * PERIOD if self._acts else 0.0
        start = round(max(0.0, first - LEAD), 3)
        content = {
            "title": "What was done, again",
            "seed": seed,
            "start": start,
            "duration": round(max(now * PERIOD, last + TAIL) - start, 3),
            "speed": 2.0,
            "estimators": list(estimators),
            "act": [{"at": round(at * PERIOD, 6), **act} for at, act in self._acts],
        }
        lost = f"# The first {self._forgotten} acts are forgotten: this is not the whole run.\n"
        return HEAD + (lost if self._forgotten else "") + toml_text(content)


HEAD = """\
# What was done to the live axis. Again in the browser: flexaxis demo THIS_FILE
# As a film: flexaxis demo --record lesson.gif --script THIS_FILE
"""

COLUMNS = (
    "time_s", "what", "parameter", "before", "after", "estimator", "lag_s", "estimate",
    "found_after_s", "found", "lag_bound_s", "lag_bound_single_s",
)  # fmt: skip


def dragged(entries: Sequence[HistoryLine] | deque[HistoryLine], entry: HistoryLine) -> bool:
    """Return whether an entry only goes on with the last one."""
    return bool(entries) and entries[-1].key == entry.key and entry.at - entries[-1].at < SOON


def _rows(entry: HistoryLine) -> Iterable[list[Any]]:
    tracking = entry.tracking
    changed = tracking.changed if tracking else None
    column = SHOWN.index(changed) if changed else 0
    single, unknown = entry.allowed
    for racer, name in enumerate(entry.racers):
        found = entry.found[racer][0] if entry.found and entry.found[racer] else None
        yield [
            f"{entry.time:.3f}",
            entry.what,
            changed or "",
            _number(tracking.before[column] if tracking and changed else None),
            _number(tracking.after[column] if tracking and changed else None),
            name,
            _number(entry.lags[racer]),
            _number(entry.estimates[racer] if changed and entry.estimates else None),
            _number(found[0] if found else None),
            found[1] if found else "",
            _number(unknown),
            _number(single),
        ]


def _number(value: float | None) -> str:
    return "" if value is None or isnan(value) else f"{value:.6g}"
