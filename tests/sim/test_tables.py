"""What is declared is used: every table of `sim` is in a scenario, and says what it is and does."""

import importlib
import pkgutil
from typing import get_args

import pytest

import flexaxis.sim
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.tables.config import Config, kinds
from flexaxis.sim.tables.controller import ControllerConfig
from flexaxis.sim.tables.excitation import Excitation
from flexaxis.sim.tables.faults import Fault
from flexaxis.sim.tables.feed_forward import AdaptConfig
from flexaxis.sim.tables.nonlinear import Nonlinearity

UNIONS = {**kinds(Fault), **kinds(Excitation)}


def declared():
    """Every table that is declared in a module of `sim`."""
    for module in pkgutil.iter_modules(flexaxis.sim.__path__):
        importlib.import_module(f"flexaxis.sim.{module.name}")
    found, waiting = [], [Config]
    while waiting:
        table = waiting.pop()
        waiting += table.__subclasses__()
        own = table.__module__.startswith("flexaxis.sim.") and table.__name__[0] != "_"
        if own and table not in (Config, Nonlinearity, Scenario):
            found.append(table)
    return sorted(found, key=lambda table: table.__name__)


PARTS = (AdaptConfig,)  # of the table of the controller, which speaks for them


def wrong(table, scenario=Scenario):
    """Yield what is to be done about a table, in a line each."""
    place = f"{table.__name__} ({table.__module__})"
    if not hasattr(table, "in_words"):
        yield f"{place} has no words for the card: give it in_words()"
    if "kind" in table.model_fields:
        if table not in UNIONS.values():
            yield f"{place} can be used by nobody: name it in the union at the end of its module"
        return
    types = [field.annotation for field in scenario.model_fields.values()]
    if table not in types and not any(table in get_args(each) for each in types):
        yield f"{place} can be used by nobody: give Scenario a key of this type (default None)"
    if {"exact", "substeps"} & set(table.model_fields):
        yield f"{place} has keys that are none: annotate `exact` and `substeps` with ClassVar"
    elif not hasattr(table, "exact"):
        yield f"{place} does not say whether the linear model describes it: give it `exact`"
    if not hasattr(table, "build") and not hasattr(table, "stage") and table != ControllerConfig:
        yield f"{place} does nothing: give it build() (of the plant) or stage() (of a signal)"


@pytest.mark.parametrize(
    "table", [t for t in declared() if t not in PARTS], ids=lambda table: table.__name__
)
def test_what_is_declared_is_used(table):
    lines = list(wrong(table))
    assert not lines, "\n".join(lines)
