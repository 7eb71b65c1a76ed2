"""Write the report of a run: first the main result, and then a section for each scenario."""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import pandas as pd
from markupsafe import Markup

from flexaxis.experiments.catalogue.card import in_a_line
from flexaxis.experiments.comparison.ranking import REFERENCE, faults_of, widest
from flexaxis.experiments.reporting import figures, page, sentences, tables
from flexaxis.experiments.reporting.styles import assigned
from flexaxis.experiments.reporting.terminal import equal_noise_table
from flexaxis.experiments.running.results import Results
from flexaxis.experiments.scoring.score_table import SCORES
from flexaxis.sim.scenario import Scenario, scenario_from

MANY = 32  # largest number of single runs that are shown per estimator and scenario
SINGLE = ("estimator", "seed", "lag", "over_bound", "t10", "std", "bias", "score", "diverged")


def render(results: Results, summary: Mapping[str, Any]) -> str:
    """Return the report of a run as HTML.

    Parameters
    ----------
    results : Results
        Results of the run.
    summary : mapping
        Content of summary.json.
    """
    title, facts = sentences.answer(summary)
    rows = tables.flat(summary["rows"])
    drawing = Drawing(results, summary)
    return page.render(
        "reporting/templates/run.html",
        title=title,
        facts=facts,
        summary=summary,
        looks=drawing.looks,
        warning=sentences.warning(summary["rows"], summary["scenarios"]),
        failures=sentences.failures_in_words(summary["failures"]),
        board=drawing.board(),
        defaults=list(drawing.defaults()),
        sections=[drawing.section(name, rows) for name in drawing.scenarios],
        columns=tables.COLUMNS,
        scores=SCORES,
        reference=REFERENCE,
    )  # fmt: skip


class Drawing:
    """The figures and tables in the report of a run."""

    def __init__(self, results: Results, summary: Mapping[str, Any]) -> None:
        self.results, self.swept = results, summary.get("tradeoff") or {}
        self.looks = assigned(sentences.order_of(summary))
        self.draw = partial(page.drawn, looks=self.looks)
        known = {name: entry["definition"] for name, entry in summary["scenarios"].items()}
        known |= self.swept.get("definitions", {})  # scenarios that were run only at equal noise
        self.scenarios = {name: scenario_from(each, source=name) for name, each in known.items()}
        runs = results.frame[results.frame["error"].isna()]
        self.runs = runs.assign(over_bound=runs["lag"] / runs["lag_bound"])

    def board(self) -> dict[str, Any] | None:
        """Return the top section of the report, or None if no results at equal noise exist."""
        swept = self.swept
        if not swept.get("matched"):
            return None
        faults, matched = sentences.fault_words(swept), faults_of(swept["matched"])
        order = [name for name in self.looks if name in set(matched["estimator"])]
        points, fault = faults_of(swept["points"]), widest(matched)
        nearest = matched[matched["fault"] == fault].set_index("estimator")["nearest"].to_dict()
        name, parameter = fault.split(": ")
        return {
            "over_bound": self.draw(figures.over_bound, "lag over bound", matched, order, faults),
            "table": equal_noise_table(swept),
            "speed": self.draw(figures.speed_noise, "lag against noise", points, faults),
            "fault": (faults[fault], fault),
            "estimates": self.over_time(self.scenarios[name], parameter, nearest, "equal noise"),
        }

    def over_time(
        self, scenario: Scenario, name: str, settings: dict[str, str], label: str = "default"
    ) -> list[Markup]:
        """Return figures of the median estimates of a parameter over time.

        If the scenario contains a fault, the first figure covers the first second after the fault.
        The last figure covers the whole run. The curves of the first estimator and of the reference
        estimator have quantile bands.
        """
        traces, drawn, windows = {}, [], [(0.0, scenario.duration)]
        banded = (next(iter(settings)), REFERENCE)
        for who, setting in reversed(settings.items()):
            own = self.results.traces(scenario.hash, setting)
            if any(name in run.names for run in own.values()):
                traces[who] = own
        for event in scenario.events()[:1]:
            at = event.index * scenario.period
            windows.insert(0, (at - 0.1, at + 1.0))
        for window in windows if traces else ():
            series = figures.medians(traces, scenario, name, window, banded=banded)
            panels, x = {f"{name} / nominal": series}, "time [s]"
            text = f"{name} of {scenario.name} from {window[0]:.4g} s, {label}"
            drawn.append(self.draw(figures.curves, text, panels, x=x, limits={x: window},
                                   **figures.around(scenario)))  # fmt: skip
        return drawn

    def defaults(self) -> Iterator[tuple[str, Markup]]:
        """Yield a heading and a figure of the results of estimators with default settings."""
        if (self.runs["lag_bound"] > 0).any():
            drawn = self.draw(figures.shares, "share of runs", self.runs)
            yield "Distribution of the ratio of lag to lag bound over all runs", drawn

    def section(self, name: str, rows: pd.DataFrame) -> dict[str, Any]:
        """Return the content of the report section for one scenario.

        If the scenario was run only at equal noise, the section contains no scores.
        """
        scenario, own = self.scenarios[name], rows[rows["scenario"] == name]
        happens = sentences.happens(scenario.resolved())
        section = {"scenario": scenario, "happens": happens, "line": in_a_line(scenario)}
        if own.empty:
            return section | {"table": None}
        own = own.sort_values(["changed", "parameter"], ascending=[False, True], kind="stable")
        settings = {who: who for who in self.looks}
        drawn = [figure for parameter in own["parameter"].unique()
                 for figure in self.over_time(scenario, parameter, settings)]  # fmt: skip
        heads = {"estimator": "estimator", "parameter": "parameter"} | tables.COLUMNS
        table = tables.table(f"{name} scores", own, heads)
        return section | {"figures": drawn, "table": table} | self._runs(name)

    def _runs(self, name: str) -> dict[str, Any]:
        """Return a figure and a table of a scenario's single runs; the worst runs come first."""
        runs = self.runs.sort_values(["changed", "diverged", "lag", "std"], ascending=False)
        runs = runs[runs["scenario"] == name].drop_duplicates(["estimator", "seed"])
        shown = runs.groupby("estimator").head(MANY)
        label = f"runs of {name}"
        heads = {column: tables.COLUMNS.get(column, column) for column in SINGLE}
        return {
            "points": self.draw(figures.lag_against_noise, label, shown),
            "runs": tables.table(label, shown, heads),
            "worst": runs.head(1).to_dict("records"),
        }
