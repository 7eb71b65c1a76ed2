"""When a log began: by what stands in the file, or by its name."""

from __future__ import annotations

import re
from datetime import datetime
from pathlib import Path

HEAD = 4096  # bytes of a text in which a date is looked for
KEYS = ("date", "created", "start", "start_time", "timestamp")  # of attributes and variables

_KEY = re.compile(rf"\W*(?:{'|'.join(KEYS)})\s*[:=]\s*(.+)", re.IGNORECASE)
_EUROPEAN = re.compile(r"(?<![\d.])(0[1-9]|[12]\d|3[01])\.(0[1-9]|1[0-2])\.((?:19|20)\d\d)(?!\d)")
_DATE = re.compile(
    r"(?<!\d)(20\d\d|19\d\d)[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])"
    r"(?:[T _-]?([01]\d|2[0-3])[:hH_.-]?([0-5]\d)(?:[:_.-]?([0-5]\d))?)?(?!\d)"
)


def dated(path: Path) -> tuple[datetime, str] | None:
    """Return when a log began and what says so, "file" or "name"; None if neither does."""
    text = _in_file(path)
    date = found_in(text) if text else None
    if date is not None:
        return date, "file"
    date = found_in(path.stem)
    return None if date is None else (date, "name")


def found_in(text: str) -> datetime | None:
    """Return the first date in a text, such as ``2026-03-01T06:30`` or ``log_20260301_0630``.

    Examples
    --------
    >>> found_in("axis3_20260301_0630.csv")
    datetime.datetime(2026, 3, 1, 6, 30)
    >>> found_in("Lauf 01.03.2026")
    datetime.datetime(2026, 3, 1, 0, 0)
    >>> found_in("run 12345678") is None
    True
    """
    for match in _DATE.finditer(_EUROPEAN.sub(r"\3-\2-\1", text)):
        year, month, day, *clock = (int(part or 0) for part in match.groups())
        try:
            return datetime(year, month, day, clock[0], clock[1], clock[2])
        except ValueError:  # such as the 31st of February
            continue
    return None


def _in_file(path: Path) -> str | None:
    """Return the text in a log that says when it began."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if b"\x89HDF\r\n\x1a\n" in head[:8] + head[512:520]:
        return _attribute(path)
    if head.startswith(b"MATLAB"):
        return _variable(path)
    if b"\0" in head:
        return None
    lines = head.decode("utf-8", errors="replace").splitlines()
    # any other date in a comment may be that of a calibration or of a program
    told = (_KEY.match(line) for line in lines if line[:1] in "#%;/" and line)
    return next((match[1] for match in told if match), None)


def _attribute(path: Path) -> str | None:
    import h5py

    try:
        with h5py.File(path) as file:
            for key, value in file.attrs.items():
                if key.lower() in KEYS:
                    return value.decode() if isinstance(value, bytes) else str(value)
    except OSError:  # the reader says what is wrong with it
        pass
    return None


def _variable(path: Path) -> str | None:
    from scipy.io import loadmat

    try:
        content = loadmat(path, simplify_cells=True, variable_names=list(KEYS))
    except Exception:  # scipy raises whatever broken bytes lead to; the reader says it
        return None
    return next((v for k, v in content.items() if k in KEYS and isinstance(v, str)), None)
