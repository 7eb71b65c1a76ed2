"""The charts of a run that rank: speed against noise, and how near to the bound."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import Any

import numpy as np

from flexaxis.experiments.comparison import ranking
from flexaxis.experiments.comparison.ecdf import Ecdf, ecdf
from flexaxis.experiments.comparison.mismatch import TRACKS, track_of
from flexaxis.experiments.reporting.charts import Chart, Kind, Line, Panel, ends
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]
Wrong = Set[tuple[str, str, str]]

BOUNDS = (
    ("lag_bound", "bound, all θ unknown"),
    ("lag_bound_single", "bound, only this θ unknown"),
)
POINTS = 400  # to which a curve of shares is thinned: less than a point of the screen


def key(row: Row) -> tuple[str, str, str]:
    """Return by what an estimator is refused a rank: scenario, parameter and its name."""
    return row["scenario"], row["parameter"], row["estimator"]


def left_out(wrong: Wrong) -> str:
    """Return in a sentence who is not drawn where that would rank; empty for nobody."""
    if not wrong:
        return ""
    whom = dict.fromkeys(f"{who} ({scenario})" for scenario, _, who in sorted(wrong))
    return (
        " Not drawn, for the bias before the fault is more than half of its size, so that the "
        f"estimate was wrong already: {', '.join(whom)}."
    )


def tradeoff(points: Sequence[Row], order: Sequence[str], *, name: str = "tradeoff") -> Chart:
    """Return lag over noise, a line an estimator over its knob, a panel a fault.

    Parameters
    ----------
    points : sequence of mapping
        As in `flexaxis.experiments.studies.sweep.Sweep`.
    order : sequence of str
        Estimators, the best first.
    name : str
    """
    faults = list(dict.fromkeys((p["scenario"], p["parameter"]) for p in points))
    scale = {fault: _reference_std(points, fault) for fault in faults}
    known = all(scale.values())
    panels = []
    for fault in faults:
        mine = [p for p in points if (p["scenario"], p["parameter"]) == fault]
        unit = (scale[fault] or 1.0) if known else 1.0
        lines = [line for each in order if (line := _knob(mine, each, unit))]
        title = f"{fault[0]}: {fault[1]}"
        panels.append(
            Panel(title=title, y="lag [s]", y_log=True, lines=[*lines, *_bounds(mine, lines)])
        )
    return Chart(
        name=name,
        title="Speed against noise",
        words="Nearer to the lower left is better. A line is an estimator whose knob is turned "
        "from slow and quiet to quick and noisy; whiskers are 95 % intervals over seeds. Dotted "
        "and dash-dotted: the lags that the Cramér–Rao bounds allow."
        + (" The table is read off at the vertical line; what it "
           "prints is the jackknife’s value, which takes off the bias that so few runs have, and "
           "may differ a little from the curve." if known else ""),
        x=f"std before the fault / that of {ranking.REFERENCE}" if known
        else "std before the fault [% of nominal]",
        panels=panels,
        marks=[(1.0, "equal noise")] if known else [],
        x_log=True,
    )  # fmt: skip


def _reference_std(points: Sequence[Row], fault: tuple[str, str]) -> float | None:
    """Return what the reference has at its default, by which the noise of others is measured."""
    mine = (p for p in points if (p["scenario"], p["parameter"]) == fault and p["factor"] == 1.0)
    found = next((p["std"] for p in mine if p["estimator"] == ranking.REFERENCE), None)
    return float(found) if found else None


def _knob(points: Sequence[Row], estimator: str, unit: float) -> Line | None:
    mine = [p for p in points if p["estimator"] == estimator and p["std"] and p["lag"]]
    if not mine:
        return None
    return _of_points(estimator, sorted(mine, key=lambda p: p["std"]), unit, kind="both")


def _of_points(who: str, mine: Sequence[Row], unit: float, *, kind: Kind) -> Line:
    x, y = np.array([[p["std"] / unit, p["lag"]] for p in mine]).T
    (x_low, x_high), (low, high) = ends(mine, "std", unit), ends(mine, "lag")
    return Line(who=who, x=x, y=y, kind=kind, x_low=x_low, x_high=x_high, low=low, high=high)


def _bounds(points: Sequence[Row], lines: Sequence[Line]) -> list[Line]:
    """Return the bounds as horizontal lines over what is drawn."""
    x = np.array([min((line.x.min() for line in lines), default=0.1),
                  max((line.x.max() for line in lines), default=10.0)])  # fmt: skip
    found = []
    for key, label in BOUNDS:
        bound = next((p[key] for p in points if p.get(key)), None)
        if bound:
            found.append(Line(x=x, y=np.full(2, bound), role="bound", label=label))
    return found


def as_set(rows: Sequence[Row], order: Sequence[str], wrong: Wrong = frozenset()) -> Chart | None:
    """Return lag over noise at the one setting that each was run at, a point a fault.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows; those without a lag are left out.
    order : sequence of str
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`: these are not drawn.
    """
    mine = [
        r
        for r in rows
        if r["changed"] and r["lag"] is not None and r["std"] and key(r) not in wrong
    ]
    lines = [
        _of_points(who, own, 1.0, kind="points")
        for who in order
        if (own := [r for r in mine if r["estimator"] == who])
    ]
    if not lines:
        return None
    return Chart(
        name="tradeoff",
        title="Speed against noise",
        words="Nearer to the lower left is better; a point is an estimator as it is set, on one "
        "fault. `flexaxis tune --sweep` draws the whole curve of each knob, with the bounds. "
        "Whiskers are 95 % intervals over seeds." + left_out(wrong),
        x="std before the fault [% of nominal]",
        panels=[Panel(y="lag [s]", y_log=True, lines=lines)],
        x_log=True,
    )


def tracks(scenarios: Mapping[str, Scenario]) -> dict[str, str]:
    """Return the tracks of some scenarios, each in a sentence, in the order of reading."""
    there = {track_of(scenario) for scenario in scenarios.values()}
    return {name: words for name, words in TRACKS.items() if name in there}


def shares(
    rows: Iterable[Row],
    scenarios: Mapping[str, Scenario],
    order: Sequence[str],
    wrong: Wrong = frozenset(),
) -> Iterator[Chart]:
    """Yield a chart for each track with a fault that has a bound.

    Parameters
    ----------
    rows : iterable of mapping
        Of single runs, as `flexaxis.experiments.comparison.ecdf.ecdf` takes them.
    scenarios : mapping of str to Scenario
    order : sequence of str
        Estimators, the best first.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`: who is in it is in no chart of
        that track, for it would rank whom the text does not.
    """
    track = {name: track_of(scenario) for name, scenario in scenarios.items()}
    mine: dict[str, list[Row]] = {name: [] for name in TRACKS}
    for row in rows:
        mine[track[row["scenario"]]].append(row)
    for name, own in mine.items():
        here = {each for each in wrong if track[each[0]] == name}
        able = [who for who in order if who not in {each[2] for each in here}]
        found = ecdf(own, able) if set(able) - {*ranking.CONTROLS} else None
        if found is not None:
            yield _shares(name, found, left_out(here))


def _shares(track: str, found: Ecdf, said: str) -> Chart:
    """Return the shares of a track over lag/bound, a line an estimator."""
    known = [r for r in found.ratios.values() if r.size]
    ends = (min(r[0] for r in known), max(r[-1] for r in known)) if known else (1.0, 10.0)
    low, high = min(ends[0] / 1.1, 0.9), max(ends[1] * 1.1, 2.0)
    return Chart(
        name=f"ecdf-{track.replace(' ', '-')}",
        title=f"How often, how near to the bound: {track}",
        words=f"Share of {_count(found)} with a lag of at most so many times the bound, as the "
        "estimators are set; further up and to the left is better. A run that is lost, fails, or "
        "does no better than standing still never gets there. What is quicker may be noisier: "
        "this is not at equal noise. A run can lie left of the bound, which is on the mean size of "
        "an error over all noise and not on that of each run, and takes all parameters for "
        "unknown; for who finds that only one has changed it is smaller." + said,
        x="lag / lag of the bound",
        panels=[
            Panel(
                y="share of runs",
                y_range=(0.0, 1.02),
                lines=[_share(found, name, (low, high)) for name in found.ratios],
            )
        ],
        marks=[(1.0, "the bound")],
        x_log=True,
    )


def _count(found: Ecdf) -> str:
    faults = f"{found.faults} fault{'s'[: found.faults != 1]}"
    return f"{found.problems} run{'s'[: found.problems != 1]} of {faults}"


def _share(found: Ecdf, name: str, ends: tuple[float, float]) -> Line:
    x, y = found.curve(name)
    x, y = np.r_[ends[0], x, ends[1]], np.r_[0.0, y, y[-1] if y.size else 0.0]
    kept = np.unique(np.linspace(0, len(x) - 1, min(len(x), POINTS)).round().astype(int))
    return Line(who=name, x=x[kept], y=y[kept], kind="steps")
