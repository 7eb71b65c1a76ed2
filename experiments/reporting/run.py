"""The report of a run: the answer on the first screen, every scenario below it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.mismatch import TRACKS, misled, track_of
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, REFERENCE, ecdf
from flexaxis.experiments.reporting import figures, page, tables, words
from flexaxis.experiments.reporting.inputs import RunInputs, estimates, truth
from flexaxis.experiments.reporting.tables import Cell, Table, between, short
from flexaxis.experiments.scoring.score_table import SCORES

MANY = 600  # single runs in a page; of more, the worst of each estimator
SINGLE = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged")
NOTES = {REFERENCE: "the paper’s method", RECOMMENDED: "recommended"}


def render(inputs: RunInputs) -> str:
    """Return the report of a run as HTML."""
    summary, order = inputs.summary, words.order_of(inputs.summary)
    title, facts = words.answer(summary)
    failures = summary.get("failures", [])
    drawing = Drawing(inputs, page.looks_of(order))
    rows = tables.flat(summary["rows"])
    return page.render(
        "reporting/templates/run.html",
        title=title,
        facts=facts,
        summary=summary,
        looks=drawing.looks,
        warning=words.warning(summary["rows"], summary["scenarios"]),
        failures=words.failures_in_words(failures),
        failed=len(failures),
        board=drawing.board() if (summary.get("tradeoff") or {}).get("matched") else None,
        defaults=list(drawing.defaults(rows)),
        sections=[drawing.section(name, rows) for name in inputs.scenarios],
        glossary={head: SCORES[name].words for name, head in tables.COLUMNS.items()
                  if name in SCORES},
        reference=REFERENCE,
    )  # fmt: skip


def equal_noise_table(summary: Mapping[str, Any]) -> Table:
    """Return the table of lags at equal noise: a line an estimator, a column a fault."""
    swept, faults = summary["tradeoff"], words.fault_words(summary["tradeoff"])
    lines = []
    for who in words.order_of(summary):
        own = {
            f"{r['scenario']}: {r['parameter']}": r
            for r in swept["matched"]
            if r["estimator"] == who
        }
        cells = [_lag(own.get(fault)) for fault in faults]
        cells += [
            Cell(f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}", row["score"],
                 between(row["score_interval"]), row["leads"])
            for row in swept["overall"] if row["estimator"] == who
        ]  # fmt: skip
        if own:
            lines.append((who, [Cell(who, small=NOTES.get(who, "")), *cells]))
    heads = [f"{text}: lag [s]\n{fault}" for fault, text in faults.items()]
    return Table("lag at equal noise", ["estimator", *heads, "score\n0–100"], lines)


def _lag(row: Mapping[str, Any] | None) -> Cell:
    if row is None or not row["lag"]:
        return Cell("–" if row is None else "lost", "")
    small = f"{short(row['over_bound'])} ×, {between(row['lag_interval'])}"
    return Cell(AT_MOST.get(row["how"], "") + short(row["lag"]), row["lag"], small, row["leads"])


class Drawing:
    """The figures and tables of a run."""

    def __init__(self, inputs: RunInputs, looks: figures.Looks) -> None:
        self.inputs, self.summary, self.looks = inputs, inputs.summary, looks
        self.draw = partial(page.drawn, looks=looks, legend=False)

    def board(self) -> dict[str, Any]:
        """Return the first screen of a run that was compared at equal noise."""
        swept = self.summary["tradeoff"]
        faults, matched = words.fault_words(swept), words.faults_of(swept["matched"])
        order = [name for name in self.looks if name in set(matched["estimator"])]
        points = words.faults_of(swept["points"])
        fault = words.widest(matched)
        return {
            "over_bound": page.drawn(figures.over_bound, "lag over its bound", matched, order,
                                     faults, looks=self.looks),
            "table": equal_noise_table(self.summary),
            "speed": self.draw(figures.speed_noise, "lag against noise", points, order, faults),
            "fault": (faults[fault], fault),
            "estimates": list(self._at_fault(matched[matched["fault"] == fault])),
        }  # fmt: skip

    def _at_fault(self, matched: pd.DataFrame) -> Iterator[Markup]:
        """Yield the estimates around a fault: five seconds, and half a second."""
        scenario = self.inputs.scenarios[matched["scenario"].iloc[0]]
        parameter = matched["parameter"].iloc[0]
        traces = {row["estimator"]: self.inputs.traces(scenario.name, row["nearest"])
                  for row in matched.to_dict("records") if "nearest" in row}  # fmt: skip
        at = scenario.events()[0].index * scenario.period
        for window in ((at - 0.1, at + 0.5), (at - 1.0, at + 5.0)):
            if any(traces.values()):
                yield self.over_time(scenario, parameter, traces, window, "at equal noise")

    def over_time(
        self, scenario: Any, name: str, traces: Any, window: tuple[float, float], label: str
    ) -> Markup:
        """Return estimates over time; the first estimator and the reference have bands."""
        ordered = {who: traces[who] for who in list(self.looks)[::-1] if traces.get(who)}
        series = medians(ordered, scenario, name, window, banded=(*list(self.looks)[:1], REFERENCE))
        text = f"{name} of {scenario.name}, {window[0]:.4g} to {window[1]:.4g} s, {label}"
        return self.draw(figures.curves, text, {f"{name} / nominal": series}, x="time [s]",
                         limits={"time [s]": window}, **figures.around(scenario))  # fmt: skip

    def defaults(self, rows: pd.DataFrame) -> Iterator[tuple[str, Markup]]:
        """Yield heading and figure of all scenarios together, at default settings."""
        wrong = misled(self.summary["rows"], self.inputs.scenarios)
        keys = zip(rows["scenario"], rows["parameter"], rows["estimator"], strict=True)
        able = rows[rows["changed"] & np.array([key not in wrong for key in keys])]
        able = able.assign(setting=able["estimator"] + " on " + able["scenario"])
        yield "Lag against noise, a point a fault", self.draw(
            figures.lag_against_noise, "default settings", able, list(self.looks))  # fmt: skip
        runs = self.inputs.runs
        runs = runs.astype(object).where(runs.notna(), None)
        tracks = runs["scenario"].map(lambda name: track_of(self.inputs.scenarios[name]))
        for track in TRACKS:
            own = runs[tracks == track].to_dict("records")
            names = {row["scenario"] for row in own}
            misfits = {who for scenario, _, who in wrong if scenario in names}
            estimators = [who for who in self.looks if who not in misfits]
            result = ecdf(own, estimators)
            if result and estimators:
                figure = self.draw(figures.shares, f"share of runs, {track}", result.ratios,
                                   result.problems)  # fmt: skip
                yield f"Share of runs against the bound: {track}", figure

    def section(self, name: str, rows: pd.DataFrame) -> dict[str, Any]:
        """Return what the report shows of a scenario."""
        scenario, own = self.inputs.scenarios[name], rows[rows["scenario"] == name]
        happens = words.happens(scenario.resolved())
        section: dict[str, Any] = {"scenario": scenario, "happens": happens, "figures": [],
                                   "table": None, "runs": None}  # fmt: skip
        if own.empty:
            points = words.faults_of(self.summary["tradeoff"]["points"])
            heads = {"estimator": "estimator", "setting": "setting", "lag": "lag [s]",
                     "std": "std before [%]", "diverged": "lost"}  # fmt: skip
            own = points[points["scenario"] == name]
            return section | {"table": tables.table(f"{name} settings", own, heads)}
        traces = {who: self.inputs.traces(name, who) for who in self.looks}
        changed = {e.parameter: e.index * scenario.period for e in reversed(scenario.events())}
        own = own.sort_values(["changed", "parameter"], ascending=[False, True], kind="stable")
        for parameter in own["parameter"].unique():
            at = changed.get(parameter.removeprefix("1/"))
            windows = [(0.0, scenario.duration)] + ([] if at is None else [(at - 0.1, at + 1.0)])
            able = {
                w: t for w, t in traces.items() if t and parameter in next(iter(t.values())).names
            }
            section["figures"] += [self.over_time(scenario, parameter, able, window, "median")
                                   for window in windows]  # fmt: skip
        heads = {"estimator": "estimator", "parameter": "parameter"} | tables.COLUMNS
        return section | self._runs(scenario, traces) | {
            "table": tables.table(f"{name} scores", own, heads)
        }  # fmt: skip

    def _runs(self, scenario: Any, traces: Mapping[str, Any]) -> dict[str, Any]:
        """Return the single runs on a scenario: the worst over time, points, and a table."""
        runs = self.inputs.runs
        runs = runs[runs["scenario"] == scenario.name].sort_values("changed", ascending=False)
        runs = runs.drop_duplicates(["estimator", "seed"]).sort_values(
            ["diverged", "lag", "std"], ascending=False)  # fmt: skip
        if runs.empty:
            return {}
        worst = runs.drop_duplicates("estimator")
        shown = runs if len(self.inputs.runs) <= MANY else worst
        order = shown["estimator"].map({who: i for i, who in enumerate(self.looks)})
        shown = shown.assign(
            setting=shown["estimator"] + ", seed " + shown["seed"].astype(str),
            found=[_found(traces[r.estimator].get(r.seed)) for r in shown.itertuples()],
        ).iloc[order.argsort(kind="stable")]  # fmt: skip
        alone = {r.estimator: {r.seed: traces[r.estimator][r.seed]} for r in worst.itertuples()
                 if r.seed in traces[r.estimator]}  # fmt: skip
        heads = {"estimator": "estimator", "seed": "seed"}
        heads |= {name: tables.COLUMNS[name] for name in SINGLE} | {"found": "findings"}
        window, name = (0.0, scenario.duration), worst["parameter"].iloc[0]
        return {
            "worst": self.over_time(scenario, name, alone, window, "worst runs"),
            "points": self.draw(figures.lag_against_noise, f"runs of {scenario.name}", shown,
                                list(self.looks)),
            "runs": tables.table(f"{scenario.name} runs", shown, heads),
            "again": worst.iloc[0],
        }  # fmt: skip


def medians(
    traces: Mapping[str, Any], scenario: Any, name: str, window: tuple[float, float],
    *, banded: Sequence[str],
) -> list[figures.Series]:  # fmt: skip
    """Return the median estimates of some estimators in a window, and the truth.

    Parameters
    ----------
    traces : mapping of str to mapping
        Traces by estimator and seed.
    scenario : Scenario
    name : str
        What is estimated.
    window : (float, float)
        [s]
    banded : sequence of str
        Estimators with a band of 10 to 90 % of the runs.
    """
    series = []
    for who, own in traces.items():
        time, runs = estimates(own, scenario, name)
        kept = _inside(time, window)
        low, middle, high = np.percentile(runs[:, kept], [10, 50, 90], axis=0)
        band = {"low": low, "high": high} if who in banded and len(runs) > 1 else {}
        series.append(figures.Series(x=time[kept], y=middle, estimator=who, **band))
    kept, true = _inside(scenario.times, window), truth(scenario, name)
    true = figures.Series(x=scenario.times[kept], y=true[kept], role="truth", kind="steps")
    return [*series, true]


def _inside(time: Any, window: tuple[float, float]) -> Any:
    """Return which samples of a window are drawn: one a pixel at most."""
    inside = np.flatnonzero((time >= window[0]) & (time <= window[1]))
    return inside[:: max(1, len(inside) // 150)]


def _found(trace: Any) -> str:
    """Return what a run reported, in words."""
    found = trace.detail.findings if trace is not None else ()
    texts = [f"{each['time']:.2f} s {', '.join(each['parameters'])}" for each in found[:3]]
    return "; ".join(texts + [f"{len(found) - 3} more"] * (len(found) > 3)) or "–"
