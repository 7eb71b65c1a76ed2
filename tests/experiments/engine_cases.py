"""Small scenarios and estimators of a user for the tests of the engine."""

from __future__ import annotations

import json
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pandas as pd

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.runner import Runner
from flexaxis.experiments.running.study import Study
from flexaxis.sim.scenario import Scenario

CODE = """
import os, sys, time
import numpy as np

class Mine:
    output = "speed"
    def __init__(self, nominal, period, *, at=200, identify=("k_T", "1/J_a", "f_m")):
        self.names, self.at, self.k = identify, at, -1
        values = [1 / nominal[n[2:]] if n[:2] == "1/" else nominal[n] for n in identify]
        self.theta = np.array(values)
    def step(self, u, y):
        self.k += 1
        return self.bad() if self.k == self.at else self.theta
    def bad(self):
        return self.theta

class Raises(Mine):
    def bad(self):
        raise KeyError("no such thing")

class Nan(Mine):
    def bad(self):
        return self.theta * np.nan

class Shape(Mine):
    def bad(self):
        return self.theta[:2]

class Exits(Mine):
    def bad(self):
        sys.exit(3)

class Dies(Mine):
    def bad(self):
        os._exit(1)

class Loops(Mine):
    def bad(self):
        while True:
            pass

class Slow(Mine):
    def bad(self):
        time.sleep(0.3)
        return self.theta
"""


def short(name: str = "fm_step-v1") -> Scenario:
    """Return a scenario of 4 s with a fault after 2 s."""
    return find_scenario(name).override({"duration": 4.0, "fault[0].at": 2.0, "burn_in": 0.5})


def small_study(*estimators: str, seeds: int = 2) -> Study:
    """Return a study of two factors of the fault."""
    points = tuple({"fault[0].factor": factor} for factor in (1.2, 1.5))
    return Study("small", (short(),), estimators or ("frozen",), tuple(range(seeds)),
                 ("fault[0].factor",), points)  # fmt: skip


def user_file(folder: Path) -> str:
    """Write the estimators of a user to a file, and return its path."""
    path = folder / "mine.py"
    path.write_text(CODE)
    return str(path)


class Here(Executor):
    """Does at once, in this process, what it is asked for: a worker takes seconds to start."""

    def submit(self, work, /, *args, **options):
        """Return a future that is done."""
        future = Future()
        future.set_result(work(*args, **options))
        return future


def runner_here(folder: Path | None = None, **options) -> Runner:
    """Return a runner without worker processes."""
    return Runner(folder, executor=Here(), **options)


def nested(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return rows as dicts; columns with a dot in their name are tables, NaN is None."""
    rows = []
    for line in frame.to_dict("records"):
        row: dict[str, Any] = {}
        for name, value in line.items():
            table, _, part = str(name).partition(".")
            known = None if not isinstance(value, bool | str) and pd.isna(value) else value
            if part:
                row.setdefault(table, {})[part] = known
            else:
                row[table] = known
        for name, value in row.items():
            if isinstance(value, dict) and name != "cost" and set(value.values()) == {None}:
                row[name] = None
        row["isolation"] = row["isolation"] and json.loads(row["isolation"])
        rows.append(row)
    return rows
