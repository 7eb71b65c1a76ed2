"""How a value is written in a cell of a table, on a page and in the terminal."""

from __future__ import annotations

from collections.abc import Sequence


def number(value: float | None, digits: int = 3) -> str:
    """Return a number for a table; what is not defined is a dash."""
    if value is None:
        return "–"
    # 120 and not 1.2e+02
    return f"{value:.0f}" if 10**digits <= abs(value) < 1e5 else f"{value:.{digits}g}"


def pair(interval: Sequence[float | None] | None) -> str:
    """Return an interval for a table; an end that is not finite is said in words."""
    if interval is None:
        return ""
    return " … ".join("never" if end is None else f"{end:.3g}" for end in interval)


def settled(value: float | None, changed: bool) -> str:
    """Return a settling time for a table; never is said in words."""
    return number(value) if value is not None or not changed else "never"
