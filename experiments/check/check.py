"""Check an estimator: run every rule on a simulated record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.check.rules import DURATION, RULES, Subject
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.estimators import Spec, build
from flexaxis.experiments.running.user_code import EstimatorCrash, reported


@dataclass(frozen=True)
class RuleResult:
    """What a rule found; `holds` is None where it does not apply, `raised` where code failed."""

    rule: str
    holds: bool | None
    seen: str
    reason: str
    hint: str
    raised: bool = False


def check(
    spec: Spec,
    *,
    store: RecordCache | None = None,
    begun: Callable[[str], object] = lambda name: None,
) -> list[RuleResult]:
    """Return what every rule finds about an estimator; `begun` is called with each rule's name.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If it cannot be built at all.
    """
    subject, results = _subject(spec, store), []
    for each in RULES:
        begun(each.name)
        holds: bool | None = False
        raised = True
        try:
            with reported(spec.text, "on the record of the check"):
                holds, seen = each.look(subject)
                raised = False
        except EstimatorCrash as error:
            seen = "it crashed " + str(error).partition(" crashed ")[2]
        except EstimatorError as error:
            seen = str(error).removeprefix(f"{spec.text}, on the record of the check, ")
        results.append(RuleResult(each.name, holds, seen, each.reason, each.hint, raised))
    return results


def _subject(spec: Spec, store: RecordCache | None) -> Subject:
    problems = []
    for name in ("fm_step-v1", "encoder_fm_step-v1"):  # whichever output it reads
        scenario = find_scenario(name).override({"name": "check", "duration": DURATION})
        try:
            build(spec, scenario)
        except EstimatorError as error:
            problems.append(error)
            continue
        record = records(scenario, [0], store)[0]
        return Subject(spec, scenario, record)
    raise problems[0]
