"""What an entry says of itself: who, under which licence, how to run it, tuned on what."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.board.suite import REPORTING
from flexaxis.sim.errors import did_you_mean
from flexaxis.sim.reading import read_toml, shown

_PLAIN = re.compile(r"[A-Za-z0-9_.+-]{1,60}")
_LICENCE = re.compile(r"[A-Za-z0-9.+() -]{2,60}")
_CONTACT = re.compile(r"[^\s@<>]+@[^\s@<>]+\.[^\s@<>]+|https://[^\s<>\"']{4,}")
_SEEDS = re.compile(r"none|[0-9]{1,9}:[0-9]{1,9}(, ?[0-9]{1,9}:[0-9]{1,9})*")

ASKED: Mapping[str, tuple[re.Pattern[str], str]] = {
    "name": (_PLAIN, "letters of ASCII, digits, . + - _ , such as my-tracker"),
    "version": (_PLAIN, "such as 1.0"),
    "licence": (_LICENCE, "an SPDX name, such as MIT or Apache-2.0, or proprietary"),
    "contact": (_CONTACT, "an address of mail, or one that begins with https://"),
    "description": (re.compile(r"(?s).{10,600}"), "a sentence or two, 10 to 600 characters"),
    "install": (re.compile(r".{2,300}"), "the line that installs what it needs"),
    "tuned_on": (_SEEDS, "the seeds that were looked at while tuning, such as 0:100, or none"),
}
"""What is asked, and how it is written."""


@dataclass(frozen=True, kw_only=True)
class About:
    """What an entry says of itself; all of it is the entrant's text.

    Attributes
    ----------
    name, version : str
        Entries of one name are versions of one estimator.
    licence, contact, description : str
    install : str
        The line that installs what the estimator needs besides flexaxis.
    tuned_on : str
        Seeds that were looked at while tuning: ``"0:100"``, or ``"none"``.
    """

    name: str
    version: str
    licence: str
    contact: str
    description: str
    install: str
    tuned_on: str

    @property
    def label(self) -> str:
        """Name and version."""
        return f"{self.name} {self.version}"


def about_from(
    file: Path | None,
    given: Mapping[str, str | None],
    usual: Mapping[str, str] | None = None,
) -> About:
    """Return what a file and options say, the options before the file.

    Parameters
    ----------
    file : Path, optional
        A TOML with keys of `ASKED`.
    given : mapping of str to str or None
    usual : mapping of str to str, optional
        What holds where neither says anything.

    Raises
    ------
    EntryError
        With a line for everything that is missing or wrong.
    """
    table = read_toml(file, EntryError) if file else {}
    unknown = [
        f"{file}: {key}: unknown.{did_you_mean(key, ASKED)}" for key in set(table) - {*ASKED}
    ]
    options = {key: value for key, value in given.items() if value is not None}
    return checked(dict(usual or {}) | table | options, also=unknown)


def checked(table: Mapping[str, Any], *, also: list[str] | None = None) -> About:
    """Return a table as what it says; errors as from `about_from`."""
    problems = [*(also or ()), *(text for key in ASKED if (text := _problem(key, table.get(key))))]
    if problems:
        raise EntryError(*problems)
    return About(**{field.name: str(table[field.name]).strip() for field in fields(About)})


def _problem(key: str, value: Any) -> str:
    option, (pattern, words) = key.replace("_", "-"), ASKED[key]
    how = f'--{option} or {key} = "…" in the file of --about: {words}'
    if value is None:
        return f"{key}: missing; {how}"
    if not isinstance(value, str) or not pattern.fullmatch(value.strip()):
        return f"{key}: {shown(value)} is not what is asked; {how}"
    if any(ord(c) < 32 and c != "\n" for c in value):
        return f"{key}: has characters that control a terminal; {how}"
    if key == "tuned_on" and _reported(value):
        return (
            f"tuned_on: {value} has seeds from {REPORTING[0]} on, which are kept for reporting: an "
            "entry that was tuned on them is not eligible"
        )
    return ""


def _reported(text: str) -> bool:
    """Whether ranges of seeds meet those that are kept for reporting."""
    ranges = [[int(end) for end in each.split(":")] for each in text.split(",") if ":" in each]
    return any(first < REPORTING.stop and last > REPORTING.start for first, last in ranges)
