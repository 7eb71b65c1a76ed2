"""The report of a run: the answer on the first screen, every scenario below it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd
from markupsafe import Markup

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.catalogue.card import in_a_line
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, REFERENCE
from flexaxis.experiments.reporting import figures, page, tables, words
from flexaxis.experiments.reporting.inputs import RunInputs, around, estimates, truth
from flexaxis.experiments.reporting.tables import Cell, Table, between, short
from flexaxis.experiments.scoring.score_table import SCORES

MANY = 32  # single runs of an estimator on a scenario in a page, the worst
SINGLE = ("estimator", "seed", "lag", "over_bound", "t10", "std", "bias", "score", "diverged")
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
    matched = {(row["estimator"], f"{row['scenario']}: {row['parameter']}"): row
               for row in swept["matched"]}  # fmt: skip
    scores = {row["estimator"]: row for row in swept["overall"]}
    lines = []
    for who in words.order_of(summary):
        if any(name == who for name, _ in matched):
            cells = [_lag(matched.get((who, fault))) for fault in faults]
            cells += [_score(scores[who])] if who in scores else []
            lines.append((who, [Cell(who, small=NOTES.get(who, "")), *cells]))
    heads = [f"{text}: lag [s]\n{fault}" for fault, text in faults.items()]
    return Table("lag at equal noise", ["estimator", *heads, "score\n0–100"], lines)


def _score(row: Mapping[str, Any]) -> Cell:
    text = f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}"
    return Cell(text, row["score"], between(row["score_interval"]), row["leads"])


def _lag(row: Mapping[str, Any] | None) -> Cell:
    if row is None or not row["lag"]:
        return Cell("–" if row is None else "lost", "")
    small = f"{short(row['over_bound'])} ×, {between(row['lag_interval'])}"
    return Cell(AT_MOST.get(row["how"], "") + short(row["lag"]), row["lag"], small, row["leads"])


class Drawing:
    """The figures and tables of a run."""

    def __init__(self, inputs: RunInputs, looks: figures.Looks) -> None:
        self.inputs, self.summary, self.looks = inputs, inputs.summary, looks
        self.draw = partial(page.drawn, looks=looks)

    def board(self) -> dict[str, Any]:
        """Return the first screen of a run that was compared at equal noise."""
        swept = self.summary["tradeoff"]
        faults, matched = words.fault_words(swept), words.faults_of(swept["matched"])
        order = [name for name in self.looks if name in set(matched["estimator"])]
        points, fault = words.faults_of(swept["points"]), words.widest(matched)
        return {
            "over_bound": self.draw(figures.over_bound, "lag over bound", matched, order, faults),
            "table": equal_noise_table(self.summary),
            "speed": self.draw(figures.speed_noise, "lag against noise", points, order, faults),
            "fault": (faults[fault], fault),
            "estimates": list(self._at_fault(matched[matched["fault"] == fault])),
        }

    def _at_fault(self, matched: pd.DataFrame) -> Iterator[Markup]:
        """Yield the estimates around a fault: half a second, and five seconds."""
        name, parameter = matched[["scenario", "parameter"]].iloc[0]
        settings = matched.set_index("estimator")["nearest"]
        traces = {who: self.inputs.traces(name, setting) for who, setting in settings.items()}
        scenario = self.inputs.scenarios[name]
        at = scenario.events()[0].index * scenario.period
        for window in ((at - 0.1, at + 0.5), (at - 1.0, at + 5.0)):
            if any(traces.values()):
                yield self.over_time(scenario, parameter, traces, window, "at equal noise")

    def over_time(
        self, scenario: Any, name: str, traces: Any, window: tuple[float, float], label: str
    ) -> Markup:
        """Return estimates over time; the first estimator and the reference have bands."""
        order = list(self.looks)
        own = {who: traces[who] for who in order[::-1] if traces.get(who)}
        series = medians(own, scenario, name, window, banded=(*order[:1], REFERENCE))
        text = f"{name} of {scenario.name}, {window[0]:.4g} to {window[1]:.4g} s, {label}"
        return self.draw(figures.curves, text, {f"{name} / nominal": series}, x="time [s]",
                         limits={"time [s]": window}, **around(scenario))  # fmt: skip

    def defaults(self, rows: pd.DataFrame) -> Iterator[tuple[str, Markup]]:
        """Yield heading and figure of all scenarios together, at default settings."""
        able = rows[rows["changed"]]
        able = able.assign(setting=able["estimator"] + " on " + able["scenario"])
        yield "Lag against noise, a point a fault", self.draw(
            figures.lag_against_noise, "default settings", able, list(self.looks))  # fmt: skip

    def section(self, name: str, rows: pd.DataFrame) -> dict[str, Any]:
        """Return what the report shows of a scenario; of one that was only swept its name."""
        scenario, own = self.inputs.scenarios[name], rows[rows["scenario"] == name]
        happens = words.happens(scenario.resolved())
        section: dict[str, Any] = {
            "scenario": scenario, "happens": happens, "line": in_a_line(scenario), "table": None,
        }  # fmt: skip
        if own.empty:
            return section
        traces = {who: self.inputs.traces(name, who) for who in self.looks}
        changed = {e.parameter: e.index * scenario.period for e in reversed(scenario.events())}
        own = own.sort_values(["changed", "parameter"], ascending=[False, True], kind="stable")
        drawn = []
        for parameter in own["parameter"].unique():
            at = changed.get(parameter.removeprefix("1/"))
            able = {who: runs for who, runs in traces.items()
                    if any(parameter in run.names for run in runs.values())}  # fmt: skip
            for window in [(0.0, scenario.duration), *([] if at is None else [(at - 0.1, at + 1)])]:
                drawn.append(self.over_time(scenario, parameter, able, window, "median"))
        heads = {"estimator": "estimator", "parameter": "parameter"} | tables.COLUMNS
        table = tables.table(f"{name} scores", own, heads)
        return section | {"figures": drawn, "table": table} | self._runs(name)

    def _runs(self, name: str) -> dict[str, Any]:
        """Return the single runs on a scenario, the worst of each estimator first."""
        runs = self.inputs.runs.sort_values(["changed", "diverged", "lag", "std"], ascending=False)
        runs = runs[runs["scenario"] == name].drop_duplicates(["estimator", "seed"])
        shown = runs.groupby("estimator").head(MANY)
        shown = shown.assign(setting=shown["estimator"] + ", seed " + shown["seed"].astype(str))
        label, order = f"runs of {name}", list(self.looks)
        heads = {each: tables.COLUMNS.get(each, each) for each in SINGLE}
        return {
            "points": self.draw(figures.lag_against_noise, label, shown, order),
            "runs": tables.table(label, shown, heads),
            "worst": runs.iloc[0] if len(runs) else None,
        }


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
        runs = _thinned(estimates(own, scenario, name).loc[slice(*window)])
        low, middle, high = runs.quantile([0.1, 0.5, 0.9], axis=1).to_numpy()
        band = {"low": low, "high": high} if who in banded else {}
        series.append(figures.Series(x=runs.index, y=middle, estimator=who, **band))
    true = _thinned(truth(scenario, name).loc[slice(*window)])
    return [*series, figures.Series(x=true.index, y=true, role="truth", kind="steps")]


def _thinned(rows: Any) -> Any:
    """Return rows of a table, one a pixel at most."""
    return rows.iloc[:: max(1, len(rows) // 150)]
