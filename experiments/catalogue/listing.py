"""The catalogue as lines of a table: scenarios, suites, estimators; by group and by text."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue import card
from flexaxis.experiments.catalogue import find as catalogue
from flexaxis.experiments.catalogue.names import DRAWN, toml_of
from flexaxis.sim.errors import FlexaxisError, unknown

Line = dict[str, str]


def scenario_lines(*, group: str = "", find: str = "") -> list[Line]:
    """Return the scenarios: name, group, difficulty, content, summary.

    Parameters
    ----------
    group : str
        Only those of one group.
    find : str
        Only those with this text anywhere, in either case.

    Raises
    ------
    FlexaxisError
        If there is no such group.
    """
    if group and group not in card.GROUPS:
        raise FlexaxisError(unknown("group", group, card.GROUPS))
    lines = [_scenario(name) for name in catalogue.scenario_names()]
    return _found([line for line in lines if group in ("", line["group"])], find)


def suite_lines(*, find: str = "") -> list[Line]:
    """Return the suites: name, summary; those with some text."""
    lines = [{"name": n, "summary": catalogue.suite_card(n)} for n in catalogue.suite_names()]
    return _found(lines, find)


def estimator_lines(*, find: str = "") -> list[Line]:
    """Return the estimators: name, summary, tuned_for; those with some text."""
    lines = [
        {
            "name": entry.name,
            "summary": entry.summary,
            "tuned_for": entry.tuning.axis if entry.tuning else "",
        }
        for entry in REGISTRY.values()
    ]
    return _found(lines, find)


@cache
def _scenario(name: str) -> Line:
    if name.endswith(DRAWN) and toml_of("scenarios", name) is None:
        first = _scenario(name.removesuffix(DRAWN) + "-v1")
        content = f"{first['content']}; {card.in_words_of_spread(catalogue.SPREAD)}"
        return first | {"name": name, "content": content}
    scenario = catalogue.find_scenario(name)
    return {
        "name": name,
        "group": scenario.group or "",
        "difficulty": scenario.difficulty or "",
        "content": card.in_a_line(scenario),
        "summary": scenario.card,
    }


def _found(lines: Iterable[Line], text: str) -> list[Line]:
    """Return the lines that hold a text in any of their values."""
    wanted = text.lower()
    return [line for line in lines if any(wanted in value.lower() for value in line.values())]
