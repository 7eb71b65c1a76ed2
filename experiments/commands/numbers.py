"""Numbers that are typed: finite, and none so large that it can only be a slip."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator

from flexaxis.experiments.running.seeds import END

SEED = END - 1


def at_most(most: float, kind: type[int] | type[float] = int) -> Callable[[str], float]:
    """Return what reads the number of an option, for its `type`, up to some size.

    Examples
    --------
    >>> at_most(3660)("60")
    60
    """

    def read(text: str) -> float:
        value = kind(text)
        if not abs(value) <= most:  # not finite, or too large
            raise argparse.ArgumentTypeError(f"{text[:40]!r}: give at most {most:,}")
        return value

    read.__name__ = kind.__name__  # by which argparse calls what is no number
    return read


def too_large(parser: argparse.ArgumentParser, args: argparse.Namespace) -> Iterator[str]:
    """Yield what is wrong with the numbers that have no limit of their own."""
    for action in parser._actions:
        given = getattr(args, action.dest, None)
        for value in given if isinstance(given, list) else [given]:
            if isinstance(value, int | float) and action.type in (int, float):
                from flexaxis.sim.config import LARGEST  # takes a tenth of a second

                option = action.option_strings[-1] if action.option_strings else action.metavar
                if not math.isfinite(value):
                    yield f"{option} {value}: give a finite number"
                elif abs(value) > LARGEST:
                    yield f"{option} {str(value)[:40]}: give at most {LARGEST:g}"
