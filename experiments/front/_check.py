"""Whether an estimator keeps the rules that its scores rely on: `check`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from flexaxis._given import spec_of
from flexaxis._table import Table
from flexaxis.experiments.building.guest import limited
from flexaxis.experiments.conformance import check as conformance
from flexaxis.experiments.running.cache import default_cache

_WORDS = {True: "holds", False: "BROKEN", None: "not applicable"}


def check(
    estimator: str | Callable[..., Any], *, long: bool = False, time_limit: float | None = None
) -> Table:
    """Look whether an estimator keeps the rules: no look-ahead, `step` equals `run`, and so on.

    Parameters
    ----------
    estimator : str or class
        As for `benchmark`.
    long : bool
        Whether to run it through what happens to an axis in a year, too.
    time_limit : float, optional
        How long its code may take for one run [s]; 600 by default.

    Returns
    -------
    Table
        A line a rule: ``rule, result, seen``, and with `to_dataframe` also ``holds, reason, hint``.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If it cannot be made at all.
    """
    with limited(time_limit):
        found = conformance.check(spec_of(estimator), long=long, store=default_cache())
    lines = [asdict(each) | {"result": _WORDS[each.holds]} for each in found]
    return Table(lines, ("rule", "result", "seen"))
