"""The report of a run: the answer on the first screen, every scenario below it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison.ecdf import ecdf
from flexaxis.experiments.comparison.mismatch import TRACKS, misled, track_of
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, CONTROLS, REFERENCE, too_few
from flexaxis.experiments.reporting import page, run_figures, tables, words
from flexaxis.experiments.reporting.figures import POINTS, Looks, Series, around, curves, symbols
from flexaxis.experiments.reporting.inputs import RunInputs, estimates, truth
from flexaxis.experiments.reporting.tables import Cell, Table, between, pair, scored, short
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]
FIRST = 4  # faults of which speed against noise is on the first screen
MANY = 600  # single runs in a page; of more, the worst and the median of each estimator
ALL_PARAMETERS = 12  # scenarios up to which parameters that do not change are drawn
SINGLE = ("lag", "over_bound", "t10", "std", "bias", "score")
DEFAULT = ("lag", "t10", "std", "bias", "diverged", "score", "cross_talk", "false_alarms", "cost")


def render(inputs: RunInputs) -> str:
    """Return the report of a run as HTML."""
    summary, order = inputs.summary, words.order_of(inputs.summary)
    looks = page.looks_of(order)
    draw = _Drawing(inputs, order, looks)
    swept = summary.get("tradeoff") or {"matched": [], "points": [], "overall": []}
    matched = words.faults_of(swept["matched"])
    failures = summary.get("failures", [])
    return page.render(
        "reporting/templates/run.html",
        title=words.title(summary),
        summary=summary,
        looks=looks,
        order=order,
        points=words.points(summary),
        warning=words.warning(summary["rows"], summary["scenarios"]),
        failures=words.failures_in_words(failures),
        failed=len(failures),
        faults=matched["fault"].nunique() if len(matched) else 0,
        board=draw.board(matched) if len(matched) else None,
        equal=equal_noise_table(summary) if len(matched) else None,
        defaults=draw.defaults(),
        overview=overview(inputs, order),
        shares=draw.shares(),
        sections=[draw.section(name) for name in summary["scenarios"]],
        swept=[draw.swept(n) for n in inputs.scenarios if n not in summary["scenarios"]],
        glossary={head: text for head, _, text in tables.COLUMNS.values()},
        reference=REFERENCE,
    )


def equal_noise_table(summary: Row) -> Table:
    """Return the table of lags at equal noise: a line an estimator, a column a fault."""
    swept, order = summary["tradeoff"], words.order_of(summary)
    matched = words.faults_of(swept["matched"])
    few = bool(too_few(swept["matched"]))
    cells = {(r["estimator"], r["fault"]): r for r in matched.to_dict("records")}
    overall = {row["estimator"]: row for row in swept["overall"]}
    faults = list(matched["fault"].unique())
    lines = []
    for who in (name for name in order if any(key[0] == name for key in cells)):
        note = {REFERENCE: "the paper’s method", RECOMMENDED: "recommended"}.get(who, "")
        own = [_matched(cells.get((who, fault)), few) for fault in faults]
        score = [_overall(overall[who], few) if who in overall else Cell("–", "")] * bool(overall)
        lines.append((who, [Cell(who, small=note), *own, *score]))
    heads = [f"{happens}: lag [s]\n{fault}" for fault, happens in fault_words(summary).items()]
    rest = ["score\n0–100"] * bool(overall)
    return Table(
        "lag at equal noise",
        ["estimator", *heads, *rest],
        lines,
        [
            "★ fastest, or not distinguishable from it; below each lag: × bound, 95 % interval.",
            f"Equal noise: each estimator is tuned to the noise of {REFERENCE} before the fault. "
            "≤, ≥: no setting is as noisy, or as quiet; the lag is at most, or at least, this.",
            "Score: 0 never reacts, 100 reaches the bound; at equal noise of all parameters together.",
        ],
    )


def _matched(row: Row | None, few: bool) -> Cell:
    if row is None:
        return Cell("–", "")
    if not row["lag"] > 0:
        return Cell("lost", "")
    small = f"{short(row['over_bound'])} ×, {between(row['lag_interval'])}"
    text = AT_MOST.get(row["how"], "") + short(row["lag"])
    return Cell(text, row["lag"], small, best=row["leads"] and not few)


def _overall(row: Row, few: bool) -> Cell:
    text = f"{AT_LEAST.get(row['how'], '')}{row['score']:.0f}"
    return Cell(text, row["score"], between(row["score_interval"]), row["leads"] and not few)


def fault_words(summary: Row) -> dict[str, str]:
    """Return what the faults compared at equal noise are called, by their names."""
    swept = summary["tradeoff"]
    rows = dict(zip(words.fault_names(swept["matched"]), swept["matched"], strict=True))
    known = swept.get("definitions", {})
    return {
        fault: words.happens(known[row["scenario"]]) if row["scenario"] in known else fault
        for fault, row in rows.items()
    }


def overview(inputs: RunInputs, order: Sequence[str]) -> Table:
    """Return the lags at default settings: a line a scenario, a column an estimator."""
    rows = inputs.summary["rows"]
    wrong = misled(rows, inputs.scenarios)
    names = [name for name in order if any(row["estimator"] == name for row in rows)]
    lines = []
    for scenario in inputs.summary["scenarios"]:
        here = [row for row in rows if row["scenario"] == scenario]
        own = [_default([r for r in here if r["estimator"] == name], wrong) for name in names]
        code = Cell(
            words.happens(inputs.summary["scenarios"][scenario]["definition"]), small=scenario
        )
        lines.append(("", [code, Cell(track_of(inputs.scenarios[scenario])), *own]))
    return Table(
        "lag at default settings",
        ["scenario", "track", *names],
        lines,
        [
            "Lag [s] of the parameter that changes; below it bias ± std before the fault [%].",
            "*: the bias before the fault is more than half of its size, so the lag says nothing.",
            "At default settings the noise differs: do not rank by lag.",
        ],
    )


def _default(rows: Sequence[Row], wrong: set[tuple[str, str, str]]) -> Cell:
    """Return the cell of an estimator on a scenario: what changed, else the largest error."""
    if not rows:
        return Cell("–", "")
    row = max(rows, key=lambda r: (r["changed"], abs(r["bias"] or 0.0) + (r["std"] or 0.0)))
    star = "*" * ((row["scenario"], row["parameter"], row["estimator"]) in wrong)
    small = f"{short(row['bias'])} ± {short(row['std'])} %"
    small += f", {row['diverged']} of {row['seeds']} lost" if row["diverged"] else ""
    return Cell(short(row["lag"]) + star, "" if row["lag"] is None else row["lag"], small)


class _Drawing:
    """The figures of a run, and the sections that they stand in."""

    def __init__(self, inputs: RunInputs, order: Sequence[str], looks: Looks) -> None:
        self.inputs, self.summary, self.order, self.looks = inputs, inputs.summary, order, looks

    def board(self, matched: pd.DataFrame) -> dict[str, Any]:
        """Return the figures of the first screen, and what stands with them."""
        faults, swept = fault_words(self.summary), self.summary["tradeoff"]
        order = [name for name in self.order if name in set(matched["estimator"])]
        draw = partial(page.drawn, looks=self.looks)
        points = words.faults_of(swept["points"])
        panels = [dict(list(faults.items())[:FIRST]), dict(list(faults.items())[FIRST:])]
        return {
            "over_bound": draw(
                run_figures.over_bound, "lag over its bound", matched, order, faults
            ),
            "speed": [
                draw(
                    run_figures.speed_noise,
                    f"lag against noise {i}",
                    points,
                    order,
                    part,
                    words.noise_of(points),
                )
                for i, part in enumerate(panels)
                if part
            ],
            **self.at_fault(matched, order, faults),
        }

    def at_fault(
        self, matched: pd.DataFrame, order: Sequence[str], faults: Mapping[str, str]
    ) -> dict[str, Any]:
        """Return the figure of the estimates around the fault at which they differ most."""
        fault = words.widest(matched)
        first = matched[matched["fault"] == fault].iloc[0]
        scenario, parameter = self.inputs.scenarios[first["scenario"]], first["parameter"]
        settings = matched[matched["fault"] == fault].set_index("estimator").get("nearest", {})
        equal = {
            who: self.inputs.at_equal_noise(scenario.name, settings[who])
            for who in order
            if who in settings
        }
        traces = (
            equal
            if all(equal.values()) and equal
            else {who: self.inputs.traces(scenario.name, who) for who in order}
        )
        runs = {who: estimates(own, scenario, parameter) for who, own in traces.items() if own}
        if not runs or not scenario.events():
            return {"estimates": "", "widest": "", "kept": False}
        at = scenario.events()[0].index * scenario.period
        time = next(iter(runs.values()))[0]
        true = np.interp(time, scenario.times, truth(scenario, parameter))
        leaders, _ = words.leading(matched, order)
        figure = page.drawn(
            run_figures.at_fault,
            "estimates around the fault",
            {who: values for who, (_, values) in runs.items()},
            time - at,
            true,
            label=symbols(parameter),
            first=leaders,
            looks=self.looks,
        )
        kept = traces is equal
        return {"estimates": figure, "widest": faults[fault], "code": fault, "kept": kept}

    def defaults(self) -> Markup:
        """Return lag against noise at default settings, a point a fault."""
        rows = pd.DataFrame(self.summary["rows"])
        wrong = misled(self.summary["rows"], self.inputs.scenarios)
        keys = zip(rows["scenario"], rows["parameter"], rows["estimator"], strict=True)
        rows = rows[rows["changed"] & [key not in wrong for key in keys]].copy()
        if not rows["lag"].gt(0).any():
            return Markup()
        rows["tip"] = [
            f"{r.estimator} on {r.scenario}: lag {short(r.lag)} s, std {short(r.std)} %"
            for r in rows.itertuples()
        ]
        return page.drawn_once(
            run_figures.lag_against_noise,
            "default settings",
            rows,
            self.order,
            looks=self.looks,
            legend=False,
        )

    def shares(self) -> list[tuple[str, str, Markup]]:
        """Return how often each estimator comes how near to the bound, a figure a track."""
        tracks = {n: track_of(self.inputs.scenarios[n]) for n in self.summary["scenarios"]}
        wrong = misled(self.summary["rows"], self.inputs.scenarios)
        found = []
        for name, about in TRACKS.items():
            here = {scenario for scenario, track in tracks.items() if track == name}
            able = [w for w in self.order if w not in {k[2] for k in wrong if k[0] in here}]
            rows = self.inputs.runs[self.inputs.runs["scenario"].isin(here)]
            rows = rows.astype(object).where(rows.notna(), None)
            result = ecdf(rows.to_dict("records"), able) if set(able) - {*CONTROLS} else None
            if result:
                figure = page.drawn_once(
                    run_figures.shares,
                    f"share of runs {name}",
                    result.ratios,
                    result.problems,
                    looks=self.looks,
                )
                found.append((name, about, figure))
        return found

    def section(self, name: str) -> dict[str, Any]:
        """Return what the report shows of a scenario at default settings."""
        scenario, place = self.inputs.scenarios[name], {w: i for i, w in enumerate(self.order)}
        rows = [row for row in self.summary["rows"] if row["scenario"] == name]
        rows.sort(key=lambda row: (not row["changed"], row["parameter"], place[row["estimator"]]))
        traces = {who: self.inputs.traces(name, who) for who in self.order}
        traces = {who: own for who, own in traces.items() if own}
        runs = self.inputs.runs[self.inputs.runs["scenario"] == name]
        return {
            **self.about(scenario),
            "figures": self.over_time(scenario, traces, [r["parameter"] for r in rows]),
            "table": tables.scores(f"{name} scores", rows, DEFAULT),
            **self.single_runs(scenario, runs, traces),
        }

    def about(self, scenario: Scenario) -> dict[str, Any]:
        """Return what a scenario is."""
        return {
            "name": scenario.name,
            "happens": words.happens(scenario.resolved()),
            "card": scenario.card,
            "hash": scenario.hash,
            "toml": scenario.to_toml(),
        }

    def over_time(
        self, scenario: Scenario, traces: Mapping[str, Any], names: Sequence[str]
    ) -> list[Markup]:
        """Return the estimates over time, what changed first and once more at the fault."""
        changed = {event.parameter for event in scenario.events()}
        figures = []
        for name in dict.fromkeys(names):
            moves = name.removeprefix("1/") in changed
            if not moves and len(self.summary["scenarios"]) > ALL_PARAMETERS:
                continue
            at = scenario.events()[0].index * scenario.period if moves else 0.0
            windows = [(at - 0.1, at + 1.0)] * moves + [(0.0, scenario.duration)]
            able = {
                who: own for who, own in traces.items() if name in next(iter(own.values())).names
            }
            for i, window in enumerate(windows):
                series = [
                    _median(who, own, scenario, name, window, who in (*self.order[:1], REFERENCE))
                    for who, own in reversed(able.items())
                ]
                figures.append(
                    self._small(f"{scenario.name} {name} {i}", scenario, name, series, window)
                )
        return figures

    def _small(
        self,
        label: str,
        scenario: Scenario,
        name: str,
        series: list[Series],
        window: tuple[float, float],
    ) -> Markup:
        true = _thinned(scenario.times, truth(scenario, name), window)
        series = [*series, Series(x=true[0], y=true[1], role="truth", kind="steps")]
        return page.drawn_once(
            curves,
            label,
            {f"{name} / nominal": series},
            x="time [s]",
            window=window,
            looks=self.looks,
            legend=False,
            **around(scenario),
        )

    def single_runs(
        self, scenario: Scenario, runs: pd.DataFrame, traces: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Return the single runs on a scenario: points, the worst over time, a table."""
        place = {who: i for i, who in enumerate(self.order)}
        first = runs.sort_values("changed", ascending=False, kind="stable")
        first = first.drop_duplicates(["estimator", "seed"])
        if first.empty:
            return {"points": Markup(), "worst": Markup(), "runs": None, "command": ""}
        badness = first["lag"].where(first["changed"] == 1, first["std"]).fillna(0.0)
        first = first.assign(bad=badness.where(first["diverged"] != 1, np.inf))
        first = first.sort_values("bad", ascending=False, kind="stable")
        first = first.sort_values("estimator", key=lambda names: names.map(place), kind="stable")
        worst = first.drop_duplicates("estimator")
        if len(self.inputs.runs) > MANY:
            middle = [
                group.iloc[[0, len(group) // 2]]
                for _, group in first.groupby("estimator", sort=False)
            ]
            first = pd.concat(middle).drop_duplicates(["estimator", "seed"])
        lines = [(row["estimator"], _single(row, traces)) for row in _records(first)]
        heads = ["estimator", "seed", *(tables.COLUMNS[n][0] for n in SINGLE), "lost", "findings"]
        shown = first[first["changed"] == 1].assign(
            tip=[
                f"{r.estimator}, seed {r.seed}: lag {short(r.lag)} s, std {short(r.std)} %"
                for r in first[first["changed"] == 1].itertuples()
            ]
        )
        return {
            "points": page.drawn_once(
                run_figures.lag_against_noise,
                f"single runs {scenario.name}",
                shown,
                self.order,
                looks=self.looks,
                legend=False,
            )
            if shown["lag"].gt(0).any()
            else Markup(),
            "worst": self._worst(scenario, worst, traces),
            "runs": Table(f"{scenario.name} runs", heads, lines),
            "command": _command(scenario, _records(worst)[0]),
        }

    def _worst(self, scenario: Scenario, worst: pd.DataFrame, traces: Mapping[str, Any]) -> Markup:
        """Return the worst run of each estimator over time, on the parameter that changes."""
        name, window, series = worst.iloc[0]["parameter"], (0.0, scenario.duration), []
        for row in _records(worst)[::-1]:
            trace = traces.get(row["estimator"], {}).get(row["seed"])
            if trace is None or name not in trace.names:
                continue
            time, values = estimates({row["seed"]: trace}, scenario, name)
            x, y = _thinned(time, values[0], window)
            tip = f"{row['estimator']}, seed {row['seed']}: {_found(trace)}"
            series.append(Series(x=x, y=y, estimator=row["estimator"], tips=[tip]))
        if not series:
            return Markup()
        return self._small(f"worst runs {scenario.name}", scenario, name, series, window)

    def swept(self, name: str) -> dict[str, Any]:
        """Return what the report shows of a scenario that was run at equal noise only."""
        place = {who: i for i, who in enumerate(self.order)}
        points = [p for p in self.summary["tradeoff"]["points"] if p["scenario"] == name]
        points.sort(key=lambda p: (place[p["estimator"]], p["factor"]))
        heads = [
            "estimator",
            "setting",
            "parameter",
            "lag [s]",
            "std before [%]",
            "std after [%]",
            "lost",
        ]
        lines = [
            (
                p["estimator"],
                [
                    Cell(p["estimator"]),
                    Cell(p["setting"]),
                    Cell(p["parameter"]),
                    scored(p["lag"], pair(p["lag_interval"])),
                    scored(p["std"], pair(p["std_interval"])),
                    scored(p["std_after"]),
                    Cell(f"{p['diverged']} of {p['seeds']}", p["diverged"]),
                ],
            )
            for p in points
        ]
        return self.about(self.inputs.scenarios[name]) | {
            "table": Table(f"{name} settings", heads, lines)
        }


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return rows with None for what is not defined."""
    found = table.astype(object).where(table.notna(), None)
    return [{str(k): v for k, v in row.items()} for row in found.to_dict("records")]


def _thinned(time: Any, values: Any, window: tuple[float, float]) -> tuple[Any, Any]:
    """Return a curve inside a window, with a point a pixel."""
    inside = np.flatnonzero((time >= window[0]) & (time <= window[1]))
    inside = inside[:: max(1, len(inside) // POINTS)]
    return time[inside], values[inside]


def _median(
    who: str, runs: tuple[Any, Any], window: tuple[float, float], *, band: bool
) -> Series:
    """Return the median of the runs of an estimator, with 10 to 90 % of them if asked."""
    time, values = runs
    low, middle, high = np.percentile(values, [10, 50, 90], axis=0)
    sides = {"low": _thinned(time, low, window)[1], "high": _thinned(time, high, window)[1]}
    x, y = _thinned(time, middle, window)
    return Series(x=x, y=y, estimator=who, **(sides if band else {}))


def _single(row: Row, traces: Mapping[str, Any]) -> list[Cell]:
    """Return the cells of a single run."""
    trace = traces.get(row["estimator"], {}).get(row["seed"])
    lost = f"at {short(row['lost_at'])} s" if row["diverged"] else ""
    cells = [tables.COLUMNS[name][1](row) for name in SINGLE]
    return [Cell(row["estimator"]), Cell(str(row["seed"])), *cells, Cell(lost), Cell(_found(trace))]


def _found(trace: Any) -> str:
    """Return what a run reported, in words."""
    findings = trace.detail.findings if trace is not None else ()
    texts = [
        f"{each['time']:.2f} s {', '.join(each['parameters']) or 'unexplained'}"
        for each in findings[:3]
    ]
    more = [f"{len(findings) - 3} more"] * (len(findings) > 3)
    return "; ".join([*texts, *more]) or "–"


def _command(scenario: Scenario, row: Row) -> str:
    """Return the line that runs a single run again."""
    import shlex

    seed = row["seed"]
    return shlex.join(
        [
            "flexaxis",
            "run",
            scenario.name,
            "--estimator",
            row["estimator"],
            "--seeds",
            f"{seed}:{seed + 1}",
            "-o",
            "results/one",
        ]
    )
