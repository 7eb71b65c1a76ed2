"""Fixtures for a user's own test suite: the gate and the rules as tests.

pytest finds them once flexaxis is installed. They are slow for unit tests, so tests that use them
run only with `--flexaxis`::

    def test_my_change_is_no_regression(flexaxis_gate):
        flexaxis_gate("my_estimator.py:Mine", base="rpem-forgetting")

    def test_my_estimator_keeps_the_rules(flexaxis_check):
        flexaxis_check("my_estimator.py:Mine")
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from flexaxis.experiments.conformance.check import RuleResult
    from flexaxis.experiments.gate.gate import Comparison

FIXTURES = {"flexaxis_gate", "flexaxis_check"}


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare `--flexaxis`."""
    group = parser.getgroup("flexaxis")
    group.addoption("--flexaxis", action="store_true", help="run the tests that use flexaxis")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip what uses our fixtures, unless it is asked for."""
    if config.getoption("--flexaxis"):
        return
    for item in items:
        if FIXTURES & set(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.skip(reason="needs --flexaxis"))


@pytest.fixture(scope="session")
def flexaxis_gate() -> Callable[..., Comparison]:
    """Return a function that fails the test if a candidate is worse than its base."""
    return gate


@pytest.fixture(scope="session")
def flexaxis_check() -> Callable[[str], list[RuleResult]]:
    """Return a function that fails the test if an estimator breaks a rule."""
    return rules


def gate(
    candidate: str,
    *,
    base: str,
    names: Sequence[str] = ("gate",),
    seeds: int | None = None,
    margins: Mapping[str, float] | None = None,
    strict: bool = False,
    jobs: int = 1,
) -> Comparison:
    """Compare, and fail with the table where the candidate is worse or loses runs.

    Parameters
    ----------
    candidate, base : str
        Texts as for `flexaxis compare`.
    names : sequence of str
        Suites, scenarios, paths.
    seeds : int, optional
        Number of seeds; the suites' by default, of scenarios 32.
    margins : mapping of str to float, optional
        As shares, such as ``{"lag": 0.05}``; 2 % by default.
    strict : bool
        Fail also if undecided.
    jobs : int
        Processes.
    """
    from flexaxis.experiments.catalogue.find import select
    from flexaxis.experiments.gate.gate import ask, compare, default_seeds
    from flexaxis.experiments.gate.report import markdown
    from flexaxis.experiments.running.bench import Bench
    from flexaxis.experiments.running.cache import default_cache
    from flexaxis.experiments.running.engine import Means
    from flexaxis.experiments.running.seeds import parse_seeds
    from flexaxis.experiments.scoring.score_table import MARGINS

    numbers = parse_seeds(str(seeds or default_seeds(names)))
    wanted = {**MARGINS, **(margins or {})}
    question, _ = ask(base, candidate, select(names).scenarios, numbers, wanted)
    with Bench(question.scenarios, means=Means(jobs=jobs, store=default_cache())) as bench:
        found = compare(question, bench)
    if found.status(strict=strict):
        pytest.fail(markdown(found), pytrace=False)
    return found


def rules(estimator: str) -> list[RuleResult]:
    """Check an estimator, and fail with reason and hint of each rule that is broken."""
    from flexaxis.experiments.building.estimator_text import parse
    from flexaxis.experiments.conformance.check import check
    from flexaxis.experiments.running.cache import default_cache

    found = check(parse(estimator), store=default_cache())
    broken = [
        f"{f.rule}: {f.seen}\n  {f.reason}\n  hint: {f.hint}" for f in found if f.holds is False
    ]
    if broken:
        pytest.fail("\n".join([estimator, *broken]), pytrace=False)
    return found
