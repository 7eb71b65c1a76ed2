"""Names and units out of what stands over the columns of a table."""

from __future__ import annotations

import re
from collections.abc import Sequence

# "pos [deg]", "pos (deg)", "pos / deg", "pos in deg"
_UNIT = re.compile(
    r"^\s*(?P<name>.*?)\s*(?:[\[(]\s*(?P<a>[^\])]*?)\s*[\])]|\s/\s(?P<b>\S+)|\sin\s(?P<c>\S+))\s*$"
)


def names_and_units(head: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Return the names of columns, each once, and the units that stand in brackets behind them.

    Examples
    --------
    >>> names_and_units(["t [s]", "phi in deg", "phi in deg", "", "i"])
    (['t', 'phi', 'phi#2', 'column4', 'i'], {'t': 's', 'phi': 'deg', 'phi#2': 'deg'})
    """
    names: list[str] = []
    units: dict[str, str] = {}
    for place, text in enumerate(head, 1):
        found = _UNIT.match(text)
        plain = (found["name"] if found else text).strip() or f"column{place}"
        name, count = plain, 1
        while name in names:
            count += 1
            name = f"{plain}#{count}"
        names.append(name)
        unit = (found["a"] or found["b"] or found["c"]) if found else None
        if unit:
            units[name] = unit
    return names, units
