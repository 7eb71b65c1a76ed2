"""Hashes of a scenario: of its content, of its random numbers and of its records."""

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
"""Values of `streams`.

With "plant", the key of the random numbers depends only on the part of the scenario that affects
plant and sensors; with "content", it depends on the whole content.
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

    The keys `streams`, `period` and `model` are left out if their values are "content", 5 ms and
    the paper's axis, because scenarios with these values are older than the keys. The digest of the
    MJCF is included if it differs from the published digest.
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
    """Return the SHA-256 (64 hex digits) of everything that determines a record except the seed.

    Two scenarios have the same record hash if they have the same key of the random streams and
    differ only in keys that concern estimation and scoring.
    """
    return _digest(_seen(resolved) | {"key": stream_key(resolved)})


def _seen(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys and values of a scenario that affect plant and sensors."""
    return {key: value for key, value in _told_apart(resolved).items() if key not in _NOT_SEEN}


def _told_apart(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return a resolved scenario in the form that is hashed.

    The default values of `period` and `model` are left out. If the MJCF differs from the published
    file, its digest is added.
    """
    usual, model = {"period": PERIOD, "model": DEFAULT}, resolved["model"]
    content = {key: value for key, value in resolved.items() if usual.get(key) != value}
    digest = model_digest(model)
    return content if SHIPPED.get(model) == digest else content | {"mjcf": digest}


def _digest(content: Mapping[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return sha256(text.encode()).hexdigest()
