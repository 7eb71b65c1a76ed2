"""Detection: what the findings of an estimator are worth, and what its estimates could tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.scoring.scores import Track
from flexaxis.experiments.scoring.windows import WINDOW, Window, windows
from flexaxis.sim.parameters import meant
from flexaxis.sim.scenario import Scenario

WITHIN = (0.5, 1.0, 2.0, 5.0)
"""Times after a fault [s] within which is asked whether it was found."""

LOOK_BACK = 1.0  # s over which a change of an estimate is taken


@dataclass(frozen=True)
class Detection:
    """What the findings of an estimator are worth in one case.

    Attributes
    ----------
    alarms : int
        All findings.
    false_alarms : int
        Findings outside the windows of all faults.
    false_alarms_per_1000_s : float
        The same over the time outside these windows.
    calm : float
        That time [s].
    delay : float or None
        From a fault to the first finding in its window, mean over those detected [s].
    faults, missed : int
        Faults, and those without a finding in their window.
    isolated : float or None
        Share of the faults detected whose first finding ends up naming what changed, and no more.
    """

    alarms: int
    false_alarms: int
    false_alarms_per_1000_s: float
    calm: float
    delay: float | None
    faults: int
    missed: int
    isolated: float | None


ALARMS = tuple(Detection.__dataclass_fields__)


def detection(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> Detection | None:
    """Score the findings of an estimator; None for one that has none to give.

    Parameters
    ----------
    scenario : Scenario
    names : sequence of str
        Estimated parameters.
    findings : sequence, optional
        Each with ``alarm`` (sample) and ``parameters`` (names).
    """
    if findings is None:
        return None
    firsts = _firsts(scenario, names, findings)
    spans = [window for window, _ in firsts]
    calm = scenario.period * max(1, int(_calm(scenario, spans).sum()))
    false = sum(not any(w.start <= f.alarm < w.stop for w in spans) for f in findings)
    delays, named = [], []
    for window, first in firsts:
        if first is not None:
            delays.append(scenario.period * (first.alarm - window.start))
            changed = {w.parameter for w in spans if w.start == window.start}
            named.append({physical(name)[0] for name in first.parameters} == changed)
    return Detection(
        alarms=len(findings),
        false_alarms=false,
        false_alarms_per_1000_s=1000 * false / calm,
        calm=calm,
        delay=float(np.mean(delays)) if delays else None,
        faults=len(spans),
        missed=len(spans) - len(delays),
        isolated=float(np.mean(named)) if named else None,
    )


def _firsts(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any]
) -> list[tuple[Window, Any]]:
    """Return the windows, each with the first finding in it, None where there is none."""
    return [(w, next((f for f in findings if w.start <= f.alarm < w.stop), None))
            for w in windows(scenario, names)]  # fmt: skip


def _calm(scenario: Scenario, spans: Sequence[Window]) -> NDArray[np.bool_]:
    """Return the samples (N,) at which an alarm is a false one: all but the windows."""
    calm = np.ones(scenario.samples, bool)
    for window in spans:
        calm[window.start : window.stop] = False
    return calm


def isolation(
    scenario: Scenario, names: Sequence[str], findings: Sequence[Any] | None
) -> list[dict[str, Any]] | None:
    """Return what each fault was taken for; None for an estimator without findings.

    Returns
    -------
    list of dict
        A dict a fault: ``fault``, the parameter that changed, and ``named``, the physical
        parameters of the first finding in its window: [] for an unmodelled change, None for a
        fault that was missed.
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


def sought(scenario: Scenario, name: str) -> slice | None:
    """Return the window of the first fault in an estimated parameter, also of one of no size.

    A fault with the factor 1 changes nothing: such a run is the twin of one with the fault, on the
    same streams, and its window is where the fault would be. None where no fault names the
    parameter.
    """
    mine = [f for f in scenario.fault if meant(f.parameter) == physical(name)[0]]
    if not mine:
        return None
    start = min(scenario.grid.index(fault.at) for fault in mine)
    later = [event.index for event in scenario.events() if event.index > start]
    return slice(start, min(start + round(WINDOW / scenario.period), *later, scenario.samples))


# What follows are the scores themselves: of a track and the index of an estimated parameter.


def detection_of(track: Track, i: int) -> dict[str, Any] | None:
    """Return what the findings are worth, the same for all parameters of a case."""
    del i
    found = track.once("detection", lambda: detection(track.scenario, track.names, track.findings))
    return None if found is None else asdict(found)


def isolation_of(track: Track, i: int) -> list[dict[str, Any]] | None:
    """Return what each fault was taken for, the same for all parameters of a case."""
    del i
    return track.once("isolation", lambda: isolation(track.scenario, track.names, track.findings))


def find_of(track: Track, i: int) -> dict[str, float | None] | None:
    """Return how soon after the fault, or where its twin would have it, the first finding comes.

    ``after`` is that time [s], None without any, and ``named`` whether it names this parameter and
    no other; None for an estimator without findings, and where no fault names the parameter.
    """
    span = sought(track.scenario, track.names[i])
    if span is None or track.findings is None:
        return None
    first = next((f for f in track.findings if span.start <= f.alarm < span.stop), None)
    if first is None:
        return {"after": None, "named": None}
    named = {physical(name)[0] for name in first.parameters} == {physical(track.names[i])[0]}
    after = track.scenario.period * (first.alarm - span.start)
    return {"after": after, "named": float(named)}


def moved_of(track: Track, i: int) -> dict[str, float | None] | None:
    """Return how far an estimate moves within `LOOK_BACK` at most [% of nominal].

    By the times of `WITHIN` after the fault, or where its twin would have it; and ``calm``, in the
    ``watched`` seconds outside all windows and after burn-in. This is what a threshold on the
    estimates would look at. None where there is no fault, nor a twin of one.
    """
    scenario = track.scenario
    if not scenario.fault:
        return None
    back, per_cent = round(LOOK_BACK / scenario.period), 100 / abs(track.nominal[i])
    theta = np.clip(np.nan_to_num(track.theta[:, i]), *(edge[i] for edge in track.box))
    moved = np.zeros(len(theta))
    moved[back:] = per_cent * abs(theta[back:] - theta[:-back])
    calm = _calm(scenario, track.windows) & (scenario.times >= scenario.burn_in + LOOK_BACK)
    found: dict[str, float | None] = dict.fromkeys(map(str, WITHIN))
    if (span := sought(scenario, track.names[i])) is not None:
        ends = (min(span.start + round(x / scenario.period), span.stop) for x in WITHIN)
        found = {str(x): float(moved[span.start : stop].max(initial=0.0))
                 for x, stop in zip(WITHIN, ends, strict=True)}  # fmt: skip
    watched = scenario.period * int(calm.sum())
    return found | {"calm": float(moved[calm].max(initial=0.0)), "watched": watched}
