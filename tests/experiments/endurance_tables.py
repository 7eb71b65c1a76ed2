"""
Print what every estimator is off, in %, a minute after what may happen to an axis in a year.

``python tests/experiments/endurance_tables.py [rpem-forgetting imm …]``

Columns are those of `flexaxis.experiments.conformance.endurance.DISTURBANCES`, in their order; what
`flexaxis check --long` refuses is marked by an asterisk.
"""

import sys
import tempfile
from pathlib import Path

from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.building.specs import parse
from flexaxis.experiments.conformance.check import check
from flexaxis.experiments.conformance.endurance import DISTURBANCES
from flexaxis.experiments.running.cache import RecordCache


def row(name: str, store: RecordCache) -> str:
    """Return the cells of an estimator."""
    found = {f.rule: f for f in check(parse(name), long=True, store=store)}
    cells = []
    for disturbance in DISTURBANCES:
        finding = found[disturbance]
        shown = finding.seen.split(" %")[0] if " %" in finding.seen else finding.seen
        cells.append(shown + ("" if finding.holds else "*"))
    return " ".join(f"{cell:>8}" for cell in cells)


def main() -> None:
    """Print a line for each estimator."""
    for number, disturbance in enumerate(DISTURBANCES, 1):
        print(f"{number:3} {disturbance}")
    print(f"{'':24}", *(f"{n:>8}" for n in range(1, len(DISTURBANCES) + 1)))
    with tempfile.TemporaryDirectory() as folder:
        store = RecordCache(Path(folder))
        for name in sys.argv[1:] or [name for name in REGISTRY if name != "literal-rpem"]:
            print(f"{name:24}", row(name, store), flush=True)


if __name__ == "__main__":
    main()
