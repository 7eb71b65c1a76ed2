"""When a log began: by what stands in the file, by its name, or by that of its folder."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.reading import hdf5_file, mat_file

HEAD = 4096  # bytes of a text in which a date is looked for
KEYS = ("date", "datum", "created", "start", "start_time", "timestamp")  # attributes, variables
CENTURY = (datetime(2000, 1, 1), datetime(2100, 1, 1))  # in which a number is a time

_KEY = re.compile(rf"\W*(?:{'|'.join(KEYS)})\s*[:=]\s*(.+)", re.IGNORECASE)
_DAY, _MONTH, _YEAR = r"(0[1-9]|[12]\d|3[01])", r"(0[1-9]|1[0-2])", r"((?:19|20)\d\d)"
_EUROPEAN = re.compile(rf"(?<![\d.]){_DAY}\.{_MONTH}\.{_YEAR}(?!\d)")
_SLASHES = re.compile(rf"(?<![\d/])(\d\d?)/(\d\d?)/{_YEAR}(?![\d/])")
_NAMES = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAME, _TIME = rf"({'|'.join(_NAMES)})[a-z]*\.?", r"(?:(\d\d:\d\d(?::\d\d)?)\s+)?"
_AMERICAN = re.compile(rf"\b{_NAME}\s+(\d\d?),?\s+{_TIME}{_YEAR}\b", re.IGNORECASE)
_BRITISH = re.compile(rf"\b(\d\d?)[ -]{_NAME},?[ -]{_YEAR}\b", re.IGNORECASE)
_CLOCK = (
    r"(?:[T _-]?([01]\d|2[0-3])[:hH_.-]?([0-5]\d)(?:[:_.-]?([0-5]\d))?(?:\.\d+)?"
    r"(?:\s*([AaPp])[Mm]\b)?)?(?!\d)"
)
_SEPARATED = re.compile(rf"(?<!\d){_YEAR}(?P<by>[-_./]){_MONTH}(?P=by){_DAY}{_CLOCK}")
_COMPACT = re.compile(rf"(?<!\d){_YEAR}(?P<by>){_MONTH}{_DAY}{_CLOCK}")


def dated(path: Path, texts: Sequence[str] | None = None) -> tuple[datetime, str] | None:
    """Return when a log began and what says so; None if nothing does.

    That is "file", "name", or "folder" for one whose name is a date. What stands in the file is
    read, unless its `texts_in` are given.
    """
    for text in texts_in(path) if texts is None else texts:
        date = found_in(text) or _by_number(text)
        if date is not None:
            return date, "file"
    for name, source in ((path.stem, "name"), (path.absolute().parent.name, "folder")):
        date = found_in(name)
        if date is not None:
            return date, source
    return None


def unclear(path: Path, texts: Sequence[str] | None = None) -> str | None:
    """Return a date in a log or its name that may be one of two days, such as ``02/05/2026``."""
    for text in (*(texts_in(path) if texts is None else texts), path.stem):
        found = _of_two(text)
        if found is not None:
            return found
    return None


def texts_in(path: Path) -> list[str]:
    """Return the texts in a log that say when it began, or may: by its content, not its name.

    It takes a process for some formats: ask once, and hand them to `dated` and `unclear`.
    """
    texts = [t.encode(errors="replace").decode() for t in _in_file(path)]  # to be kept in a row
    return [t for t in texts if found_in(t) or _by_number(t) or _of_two(t)]


def found_in(text: str) -> datetime | None:
    """Return the first date in a text, such as ``2026-03-01T06:30`` or ``log_20260301_0630``.

    One that is written in parts goes before a mere number, which may be that of a machine. Of
    ``02/05/2026`` it cannot be told whether it is in May: it is none.

    Examples
    --------
    >>> found_in("axis3_20260301_0630.csv")
    datetime.datetime(2026, 3, 1, 6, 30)
    >>> found_in("sn20190101_2026-03-01")
    datetime.datetime(2026, 3, 1, 0, 0)
    >>> found_in("Thu Feb  5 06:30:00 2026")
    datetime.datetime(2026, 2, 5, 6, 30)
    >>> found_in("02/05/2026") is None
    True
    """
    text = _AMERICAN.sub(_named, _EUROPEAN.sub(r"\3-\2-\1", _SLASHES.sub(_slashed, text)))
    text = _BRITISH.sub(lambda m: f"{m[3]}-{_number(m[2]):02}-{int(m[1]):02}", text)
    for pattern in (_SEPARATED, _COMPACT):
        for match in pattern.finditer(text):
            year, _, month, day, *clock, half = match.groups()
            hour, minute, second = (int(part or 0) for part in clock)
            if half:
                hour = hour % 12 + 12 * (half in "pP")
            try:
                return datetime(int(year), int(month), int(day), hour, minute, second)
            except ValueError:  # such as the 31st of February
                continue
    return None


def _number(month: str) -> int:
    return _NAMES.index(month[:3].lower()) + 1


def _named(match: re.Match[str]) -> str:
    month, day, clock, year = match.groups()
    return f"{year}-{_number(month):02}-{int(day):02} {clock or ''}"


def _slashed(match: re.Match[str]) -> str:
    """Return a date between slashes in the order of ISO 8601, if only one order makes sense."""
    first, second, year = int(match[1]), int(match[2]), match[3]
    day, month = max(first, second), min(first, second)
    one = first == second or day > 12
    return f"{year}-{month:02}-{day:02}" if one and month <= 12 else match[0]


def _of_two(text: str) -> str | None:
    return next((m[0] for m in _SLASHES.finditer(text) if found_in(m[0]) is None), None)


def _by_number(text: str) -> datetime | None:
    """Return the time of a number of seconds since 1970, or of ms, µs or ns."""
    if not re.fullmatch(r"\s*\d{9,19}(\.\d*)?\s*", text):
        return None
    for unit in (1.0, 1e-3, 1e-6, 1e-9):
        seconds = float(text) * unit
        if seconds < CENTURY[1].replace(tzinfo=UTC).timestamp():
            date = datetime.fromtimestamp(int(seconds), UTC).replace(tzinfo=None)
            return date if date >= CENTURY[0] else None
    return None


def _in_file(path: Path) -> list[str]:
    """Return the texts in a log that may say when it began."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if b"\x89HDF\r\n\x1a\n" in head[:8] + head[512:520]:
        return _texts(hdf5_file.texts_of, path)
    if head.startswith(b"MATLAB"):
        return _texts(mat_file.texts_of, path)
    if b"\0" in head:
        return []
    lines = head.decode("utf-8", errors="replace").splitlines()
    # any other date in a comment may be that of a calibration or of a program
    told = (_KEY.match(line) for line in lines if line[:1] in "#%;/" and line)
    return [match[1] for match in told if match]


def _texts(texts_of: Callable[[Path, Sequence[str]], list[str]], path: Path) -> list[str]:
    try:
        return texts_of(path, KEYS)
    except LogError:  # the reader says what is wrong with it
        return []
