"""Fault-injection studies: sweeps over scenarios, faults and estimators, on one machine or many."""

from flexaxis.experiments.study.definition import Study, StudyError, load_study, study_from
from flexaxis.experiments.study.plan import make_plan
from flexaxis.experiments.study.results import Results
from flexaxis.experiments.study.run import run_study

__all__ = [
    "Results",
    "Study",
    "StudyError",
    "load_study",
    "make_plan",
    "run_study",
    "study_from",
]
