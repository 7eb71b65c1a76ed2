"""Score fault detection: alarms, delays, and whether the correct parameters are named."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.windows import Window, windows
from flexaxis.sim.scenario import Scenario

ALARMS = {
    "alarms": "", "false_alarms": "", "false_alarms_per_1000_s": "1/(1000 s)", "calm": "s",
    "delay": "s", "faults": "", "missed": "", "isolated": "",
}  # fmt: skip
"""Units of the detection scores, keyed by name."""


def detection(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> dict[str, Any] | None:
    """Score the changes that an estimator reports; return None if `findings` is None.

    Parameters
    ----------
    scenario : Scenario
        Scenario of the record.
    names : sequence of str
        Names of the estimated parameters.
    findings : sequence, optional
        Changes that the estimator reports (findings). Each finding has the attributes ``alarm``
        (sample index of the alarm) and ``parameters`` (names of the parameters that changed).

    Returns
    -------
    dict or None
        ``alarms`` is the number of reported changes. ``false_alarms`` is the number of reported
        changes outside all fault windows. ``calm`` is the total time outside all fault windows [s],
        and ``false_alarms_per_1000_s`` is the rate of false alarms during this time. ``delay`` is
        the time from the start of a fault window to the first reported change in this window [s],
        averaged over all detected faults. ``faults`` is the number of faults in the run. ``missed``
        is the number of fault windows without a reported change. ``isolated`` is the fraction of
        detected faults for which the first report names exactly the parameters that changed.
    """
    if findings is None:
        return None
    firsts = _firsts(scenario, names, findings)
    spans = [window for window, _ in firsts]
    calm = np.ones(scenario.samples, bool)
    for window in spans:
        calm[window.start : window.stop] = False
    seconds = scenario.period * max(1, int(calm.sum()))
    false = sum(not any(w.start <= f.alarm < w.stop for w in spans) for f in findings)
    delays, named = [], []
    for window, first in firsts:
        if first is not None:
            delays.append(scenario.period * (first.alarm - window.start))
            changed = {w.parameter for w in spans if w.start == window.start}
            named.append({physical(name)[0] for name in first.parameters} == changed)
    return {
        "alarms": len(findings),
        "false_alarms": false,
        "false_alarms_per_1000_s": 1000 * false / seconds,
        "calm": seconds,
        "delay": float(np.mean(delays)) if delays else None,
        "faults": len(spans),
        "missed": len(spans) - len(delays),
        "isolated": float(np.mean(named)) if named else None,
    }


def _firsts(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any]
) -> list[tuple[Window, Any]]:
    """Return a pair for each fault: its window, and the first change reported in it (or None)."""
    return [(w, next((f for f in findings if w.start <= f.alarm < w.stop), None))
            for w in windows(scenario, names)]  # fmt: skip


def isolation(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> list[dict[str, Any]] | None:
    """Return the parameters that an estimator names for each fault.

    Parameters
    ----------
    scenario, names, findings : Scenario, sequence of str, sequence or None
        The same arguments as those of the function `detection`.

    Returns
    -------
    list of dict, or None
        One dict per fault. ``fault`` is the parameter that changed. ``named`` lists the physical
        parameters that the first report in the fault window names. The list is empty if this report
        names no parameter. ``named`` is None if the estimator misses the fault. The function
        returns None if `findings` is None.
    """
    if findings is None:
        return None
    return [
        {
            "fault": window.parameter,
            "named": None if first is None else [physical(name)[0] for name in first.parameters],
        }
        for window, first in _firsts(scenario, names, findings)
    ]


# Scores: functions of a track and the index of an estimated parameter.


def detection_of(track: Track, i: int) -> dict[str, Any] | None:
    """Return the detection scores, which are the same for all parameters of a run."""
    del i
    return detection(track.scenario, track.names, track.findings)


def isolation_of(track: Track, i: int) -> list[dict[str, Any]] | None:
    """Return the parameters that an estimator names for each fault; the index i has no effect."""
    del i
    return isolation(track.scenario, track.names, track.findings)
