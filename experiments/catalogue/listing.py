"""The catalogue as lines of a table: scenarios, suites, estimators; by group and by text.

To make the lines takes a second, for all scenarios are read: they are kept in the user's cache,
with a digest of all that they are made of.
"""

from __future__ import annotations

import json
from contextlib import suppress
from functools import cache

from flexaxis.experiments.building.code import digest_of
from flexaxis.experiments.catalogue.names import DRAWN, GROUPS, scenario_names, suite_names, toml_of
from flexaxis.sim.errors import FlexaxisError, unknown
from flexaxis.sim.files import atomic

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
    if group and group not in GROUPS:
        raise FlexaxisError(unknown("group", group, GROUPS))
    return [line for line in lines("scenarios", find=find) if group in ("", line["group"])]


def lines(kind: str, *, find: str = "") -> list[Line]:
    """Return the lines of scenarios, suites or estimators that hold a text in any of their values.

    Suites have name and summary, estimators name, summary and tuned_for.
    """
    wanted = find.lower()
    return [line for line in _kept()[kind] if any(wanted in v.lower() for v in line.values())]


@cache
def _kept() -> dict[str, list[Line]]:
    from flexaxis.estimators.sampling.compiler import user_cache

    path = user_cache() / "flexaxis" / "catalogue.json"
    digest = digest_of("sim", "estimators", "models_mjcf", "experiments.catalogue")
    with suppress(OSError, ValueError, KeyError, TypeError):
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept["digest"] == digest:
            return {kind: kept[kind] for kind in ("scenarios", "suites", "estimators")}
    found = _made()
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path) as part:
            part.write_text(json.dumps(found | {"digest": digest}), encoding="utf-8")
    return found


def _made() -> dict[str, list[Line]]:
    from flexaxis.estimators.registry import REGISTRY
    from flexaxis.experiments.catalogue.find import suite_card

    return {
        "scenarios": [_scenario(name) for name in scenario_names()],
        "suites": [{"name": name, "summary": suite_card(name)} for name in suite_names()],
        "estimators": [
            {"name": e.name, "summary": e.summary, "tuned_for": e.tuning.axis if e.tuning else ""}
            for e in REGISTRY.values()
        ],
    }


@cache
def _scenario(name: str) -> Line:
    from flexaxis.experiments.catalogue import card
    from flexaxis.experiments.catalogue.find import SPREAD, find_scenario

    if name.endswith(DRAWN) and toml_of("scenarios", name) is None:
        first = _scenario(name.removesuffix(DRAWN) + "-v1")
        content = f"{first['content']}; {card.in_words_of_spread(SPREAD)}"
        return first | {"name": name, "content": content}
    scenario = find_scenario(name)
    return {
        "name": name,
        "group": scenario.group or "",
        "difficulty": scenario.difficulty or "",
        "content": card.in_a_line(scenario),
        "summary": scenario.card,
    }
