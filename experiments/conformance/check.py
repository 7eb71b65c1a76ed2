"""Check an estimator against the rules on a simulated record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.away import Away, there
from flexaxis.experiments.building.crashes import EstimatorCrash
from flexaxis.experiments.building.estimator_text import Spec, build
from flexaxis.experiments.building.guest import hosted
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.conformance.requirements import RULES, Rule
from flexaxis.experiments.conformance.subject import Subject
from flexaxis.experiments.running.cache import RecordCache, records

DURATION = 12.0  # s, 2400 samples; the fault is at 10 s


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
    begun: Callable[[str], object] = lambda rule: None,
) -> list[RuleResult]:
    """Return what every rule finds about an estimator; `begun` is told each rule before it.

    Raises
    ------
    EstimatorError, EstimatorCrash
        If it cannot be built at all.
    """
    subject = _subject(spec, store)
    found = []
    for rule in RULES:
        begun(rule.name)
        found.append(_result(rule, subject, spec.text))
    return found


def _subject(spec: Spec, store: RecordCache | None) -> Subject | Away:
    problems = []
    for name in ("fm_step-v1", "encoder_fm_step-v1"):  # whichever output it reads
        scenario = find_scenario(name).override({"name": "check", "duration": DURATION})
        try:
            build(spec, scenario)
        except EstimatorError as error:
            problems.append(error)
            continue
        asked = scenario, records(scenario, [0], store)[0][0], store
        if not isinstance(spec.make, Away):
            return Subject(spec, *asked)
        return spec.make(Subject, spec, *asked)
    raise problems[0]


def _result(rule: Rule, subject: Subject | Away, text: str) -> RuleResult:
    try:
        with hosted(text, "on the record of the check"):
            holds, seen = there(rule.look, subject)
    except EstimatorCrash as error:
        seen = str(error).partition(" crashed ")[2]
        return RuleResult(rule.name, False, f"it crashed {seen}", rule.reason, rule.hint, True)
    except EstimatorError as error:
        seen = str(error).removeprefix(f"{text}, on the record of the check, ")
        return RuleResult(rule.name, False, seen, rule.reason, rule.hint, True)
    return RuleResult(rule.name, holds, seen, rule.reason, rule.hint)
