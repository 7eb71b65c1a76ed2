"""
Print what every estimator is off, in %, a minute after what may happen to an axis in a year.

``python tests/experiments/endurance_tables.py [rpem-forgetting imm …]``

A table in Markdown. Rows are the disturbances of `flexaxis check --long`, then FURTHER ones that it
does not ask for; what is not survived, or not back within the minute, is marked by an asterisk.
"""

import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.estimator_text import parse
from flexaxis.experiments.conformance import endurance
from flexaxis.experiments.conformance.check import check
from flexaxis.experiments.running.cache import RecordCache


def _of_another(y):
    """Return what the sensor of another axis would read: as much motion, and as much noise."""
    return np.random.default_rng(0).permutation(y)


def long_gap(axis: endurance.Axis) -> endurance.Disturbed:
    """Leave a million outputs out, at rest: so long nobody moves an axis without its sensor."""
    given = endurance.drive_off(axis, seconds=1e6 * axis.period)
    valid = given.valid.copy()
    still = (given.u == 0.0) & (given.y == 0.0)
    valid[still] = False
    return endurance.Disturbed(given.u, given.y, valid, given.rest)


FURTHER = {
    "y missing for 1e6 samples": long_gap,
    "sensor reads noise for 20 s": partial(endurance.sensor_fails, how=_of_another),
    "sensor of the wrong sign for 20 s": partial(endurance.sensor_fails, how=np.negative),
    "sensor 10 % too large for 20 s": partial(endurance.sensor_fails, how=lambda y: 1.1 * y),
}


def column(name: str, store: RecordCache) -> list[str]:
    """Return the cells of an estimator."""
    found = {f.rule: f for f in check(parse(name), long=True, store=store)}
    cells = []
    for disturbance in endurance.DISTURBANCES:
        seen = found[disturbance].seen
        shown = seen.split(" %")[0] if " %" in seen else seen
        cells.append(shown + ("" if found[disturbance].holds else "\\*"))
    return cells


def main() -> None:
    """Print a column for each estimator, a row for each disturbance."""
    names = sys.argv[1:] or [name for name in REGISTRY if name != "literal-rpem"]
    asked = len(endurance.DISTURBANCES)
    endurance.DISTURBANCES = {**endurance.DISTURBANCES, **FURTHER}
    with tempfile.TemporaryDirectory() as folder:
        store = RecordCache(Path(folder))
        columns = []
        for name in names:
            columns.append(column(name, store))
            print(name, *columns[-1], file=sys.stderr, flush=True)
    print("| | " + " | ".join(f"`{name}`" for name in names) + " |")
    print("|---" * (len(names) + 1) + "|")
    for i, disturbance in enumerate(endurance.DISTURBANCES):
        shown = disturbance if i < asked else f"*{disturbance}*"
        print(f"| {shown} | " + " | ".join(cells[i] for cells in columns) + " |")


if __name__ == "__main__":
    main()
