"""Provide trajectories of the estimates for figures.

A trajectory contains every tenth sample of a run. Around the first fault, a trajectory contains
every sample, because estimates change fast after a fault.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import nominal_theta, theta_over_time
from flexaxis.experiments.scoring.windows import windows
from flexaxis.sim.scenario import Scenario

Array = NDArray[np.float64]

CURVE_STEP = 10  # number of samples from one stored point of a trajectory to the next
BEFORE, AFTER = 0.1, 1.0  # time before and after a fault in which every sample is kept [s]


def near_fault(scenario: Scenario) -> slice:
    """Return the range of samples around the first scored fault (empty if there is no fault)."""
    first = next(iter(windows(scenario, scenario.identify)), None)
    if first is None:
        return slice(0, 0)
    start = first.start - round(BEFORE / scenario.period)
    return slice(max(0, start), min(scenario.samples, first.start + after(scenario)))


def after(scenario: Scenario) -> int:
    """Return the number of consecutive samples that a trajectory contains from a fault on."""
    return round(AFTER / scenario.period) + 1


def later(drawn: Scenario, written: Scenario) -> int:
    """Return the number of samples by which the random onset delays the first fault of a run."""
    if not (drawn.events() and written.events()):
        return 0
    return drawn.events()[0].index - written.events()[0].index


def shifted(values: Array, late: int) -> Array:
    """Shift a time series (N, …) earlier by `late` samples; the nearest value fills the gap.

    Examples
    --------
    >>> shifted(np.arange(4.0), 1).tolist(), shifted(np.arange(4.0), -1).tolist()
    ([1.0, 2.0, 3.0, 3.0], [0.0, 0.0, 1.0, 2.0])
    """
    if not late:
        return values
    return values[np.clip(np.arange(len(values)) + late, 0, len(values) - 1)]


def estimates(traces: Mapping[int, Any], scenario: Scenario, parameter: str) -> pd.DataFrame:
    """Return a table of a parameter's estimates, divided by the nominal value.

    The table has one row per time [s] and one column per seed. The table contains every sample
    around the first fault. At other times, the table contains every `CURVE_STEP`-th sample.
    """
    times = np.r_[scenario.times[::CURVE_STEP], scenario.times[near_fault(scenario)]]
    runs = {seed: np.r_[trace.curve, trace.near][:, trace.names.index(parameter)]
            for seed, trace in traces.items()}  # fmt: skip
    table = pd.DataFrame(runs, index=times, dtype=float)
    return table[~table.index.duplicated()].sort_index()


def truth(scenario: Scenario, parameter: str) -> pd.Series:
    """Return a parameter's true values, divided by its nominal value and indexed by time [s]."""
    values = theta_over_time(scenario, [parameter]) / nominal_theta(scenario, [parameter])
    return pd.Series(values[:, 0], scenario.times)
