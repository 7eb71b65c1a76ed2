"""Dotted keys of a scenario, such as ``fault[0].factor``: setting them, and names made of them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from flexaxis.sim.errors import ScenarioError


def set_key(content: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key in nested content, in place.

    Raises
    ------
    AttributeError, IndexError, KeyError, TypeError, ValueError
        If there is no such place.

    Examples
    --------
    >>> content = {"fault": [{"factor": 1.5}]}
    >>> set_key(content, "fault[0].factor", 2.0)
    >>> content
    {'fault': [{'factor': 2.0}]}
    """
    *path, last = [int(i) if i else word for word, i in re.findall(r"([^.\[\]]+)|\[(\d+)\]", key)]
    place: Any = content
    for step in path:
        place = place.setdefault(step, {}) if isinstance(step, str) else place[step]
    place[last] = value


def set_keys(content: dict[str, Any], changes: Mapping[str, Any], *, source: str) -> None:
    """Set dotted keys in nested content, in place.

    Raises
    ------
    ScenarioError
        If there is no such place; it names source and key.
    """
    for key, value in changes.items():
        try:
            set_key(content, key, value)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError):
            raise ScenarioError(f"{source}: {key}: no such key to override") from None


def suffix(changes: Mapping[str, Any]) -> str:
    """Return what changes of keys add to a name.

    Examples
    --------
    >>> suffix({"start": 1.2, "identify": ["k_T", "f_m"]})
    '+start=1.2+identify=["k_T","f_m"]'
    """
    return "".join(f"+{key}={_compact(value)}" for key, value in changes.items())


def _compact(value: Any) -> str:
    text = (
        value if isinstance(value, str) else json.dumps(value, separators=(",", ":"), default=str)
    )
    shown = "".join(c if c.isprintable() else "|" for c in text)
    return re.sub(r"[\s/\\]", "|", shown)  # a name is one word, and may become a file name
