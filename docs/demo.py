"""Write the table of docs/demo.md anew, what to expect of a fault: `python docs/demo.py`.

It stands between `<!-- table: lags -->` and `<!-- end -->`, and what made it is said below it.
It takes four minutes.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from making import VERSION, table, write

from flexaxis.experiments.demo.session import BUTTONS, DEFAULT_RACERS, DemoSession
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.scoring.windows import WINDOW
from flexaxis.sim.timing import PERIOD, sample_index

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "demo.md"
SEEDS = range(1000, 1020)
BEFORE = 9.0
"""Seconds of the axis before the fault."""


def lags(parameter: str, factor: float) -> Sequence[Sequence[float]]:
    """Return the lags of A and B, and those allowed, told which and not; a row for each seed."""
    rows = []
    for seed in SEEDS:
        session = DemoSession(seed=seed)
        session.advance(sample_index(BEFORE, PERIOD))
        session.do("inject", parameter, factor)
        session.advance(sample_index(WINDOW, PERIOD))
        rows.append(session.changes[-1].lags)
    return rows


def expected() -> str:
    """Return what to expect of each fault that has a button and a lag."""
    below = made()
    names = ("A, the paper's method", "B, recommended")
    lines = []
    for label, (parameter, factor) in BUTTONS.items():
        if parameter == "k_a":  # nobody estimates it
            continue
        values = np.array(lags(parameter, factor))
        mean, longest = values.mean(axis=0), values.max(axis=0)
        racers = [f"{number(mean[i], 2)} ({number(longest[i], 2)})" for i in range(len(names))]
        lines.append((label, *racers, f"{number(mean[2], 2)} – {number(mean[3], 2)}"))
    return table(["fault", *names, "allowed: told which – not told"], lines) + below


def made() -> str:
    """Return the line below the table: what it is, and how it was made."""
    first, second, seeds = *DEFAULT_RACERS, f"seeds {SEEDS[0]} to {SEEDS[-1]}"
    return (
        f"\nLag [s], mean (and the longest), of `{first}` and `{second}`; fault "
        f"after {BEFORE:g} s. `python docs/demo.py`, {VERSION}, {seeds}.\n"
    )


if __name__ == "__main__":
    write(PAGE, {"lags": expected})
