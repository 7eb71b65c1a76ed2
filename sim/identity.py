"""Compute hashes that identify the content, the random numbers and the records of a scenario."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from hashlib import sha256
from typing import Annotated, Any

from pydantic import AfterValidator

from flexaxis.models_mjcf import DEFAULT, SHIPPED, model_digest
from flexaxis.sim.timing import PERIOD

PLANT, CONTENT = "plant", "content"
"""Special values of the scenario key `streams`, which determines the random numbers of a run.

If `streams` is "plant", the random numbers depend only on the part of the scenario that affects the
plant and the sensors. If `streams` is "content", the random numbers depend on the whole content of
the scenario.
"""

_WORDS = frozenset({"name", "card", "group", "difficulty", "preset"})
# Keys that do not affect the simulated axis, because they concern only estimation and scoring.
_NOT_SEEN = _WORDS | {"identify", "start", "known", "output", "burn_in", "streams"}


def _a_key(streams: str) -> str:
    if streams in (PLANT, CONTENT) or re.fullmatch("[0-9a-f]{64}", streams):
        return streams
    raise ValueError(
        f'`streams` must be "{PLANT}", "{CONTENT}", or the `key` of a scenario (64 hex digits), '
        f"not {streams!r}"
    )


Streams = Annotated[str, AfterValidator(_a_key)]


def content_hash(resolved: Mapping[str, Any]) -> str:
    """Return the SHA-256 of all scenario content except name and description (64 hex digits).

    Old scenarios do not have the keys `streams`, `period` and `model`. Therefore the hash excludes
    `streams` if it is "content", `period` if it is 5 ms, and `model` if it is "three_mass". The
    hash includes the digest of the model's MJCF file if this file differs from the published
    version.
    """
    without = _WORDS | ({"streams"} if resolved["streams"] == CONTENT else set())
    return _digest({k: v for k, v in _told_apart(resolved).items() if k not in without})


def stream_key(resolved: Mapping[str, Any]) -> str:
    """Return the key that identifies the random numbers of a scenario (64 hex digits)."""
    match resolved["streams"]:
        case "plant":
            return _digest(_seen(resolved))
        case "content":
            return content_hash(resolved)
        case key:
            return str(key)


def record_hash(resolved: Mapping[str, Any]) -> str:
    """Return the SHA-256 of all settings that determine a record, except the seed (64 hex digits).

    Keys that concern only estimation or scoring do not affect the record hash. The record hash also
    depends on the key that identifies the random numbers.
    """
    return _digest(_seen(resolved) | {"key": stream_key(resolved)})


def _seen(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return only the keys and values of a scenario that affect the plant and the sensors."""
    return {key: value for key, value in _told_apart(resolved).items() if key not in _NOT_SEEN}


def _told_apart(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a scenario that can affect its hashes.

    The dictionary omits each of the keys `period` and `model` if it has its default value. The
    dictionary contains the digest of the model's MJCF file if this file differs from the published
    version.
    """
    usual, model = {"period": PERIOD, "model": DEFAULT}, resolved["model"]
    content = {key: value for key, value in resolved.items() if usual.get(key) != value}
    digest = model_digest(model)
    return content if SHIPPED.get(model) == digest else content | {"mjcf": digest}


def _digest(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return sha256(text.encode()).hexdigest()
