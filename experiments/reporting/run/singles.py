"""Single runs in the report: what each did, found and scored, and the line that repeats it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.catalogue.names import tomls
from flexaxis.experiments.reporting.charts import Chart, Line, Panel, Pick
from flexaxis.experiments.reporting.old_results import Results, Rows, Traces
from flexaxis.experiments.reporting.page import packed
from flexaxis.experiments.reporting.run import over_time
from flexaxis.experiments.reporting.run.speed import Wrong, key, left_out
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.scoring.curves import CURVE_STEP, near_fault
from flexaxis.experiments.scoring.summary import Case as Trace
from flexaxis.sim.scenario import Scenario

Row = Mapping[str, Any]
Key = tuple[str, str]  # scenario and estimator

COLUMNS = (
    "case", "scenario", "estimator", "seed", "parameter", "changed", "lag", "lag_bound", "t10",
    "lag_null", "std", "bias", "score", "diverged", "lost_at",
)  # fmt: skip
MARKS = 30  # findings drawn; more are a hatching
TOLD = 8  # findings in words


@dataclass(frozen=True, eq=False)
class Single:
    """One run.

    Attributes
    ----------
    scenario, estimator : str
    seed : int
    rows : sequence of mapping
        Its scores, one row a parameter; those that changed first.
    """

    scenario: str
    estimator: str
    seed: int
    rows: Sequence[Row]

    @property
    def name(self) -> str:
        """What lines and buttons name as what they open."""
        return f"{self.scenario}/{self.estimator}/{self.seed}"

    @property
    def badness(self) -> float:
        """By which runs are ordered: the lag, without a fault the error; a lost run is worst."""
        first = self.rows[0]
        if first["diverged"]:
            return float("inf")
        return float((first["lag"] if first["changed"] else first["std"]) or 0.0)


@dataclass(frozen=True)
class Singles:
    """All runs behind a report, by scenario and estimator, the worst first.

    Attributes
    ----------
    runs : mapping
    traces : Traces
        What they are drawn from.
    """

    runs: Mapping[Key, list[Single]]
    traces: Traces

    @classmethod
    def of(cls, results: Results, order: Sequence[str]) -> Singles:
        """Return the runs of a folder that could be run; their estimators in a given order."""
        found: dict[Key, dict[int, list[Row]]] = {}
        for row in Rows(results, (*COLUMNS, "error")):
            if row["error"] is None:
                group = found.setdefault((row["scenario"], row["estimator"]), {})
                group.setdefault(row["seed"], []).append(row)
        place = {name: i for i, name in enumerate(order)}
        keys = sorted(found, key=lambda key: place.get(key[1], len(place)))
        runs = {key: _singles(key, found[key]) for key in keys}
        return cls(runs, Traces(results.folder))

    def wanted(self) -> Iterator[Single]:
        """Yield the runs as they are to be shown where not all can be: worst and median first."""
        for runs in self.runs.values():
            yield runs[0]
            if len(runs) > 1:
                yield runs[len(runs) // 2]
        for runs in self.runs.values():
            yield from (run for i, run in enumerate(runs) if i not in {0, len(runs) // 2})


def _singles(key: Key, group: Mapping[int, list[Row]]) -> list[Single]:
    found = [
        Single(*key, seed, sorted(rows, key=lambda row: not row["changed"]))
        for seed, rows in group.items()
    ]
    return sorted(found, key=lambda run: (-run.badness, run.seed))


def picks(
    singles: Singles, chosen: Sequence[Single], scenarios: Mapping[str, Scenario]
) -> Iterator[tuple[Single, str]]:
    """Yield some runs, each with what opens for it, packed.

    Parameters
    ----------
    singles : Singles
    chosen : sequence of Single
    scenarios : mapping of str to Scenario
    """
    known: dict[int, Trace] = {}
    read = ("", "")
    for run in chosen:
        scenario = scenarios[run.scenario]
        if read != (run.scenario, run.estimator):  # those of one estimator at a time
            read = run.scenario, run.estimator
            known = singles.traces.find(scenario.hash, run.estimator)
        yield run, packed(pick(run, scenario, known.get(run.seed)))


def pick(run: Single, scenario: Scenario, trace: Trace | None) -> Pick:
    """Return what opens for a run: what it found and scored, its command, its trajectory."""
    return Pick(
        title=f"{run.estimator} on {run.scenario}, seed {run.seed}",
        words=findings_in_words(trace),
        facts=[(row["parameter"], _scored(row)) for row in run.rows]
        + [("case", run.rows[0]["case"]), *_where(run.estimator)],
        command=command(run, scenario),
        charts=[chart(trace, scenario)] if trace is not None else [],
    )


def _where(estimator: str) -> list[tuple[str, str]]:
    """Return where the line runs, for an estimator whose path holds in one folder only."""
    path = estimator.partition(".py:")[0]
    if path == estimator or path.startswith(("/", "~")):
        return []
    return [("folder", f"run this line where {path}.py is found, as the run was started")]


def command(run: Single, scenario: Scenario) -> str:
    """Return the line that runs it again.

    A scenario that is not of the catalogue is named as a file: its definition is in the report.
    """
    known = _frozen(run.scenario) == scenario.hash
    words = ["flexaxis", "run", run.scenario if known else f"{run.scenario}.toml"]
    words += ["--estimator", run.estimator, "--seeds", f"{run.seed}:{run.seed + 1}"]
    return shlex.join([*words, "-o", f"results/{run.scenario}-{_slug(run.estimator)}-{run.seed}"])


def _slug(estimator: str) -> str:
    """Return an estimator as typed in letters that any file name takes.

    Examples
    --------
    >>> _slug("rpem-forgetting[forgetting=0.99]"), _slug("my/own.py:Mine")
    ('rpem-forgetting-forgetting-0.99', 'my-own.py-Mine')
    """
    return re.sub(r"[^A-Za-z0-9._-]+", "-", estimator).strip("-.")


@cache
def _frozen(name: str) -> str:
    """Return the hash of a scenario of the catalogue, empty for what is none."""
    return find_scenario(name).hash if name in tomls("scenarios") else ""


def _scored(row: Row) -> str:
    bound = row["lag_bound"]
    parts = []
    if row["changed"]:
        over = f" ({number(row['lag'] / bound, 2)} × bound)" if bound and row["lag"] else ""
        settled = "never settled" if row["t10"] is None else f"t10 {number(row['t10'])} s"
        parts += [f"lag {number(row['lag'])} s{over}", settled]
        parts += [f"score {number(row['score'])}"] if row["score"] is not None else []
    if row["std"] is not None:
        parts.append(f"before: std {number(row['std'])} %, bias {number(row['bias'])} %")
    lost = [f"lost at {number(row['lost_at'])} s"] if row["diverged"] else []
    return "; ".join([*lost, *parts])


def findings_in_words(trace: Trace | None) -> str:
    """Return what a run found, with time and size; of an estimator that finds nothing, that."""
    if trace is None:
        return ""
    found = trace.detail.findings
    if not found:
        return "It reports no findings."
    more = f"; and {len(found) - TOLD} more" if len(found) > TOLD else ""
    return f"Found: {'; '.join(_finding(each) for each in found[:TOLD])}{more}."


def _finding(found: Mapping[str, Any]) -> str:
    since = f" (since {found['onset']:.2f} s)" if found["onset"] < found["time"] else ""
    return f"at {found['time']:.2f} s {_named(found)}{since}"


def _named(found: Mapping[str, Any]) -> str:
    """Return what was named, and how much it changed."""
    names = found["parameters"]
    ratio = [*found["ratio"], *[None] * len(names)]
    each = [f"{n} × {r:.3g}" if r is not None else n for n, r in zip(names, ratio, strict=False)]
    return ", ".join(each) or (found["reason"] or "a change that no parameter explains")


def chart(trace: Trace, scenario: Scenario) -> Chart:
    """Return the trajectory of a run, what changed first, its residual last where there is one."""
    times, whole = scenario.times, scenario.times[::CURVE_STEP]
    panels = []
    for parameter in sorted(trace.names, key=lambda name: name not in trace.relative):
        i = trace.names.index(parameter)
        part: Any = whole, trace.curve[:, i].astype(float)
        near = trace.detail.near[:, i].astype(float)
        part = over_time.spliced(part, (times[near_fault(scenario)], near))
        line = Line(who=trace.estimator, x=part[0], y=part[1])
        lines = [over_time.truth_line(scenario, parameter), line]
        panels.append(Panel(y=f"{parameter} / nominal", lines=lines))
    if (residual := trace.detail.residual) is not None:
        line = Line(who=trace.estimator, x=whole, y=residual.astype(float))
        panels.append(Panel(y=f"residual, rms of {CURVE_STEP} [rad/s]", lines=[line]))
    around = over_time.around(scenario)
    findings = trace.detail.findings[:MARKS]
    around["marks"] += [(each["time"], f"found: {_named(each)}") for each in findings]
    return Chart(
        title="This run",
        words="Truth dashed; lines stand where something changes, and where something was found.",
        x="time [s]",
        panels=panels,
        **around,
    )


def scatter(
    singles: Singles, scenario: str, shown: Set[str], order: Sequence[str], wrong: Wrong
) -> Chart | None:
    """Return lag over noise of each run on a scenario; a point opens it. None without a fault.

    Parameters
    ----------
    singles : Singles
    scenario : str
    shown : set of str
        Names of the runs that can be opened.
    order : sequence of str
        Estimators, the best first.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`: these are not drawn.
    """
    lines = []
    for estimator in order:
        runs = [r for r in singles.runs.get((scenario, estimator), ()) if _has_a_point(r, wrong)]
        closed = [run for run in runs if run.name not in shown]
        lines += [_point(estimator, [run], run.name) for run in runs if run.name in shown]
        lines += [_point(estimator, closed, "")] if closed else []
    if not lines:
        return None
    return Chart(
        name=f"runs-{scenario}",
        title=f"Single runs on {scenario}",
        words="A point is a run, as the estimators are set; a click, or Enter, opens it."
        + left_out({each for each in wrong if each[0] == scenario}),
        x="std before the fault [% of nominal]",
        panels=[Panel(y="lag [s]", y_log=True, lines=lines)],
        x_log=True,
    )


def _has_a_point(run: Single, wrong: Wrong) -> bool:
    first = run.rows[0]
    able = first["changed"] and first["lag"] and (first["std"] or 0.0) > 1e-9
    return bool(able and key(first) not in wrong)


def _point(who: str, runs: Sequence[Single], name: str) -> Line:
    x, y = np.array([[r.rows[0]["std"], r.rows[0]["lag"]] for r in runs], float).T
    label = f"{who}, seed {runs[0].seed}" if name else ""
    return Line(who=who, x=x, y=y, kind="points", pick=name, label=label)
