"""Problems of a log, said on the standard error by commands that read it and make no page of it."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from pathlib import Path

from flexaxis.experiments.logs.doubts.doubt import Doubt


def say_problems(path: Path, checks: Sequence[Doubt], *, met: Collection[str] = ()) -> None:
    """Print a line for each problem.

    Parameters
    ----------
    path : Path
        Of the log.
    checks : sequence of Doubt
    met : collection of str
        Remedies that the command takes by itself, such as ``highpass``.
    """
    for check in checks:
        if check.verdict == "problem" and not set(met) & set(check.remedy):
            advice = f". Type: {check.command}" if check.command else ""
            print(f"✗ {path}: {check.name}: {check.text}{advice}", file=sys.stderr)
