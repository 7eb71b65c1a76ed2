"""Compute the hashes that identify a scenario's content, random numbers and records."""

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
"""Values of the scenario key `streams`, which selects the key of the random numbers.

With "plant", the random numbers depend only on the part of the scenario that affects the plant and
the sensors. With "content", the random numbers depend on the whole content of the scenario.
"""

_WORDS = frozenset({"name", "card", "group", "difficulty", "preset"})
# Keys that do not affect the simulated axis, because they concern only estimation and scoring.
_NOT_SEEN = _WORDS | {"identify", "start", "known", "output", "burn_in", "streams"}


def _a_key(streams: str) -> str:
    if streams in (PLANT, CONTENT) or re.fullmatch("[0-9a-f]{64}", streams):
        return streams
    raise ValueError(
        f'must be "{PLANT}", "{CONTENT}", or the `key` of another scenario (64 hex digits), '
        f"not {streams!r}"
    )


Streams = Annotated[str, AfterValidator(_a_key)]


def content_hash(resolved: Mapping[str, Any]) -> str:
    """Return the SHA-256 (64 hex digits) of a resolved scenario without its descriptive keys.

    The hash excludes `streams`, `period` and `model` if their values are "content", 5 ms and the
    paper's axis, because old scenarios do not have these keys. The hash includes the digest of the
    MJCF if this digest differs from the published digest.
    """
    without = _WORDS | ({"streams"} if resolved["streams"] == CONTENT else set())
    return _digest({k: v for k, v in _told_apart(resolved).items() if k not in without})


def stream_key(resolved: Mapping[str, Any]) -> str:
    """Return the key of the random streams of a resolved scenario (64 hex digits)."""
    match resolved["streams"]:
        case "plant":
            return _digest(_seen(resolved))
        case "content":
            return content_hash(resolved)
        case key:
            return str(key)


def record_hash(resolved: Mapping[str, Any]) -> str:
    """Return the SHA-256 (64 hex digits) of everything that determines a record, except the seed.

    Two scenarios have the same record hash if their random streams have the same key and the
    scenarios differ only in keys that concern estimation and scoring.
    """
    return _digest(_seen(resolved) | {"key": stream_key(resolved)})


def _seen(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a scenario that affect the plant and the sensors."""
    return {key: value for key, value in _told_apart(resolved).items() if key not in _NOT_SEEN}


def _told_apart(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a resolved scenario on which its hashes may depend.

    The result does not contain default values of `period` and `model`. If the MJCF differs from the
    published file, the result contains the digest of the MJCF.
    """
    usual, model = {"period": PERIOD, "model": DEFAULT}, resolved["model"]
    content = {key: value for key, value in resolved.items() if usual.get(key) != value}
    digest = model_digest(model)
    return content if SHIPPED.get(model) == digest else content | {"mjcf": digest}


def _digest(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return sha256(text.encode()).hexdigest()
