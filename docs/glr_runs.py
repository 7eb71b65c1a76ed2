"""One estimator on one record, for docs/glr.py: scores, findings, and what it claims."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from glr_cases import Case

from flexaxis.estimators.protocol import run_estimator
from flexaxis.experiments.running.cache import RecordCache, records
from flexaxis.experiments.running.case import track_of
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.scoring.consistency import nees
from flexaxis.experiments.scoring.parameter_names import physical
from flexaxis.experiments.scoring.score_table import rows as scores
from flexaxis.experiments.scoring.scores import Track

AGES = (0.1, 0.5, 2.0)  # s after a fault at which claims are looked at
Row = dict[str, Any]


def run(case: Case, text: str, seed: int, folder: Path) -> Row:
    """Return what one estimator did on one record: its scores, findings and claims."""
    scenario = case.scenario
    record = case.spoil(records(scenario, [seed], RecordCache(folder / "records"))[0][0])
    estimator = build(parse(text), scenario)
    y, events = getattr(record, estimator.output), scenario.events()
    first = events[0].index if events else scenario.samples
    stops = [first, *(first + round(age / scenario.period) for age in AGES), scenario.samples]
    theta, claims, start, done = [], [], time.perf_counter(), 0
    for stop in np.minimum(stops, scenario.samples):
        part, done = slice(done, stop), stop
        valid = None if record.valid is None else record.valid[part]
        theta.append(run_estimator(estimator, record.torque[part], y[part], valid))
        claims.append(np.array(getattr(estimator, "covariance", np.nan)))
    seconds, told = time.perf_counter() - start, getattr(estimator, "findings", None)
    findings = list(told or ())
    names = tuple(estimator.names)
    track = track_of(scenario, record, names, np.vstack(theta), claims[0], None, findings)
    calm, faults = met(track, findings)
    return {
        "us": 1e6 * seconds / scenario.samples,
        "rows": scores(track),
        "claims": [claimed(track, names, stops[i] - 1, claims[i]) for i in range(1 + len(AGES))],
        "findings": len(findings),
        "calm": calm.sum() * scenario.period,
        "false": [true(track, f) for f in findings if calm[min(f.alarm, len(calm) - 1)]],
        "faults": [] if told is None else faults,
    }  # fmt: skip


def met(track: Track, findings: Sequence[Any]) -> tuple[Any, list[Row]]:
    """Return when no fault is being met (N,), and what each fault was taken for.

    What names another fault of the last five seconds, and no more, is left to that.
    """
    calm, found, period = np.ones(len(track.theta), bool), [], track.scenario.period
    for window in track.windows:
        calm[window.start : window.stop] = False
        others = [w for w in track.windows if w.parameter != window.parameter]
        spans = [(w.parameter, range(w.start, w.start + round(5.0 / period))) for w in others]
        again = [w.start for w in track.windows if w.start > window.start and w not in others]
        stop = min([window.start + round(5.0 / period), *again])
        inside = [f for f in findings if window.start <= f.alarm < stop and not any(
                  f.alarm in span and said(f)[0] == [name] for name, span in spans)]  # fmt: skip
        event = [e for e in track.scenario.events() if e.parameter == window.parameter
                 and e.index < window.stop][-1]  # fmt: skip
        met: Row = {"fault": window.parameter, "more": max(0, len(inside) - 1)}
        if inside:
            named, ratio, interval = said(inside[0])
            met |= {"named": named, "delay": period * (inside[0].alarm - window.start)}
            if named == [window.parameter] and event.before > 0:
                change = event.after / event.before
                met["size"] = 100 * (ratio[0] / change - 1) if ratio and change else None
                met["covered"] = interval[0][0] <= change <= interval[0][1] if interval else None
        found.append(met)
    return calm, found


def said(finding: Any) -> tuple[list[str], list[float], list[list[float]]]:
    """Return what a finding names, as physical parameters, with ratios and their intervals."""
    names = [physical(name) for name in finding.parameters]
    ratio = [float(x**e) for x, (_, e) in zip(getattr(finding, "ratio", ()), names, strict=False)]
    ends = getattr(finding, "interval", None) or ()
    interval = [
        sorted(float(x**e) for x in pair) for pair, (_, e) in zip(ends, names, strict=False)
    ]
    return [name for name, _ in names], ratio, interval


def true(track: Track, finding: Any) -> bool:
    """Return whether what a finding names has moved that way within the last five seconds."""
    named, ratio, _ = said(finding)
    if len(named) != 1 or named[0] not in track.scenario.parameter_names or not ratio:
        return False
    truth = track.true_parameters[:, track.scenario.parameter_names.index(named[0])]
    earlier = max(0, finding.alarm - round(5.0 / track.scenario.period))
    return bool((truth[finding.alarm] - truth[earlier]) * (ratio[0] - 1) > 0)


def claimed(track: Track, names: Sequence[str], k: int, C: Any) -> Row:
    """Return NEES over p, and how many of the asked parameters lie in their 95 % interval."""
    asked = [n for n in track.names if n in track.scenario.identify]
    if C.shape != (len(names),) * 2 or k >= len(track.theta):
        return {}
    mine, own = [names.index(n) for n in asked], [track.names.index(n) for n in asked]
    error, P = (track.theta - track.truth)[k, own], C[np.ix_(mine, mine)]
    square = nees(error, P)
    inside = abs(error) <= 1.96 * np.sqrt(abs(np.diag(P)))
    return {"nees": square and square / len(mine), "inside": int(inside.sum()), "of": len(mine)}
