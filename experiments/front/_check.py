"""What there is, scenarios and estimators, and whether an estimator keeps the rules: `check`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from flexaxis._given import spec_of
from flexaxis._table import Names, ShownTable
from flexaxis.experiments.check import check as rules
from flexaxis.experiments.running.cache import default_cache


def scenarios(*, group: str = "", find: str = "") -> Names:
    """Return the names of the catalogue's scenarios; they show themselves as a table.

    Parameters
    ----------
    group : str, optional
        Only those of a group, such as ``"steps"``.
    find : str, optional
        Only those with this text in their name or in what is said of them.

    Returns
    -------
    Names

    Raises
    ------
    FlexaxisError
        If there is no such group.

    Examples
    --------
    >>> import flexaxis as fx
    >>> tuple(fx.scenarios(group="nominal"))
    ('n2_nominal-v1', 'paper_nominal-v1')
    """
    from flexaxis.experiments.catalogue.names import scenario_lines

    return Names.of(scenario_lines(group=group, find=find), ("name", "difficulty", "content"))


def estimators(*, find: str = "") -> Names:
    """Return the names of the registered estimators; they show themselves as a table.

    Parameters
    ----------
    find : str, optional
        Only those with this text in their name or summary.
    """
    from flexaxis.experiments.catalogue.names import lines

    return Names.of(lines("estimators", find=find), ("name", "summary"))


_WORDS = {True: "holds", False: "BROKEN", None: "not applicable"}


def check(estimator: str | Callable[..., Any]) -> ShownTable:
    """Look whether an estimator keeps the rules: no look-ahead, `step` equals `run`, and so on.

    Parameters
    ----------
    estimator : str or class
        As for `benchmark`.

    Returns
    -------
    ShownTable
        A line a rule: ``rule, result, seen``, and with `to_dataframe` also ``holds, reason, hint``.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If it cannot be made at all.
    """
    found = rules.check(spec_of(estimator), store=default_cache())
    lines = [asdict(each) | {"result": _WORDS[each.holds]} for each in found]
    return ShownTable(lines, ("rule", "result", "seen"))
