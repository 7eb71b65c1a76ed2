"""The rules of `flexaxis check`, judged from outside: each estimator in a process of its own."""

from __future__ import annotations

from contextlib import ExitStack
from typing import Any

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.board.cage import Cage
from flexaxis.experiments.board.errors import EntryError
from flexaxis.experiments.building.specs import Spec
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.conformance.check import DURATION, RuleResult
from flexaxis.experiments.conformance.requirements import RULES
from flexaxis.experiments.conformance.subject import Subject
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.sim.scenario import Scenario

INSIDE = ("prints nothing", "keeps no reference", "run_batch equals run")
"""Rules on what only the process itself could say."""


class Shut(Subject):
    """A subject whose estimators run in a cage, one at a time, each in a process of its own."""

    def __init__(self, cage: Cage, text: str, scenario: Scenario, record: Any) -> None:
        self._cage, self._now = cage, ExitStack()
        super().__init__(Spec(text, _nothing, {}), scenario, record)

    def make(self) -> Any:
        """Return a fresh estimator; the one before has ended."""
        self._now.close()
        return self._now.enter_context(self._cage.case(self.spec.text, self.scenario))

    def close(self) -> None:
        """End the last one."""
        self._now.close()


def _nothing() -> Any:
    raise AssertionError("it is made elsewhere")


def rules(
    cage: Cage, text: str, base: Scenario, store: RecordCache | None = None
) -> list[RuleResult]:
    """Return what the rules say of an estimator.

    Parameters
    ----------
    cage : Cage
    text : str
    base : Scenario
        One that it reads.
    store : RecordCache, optional
    """
    name = "fm_step-v1" if base.output == "speed" else "encoder_fm_step-v1"
    scenario = find_scenario(name).override({"name": "check", "duration": DURATION})
    record = records(scenario, [0], store)[0][0]
    subject = Shut(cage, text, scenario, record)
    try:
        return [_result(rule, subject) for rule in RULES if rule.name not in INSIDE]
    finally:
        subject.close()


def _result(rule: Any, subject: Shut) -> RuleResult:
    try:
        holds, seen = rule.look(subject)
    except (EstimatorError, EntryError) as error:
        return RuleResult(rule.name, False, str(error), rule.reason, rule.hint, True)
    return RuleResult(rule.name, holds, seen, rule.reason, rule.hint)
