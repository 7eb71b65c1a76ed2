"""A small board for tests, entries on it, and what its cheaters have to know.

What needs bubblewrap is skipped where that is missing. Not so for a release, FLEXAXIS_RELEASE=1:
there it fails, and each cheater is tried on ten draws instead of one.
"""

import hashlib
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from flexaxis.experiments.board.entry import About
from flexaxis.experiments.board.ranking import Board
from flexaxis.experiments.board.submission import submit
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.cache import default_cache, records
from flexaxis.experiments.running.engine import Means
from flexaxis.experiments.scoring.parameter_names import theta_over_time

RELEASE = bool(os.environ.get("FLEXAXIS_RELEASE"))
TOKENS = [f"{number:016d}" for number in range(1, 11 if RELEASE else 2)]
confined = pytest.mark.skipif(
    not RELEASE and shutil.which("bwrap") is None, reason="bubblewrap (bwrap) is not installed"
)
CHEATS = Path(__file__).parent / "cheats"
SEEDS = tuple(range(1000, 1005))
SMALL = Board("small", (find_scenario("fm_step-v1"),), SEEDS)
WIDE = Board("wide", tuple(map(find_scenario, ("fm_step-v1", "kt_step-v1", "load-v1"))), SEEDS)
MEANS = Means(store=default_cache())
ABOUT = {
    "name": "mine",
    "version": "1",
    "licence": "MIT",
    "contact": "me@example.org",
    "description": "a filter that is in a test",
    "install": "pip install nothing",
    "tuned_on": "none",
}
HONEST = """
from flexaxis.estimators.registry import REGISTRY

class Honest:
    def __init__(self, nominal, period, *, identify=("k_T", "1/J_a", "f_m"), output="speed"):
        self._filter = REGISTRY["rpem-forgetting"].factory(
            nominal, period, identify=identify, output=output, forgetting=0.99
        )
        self.names, self.output, self.step, self.run = (
            tuple(identify), output, self._filter.step, self._filter.run
        )
"""


def about(**changes):
    return About(**(ABOUT | changes))


def entered(folder, estimator, board=SMALL, **changes):
    """An entry on a small board."""
    return submit(str(estimator), folder, about(**changes), board, MEANS)


def known(folder, board=SMALL):
    """Write what the cheater with a memory has to know."""
    truth = {}
    for scenario in board.scenarios:
        for record in records(scenario, board.seeds, default_cache())[0]:
            theta = theta_over_time(scenario, scenario.identify)
            onset = scenario.events()[0].index if scenario.events() else len(theta)
            head = np.round([record.torque[:8], getattr(record, scenario.output)[:8]], 9)
            key = hashlib.sha256(head.tobytes()).hexdigest()[:16]
            truth[key] = (onset, theta[0].tolist(), theta[-1].tolist())
    (folder / "known.py").write_text(f"TRUTH = {truth!r}\n")
