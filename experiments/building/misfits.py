"""Which of some scenarios the estimators can read; the others are left out, with a reason."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from flexaxis.estimators.errors import EstimatorError
from flexaxis.experiments.building.offering import Misfit
from flexaxis.experiments.building.ready import check_made
from flexaxis.experiments.building.specs import parse
from flexaxis.sim.scenario import Scenario


def readable(
    scenarios: Sequence[Scenario], estimators: Iterable[str]
) -> tuple[list[Scenario], dict[str, str]]:
    """Return the scenarios that all estimators can read, and of the others the reason, by name.

    Where they can read none together, all are returned, and whoever runs them is told why they
    cannot be run: there is nothing to leave out.

    Parameters
    ----------
    scenarios : sequence of Scenario
    estimators : iterable of str
        Whatever they name is made on the way.
    """
    specs = [parse(text) for text in dict.fromkeys(estimators)]
    left: dict[str, str] = {}
    for scenario in scenarios:
        for spec in specs:
            try:
                check_made(spec, scenario)
            except Misfit as error:
                left.setdefault(scenario.name, str(error))
            except EstimatorError:  # of another kind: told where it is to be run
                continue
    kept = [scenario for scenario in scenarios if scenario.name not in left]
    return (kept, left) if kept else (list(scenarios), {})
