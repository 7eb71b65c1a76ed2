"""How near each estimator comes to the bound over all scenarios: a chart a track."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from flexaxis.experiments.reporting.charts import Chart, Line, Panel
from flexaxis.experiments.scoring.ecdf import Ecdf, ecdf
from flexaxis.experiments.scoring.tracks import TRACKS, track_of
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]

POINTS = 400  # to which a longer curve is thinned: by less than a point of a panel 200 points high


def tracks(scenarios: Mapping[str, Scenario]) -> dict[str, str]:
    """Return the tracks of some scenarios, each in a sentence, in the order of reading."""
    there = {track_of(scenario) for scenario in scenarios.values()}
    return {name: words for name, words in TRACKS.items() if name in there}


def charts(
    rows: Iterable[Row], scenarios: Mapping[str, Scenario], order: Sequence[str]
) -> Iterator[Chart]:
    """Yield a chart for each track with a fault that has a bound.

    Parameters
    ----------
    rows : iterable of mapping
        Of single runs, as `flexaxis.experiments.scoring.ecdf.ecdf` takes them.
    scenarios : mapping of str to Scenario
    order : sequence of str
        Estimators, the best first.
    """
    track = {name: track_of(scenario) for name, scenario in scenarios.items()}
    mine: dict[str, list[Row]] = {name: [] for name in TRACKS}
    for row in rows:
        mine[track[row["scenario"]]].append(row)
    for name, own in mine.items():
        found = ecdf(own, order)
        if found is not None:
            yield chart(name, found)


def chart(track: str, found: Ecdf) -> Chart:
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
        "unknown; for who finds that only one has changed it is smaller.",
        x="lag / lag of the bound",
        panels=[
            Panel(
                y="share of runs",
                y_range=(0.0, 1.02),
                lines=[_line(found, name, (low, high)) for name in found.ratios],
            )
        ],
        marks=[(1.0, "the bound")],
        x_log=True,
    )


def _count(found: Ecdf) -> str:
    faults = f"{found.faults} fault{'s'[: found.faults != 1]}"
    return f"{found.problems} run{'s'[: found.problems != 1]} of {faults}"


def _line(found: Ecdf, name: str, ends: tuple[float, float]) -> Line:
    x, y = found.curve(name)
    x, y = np.r_[ends[0], x, ends[1]], np.r_[0.0, y, y[-1] if y.size else 0.0]
    kept = np.unique(np.linspace(0, len(x) - 1, min(len(x), POINTS)).round().astype(int))
    return Line(who=name, x=x[kept], y=y[kept], kind="steps")
