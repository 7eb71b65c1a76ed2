"""Override scenario keys such as ``fault[0].factor``, and append a suffix to the scenario name."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from flexaxis.sim.errors import ScenarioError, did_you_mean


def set_keys(content: dict[str, Any], changes: Mapping[str, Any], *, source: str) -> None:
    """Set the values of dotted keys in nested dictionaries and lists, in place.

    Raises
    ------
    ScenarioError
        If one or more of the dotted keys do not exist. Each line of the error message contains the
        name `source` and an invalid key.

    Examples
    --------
    >>> content = {"fault": [{"factor": 1.5}]}
    >>> set_keys(content, {"fault[0].factor": 2.0}, source="it")
    >>> content
    {'fault': [{'factor': 2.0}]}
    """
    problems = []
    for key, value in changes.items():
        try:
            steps = re.findall(r"([^.\[\]]+)|\[(\d+)\]", key)
            *path, last = [int(i) if i else word for word, i in steps]
            place: Any = content
            for step in path:
                place = place.setdefault(step, {}) if isinstance(step, str) else place[step]
            place[last] = value
        except (AttributeError, LookupError, TypeError, ValueError):
            hint = did_you_mean(key, _keys(content))
            problems.append(f"{source}: {key}: the key does not exist.{hint}")
    if problems:
        raise ScenarioError(*problems)


def _keys(content: Any, key: str = "") -> list[str]:
    """Return the dotted keys of all values in nested dictionaries and lists."""
    if isinstance(content, dict):
        inner = [_keys(value, f"{key}.{name}" if key else name) for name, value in content.items()]
    elif isinstance(content, list):
        inner = [_keys(value, f"{key}[{i}]") for i, value in enumerate(content)]
    else:
        return [key]
    return [key, *(each for keys in inner for each in keys)]


def suffix(changes: Mapping[str, Any]) -> str:
    """Return the scenario-name suffix that lists all overridden keys and their values.

    Examples
    --------
    >>> suffix({"start": 1.2, "identify": ["k_T", "f_m"]})
    '+start=1.2+identify=["k_T","f_m"]'
    """
    return "".join(f"+{key}={_compact(value)}" for key, value in changes.items())


def _compact(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, default=str).replace(" ", "")
    # the name of a scenario must be a single word and may be used as a file name
    return "".join(c if c.isprintable() and c not in " /\\" else "|" for c in text)
