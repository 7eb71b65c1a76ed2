"""The HTML report of a run: one file that is readable, and can be played with, offline."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.catalogue.card import happens, in_a_line
from flexaxis.experiments.comparison import mismatch, ranking
from flexaxis.experiments.comparison.mismatch import track_of
from flexaxis.experiments.reporting import page
from flexaxis.experiments.reporting.charts import Chart
from flexaxis.experiments.reporting.run import first, measures, over_time, singles, speed, tables
from flexaxis.experiments.reporting.terminal import failures_in_words
from flexaxis.experiments.results.pooled import Pooled
from flexaxis.experiments.results.results import Results, Rows
from flexaxis.experiments.scoring.curves import Curve
from flexaxis.experiments.scoring.true_model import known_structure
from flexaxis.experiments.storage.files import SUMMARY, StudyError
from flexaxis.sim.scenario import Scenario, scenario_from

TEMPLATE = "reporting/templates/run.html"
AT_FIRST = 9  # estimators that are shown unless others are asked for: more cannot be told apart
ON_THE_BOARD = 2  # of the best, in the first picture beside the reference and the recommended one
SMALL, LARGE = 3.0, 12.0  # MB: of a report of a few scenarios, and of the whole catalogue
FEW = 12  # scenarios
ALL = "1000"  # MB: nobody has a report as large
A_ROW = 1100  # bytes of a single run beside what opens: a row of a table, a point of a chart


@dataclass(frozen=True)
class Run:
    """What the report of a run is made of.

    Attributes
    ----------
    pooled : Pooled
    scenarios : mapping of str to Scenario
        Those that were run.
    order : sequence of str
        Estimators in the order of the one ranking.
    singles : Singles
        All runs.
    few : str
        Which estimators charts show at first, where these are not all.
    """

    pooled: Pooled
    scenarios: Mapping[str, Scenario]
    order: Sequence[str]
    singles: singles.Singles
    few: str = ""

    @classmethod
    def of(cls, results: Pooled) -> Run:
        """Return what there is of a run, its single runs from its folder."""
        summary = results.summary
        scenarios = {
            name: scenario_from(entry["definition"], source=name)
            for name, entry in summary["scenarios"].items()
        }
        order, aside = first.drawn_first(summary, AT_FIRST)
        alone = singles.Singles.of(Results.load(results.folder), order)
        for name, _ in alone.runs:
            if name not in scenarios:
                raise StudyError(
                    f"{results.folder}: its rows are of a scenario {name!r}, of which {SUMMARY} "
                    "says nothing: one of the two was changed"
                )
        return cls(results, scenarios, order, alone, aside)

    @property
    def summary(self) -> dict[str, Any]:
        """What stands in summary.json."""
        return self.pooled.summary

    @cached_property
    def wrong(self) -> set[tuple[str, str, str]]:
        """Whom neither words nor charts rank: their bias before the fault is over half its size."""
        return mismatch.misled(self.summary["rows"], self.scenarios)

    def curves(self, scenario: str) -> list[Curve]:
        """Return the curves over time of a scenario, in the order of the ranking."""
        place = {estimator: i for i, estimator in enumerate(self.order)}
        mine = [curve for curve in self.pooled.curves if curve.scenario == scenario]
        return sorted(mine, key=lambda curve: place.get(curve.estimator, len(place)))


def render(results: Pooled, *, size: float | None = None) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    results : Pooled
        As from `flexaxis.experiments.results.pooled.load`.
    size : float, optional
        How large it may be [MB]: single runs are left out of one that would be larger, and curves
        of estimators behind the ninth. 3 MB by default, 12 MB with more than twelve scenarios.
    """
    run = Run.of(results)
    most = 1e6 * ((SMALL if len(run.scenarios) <= FEW else LARGE) if size is None else size)
    content = _content(run)
    for drawn in (len(run.order), AT_FIRST):
        bare = len(page.render(TEMPLATE, content | _singles(run, drawn, {}, "")).encode())
        if bare <= 0.85 * most:
            break
    wanted, chosen, room = list(run.singles.wanted()), {}, most - bare
    for one, packed in singles.picks(run.singles, wanted, run.scenarios):
        room -= len(packed) + A_ROW
        if room < 0:
            break
        chosen[one] = packed
    left = _left(len(chosen), len(wanted), drawn < len(run.order))
    if left:
        words = ["flexaxis", "report", str(results.folder), "--size", ALL]
        left += f" All of it: {shlex.join(words)}"
    return page.render(TEMPLATE, content | _singles(run, drawn, chosen, left))


def _left(count: int, all_of_them: int, thinned: bool) -> str:
    """Return what is left out, for the size of the file."""
    said = [f"Only the first {AT_FIRST} of the ranking are drawn over time."] * thinned
    if count < all_of_them:
        best = ", the worst and the median of each estimator first" if count > 1 else ""
        said.append(
            f"{count} of {all_of_them} single runs can be opened{best}, for the size of this file."
        )
    return " ".join(said)


def _content(run: Run) -> dict[str, Any]:
    """Return what the template names, but for the single runs."""
    summary = run.summary
    equal = first.at_equal_noise(summary)
    return {
        "summary": summary,
        "order": run.order,
        "aside": run.order[AT_FIRST:],
        "few": run.few,
        "failed": len(summary.get("failures", [])),
        "failures": failures_in_words(summary.get("failures", [])),
        "answers": first.answers(summary),
        "by_fault": _by_fault(run),
        "findings": ranking.in_words(summary["as_set"]),
        "equal": equal,
        "equal_noise": tables.equal_noise(equal) if equal else None,
        "board": list(_on_the_board(run, equal)),
        "figures": [chart for each in CHARTS for chart in each(run)],
        "sections": [_section(name, run) for name in run.scenarios],
        "further": _further(run),
        "tracks": speed.tracks(run.scenarios),
        "mismatch": _mismatch(run),
        "glossary": measures.glossary(),
        "columns": measures.HEADINGS,
        "provenance": _provenance(run),
    }


def _by_fault(run: Run) -> list[str]:
    """Return a sentence a fault, and on those that are in no row at equal noise."""
    swept = run.summary.get("tradeoff")
    if not swept:
        return []
    words = {name: happens(scenario) for name, scenario in run.scenarios.items()}
    found = ranking.answers(swept["matched"], swept["faults"] | words)
    return found + first.not_compared(swept, run.summary["estimators"])


def _on_the_board(run: Run, equal: Mapping[str, Any] | None) -> Iterable[Chart]:
    """Yield the first picture: the reference, the recommended one and the best, at a fault."""
    names = [scenario for scenario, _ in equal["faults"]] if equal else []
    known = [run.scenarios[name] for name in [*names, *run.scenarios] if name in run.scenarios]
    for scenario in known:
        able = [
            n for n in run.order if n not in {who for s, _, who in run.wrong if s == scenario.name}
        ]
        best = [name for name in able if name not in ranking.CONTROLS][:ON_THE_BOARD]
        whom = {*best, ranking.REFERENCE, *({RECOMMENDED} & {*able})}
        mine = [curve for curve in run.curves(scenario.name) if curve.estimator in whom]
        chart = over_time.at_a_fault(mine, scenario) if mine else None
        if chart is not None:
            yield chart
            return


def speed_against_noise(run: Run) -> Iterator[Chart]:
    """Yield the curves over the knobs where they were swept, else a point an estimator."""
    swept, rows = run.summary.get("tradeoff"), run.summary["rows"]
    if swept and swept["points"]:
        yield speed.tradeoff(swept["points"], run.order)
    elif chart := speed.as_set(rows, run.order, run.wrong):
        yield chart


def distributions(run: Run) -> Iterator[Chart]:
    """Yield how often each comes how near to the bound, a chart a track."""
    rows = (row for runs in run.singles.runs.values() for one in runs for row in one.rows)
    yield from speed.shares(rows, run.scenarios, run.order, run.wrong)


def _section(name: str, run: Run) -> dict[str, Any]:
    scenario, place = run.scenarios[name], {e: i for i, e in enumerate(run.order)}
    rows = [row for row in run.summary["rows"] if row["scenario"] == name]
    rows.sort(key=lambda row: place.get(row["estimator"], len(place)))
    return {
        "name": name,
        "track": track_of(scenario),
        "card": scenario.card,
        "faults": in_a_line(scenario),
        "hash": run.summary["scenarios"][name]["hash"],
        "toml": scenario.to_toml(),
        "tables": tables.scores(rows, run.wrong),
    }


def _singles(
    run: Run, drawn: int, chosen: Mapping[singles.Single, str], left: str
) -> dict[str, Any]:
    """Return what can be opened of single runs, and for each scenario what opens them.

    That are its curves over time, of so many estimators, its single runs as points, and a table.
    """
    shown: Set[str] = {one.name for one in chosen}
    medians = {key: runs[len(runs) // 2].name for key, runs in run.singles.runs.items()}
    places = {}
    for name, scenario in run.scenarios.items():
        picks = {e: m for (s, e), m in medians.items() if s == name and m in shown}
        curves, place = run.curves(name)[:drawn], f"curves-{name}"
        over = [over_time.trajectories(curves, scenario, name=place, picks=picks)]
        points = singles.scatter(run.singles, name, shown, run.order, run.wrong)
        mine = [one for one in chosen if one.scenario == name]
        places[name] = {
            "over_time": over if curves else [],
            "points": [] if points is None else [points],
            "table": tables.single_runs(name, mine) if mine else None,
        }
    return {
        "singles": places,
        "picks": {one.name: text for one, text in chosen.items()},
        "left": left,
    }


def _further(run: Run) -> list[dict[str, Any]]:
    """Return the scenarios that were swept at equal noise, and not run otherwise."""
    swept = run.summary.get("tradeoff")
    if not swept:
        return []
    study = Results.load(run.pooled.folder).study
    known = [scenario_from(s, source="study.json") for s in study["tradeoff"]["scenarios"]]
    place = {estimator: i for i, estimator in enumerate(run.order)}
    points = sorted(swept["points"], key=lambda p: (place[p["estimator"]], p["std"] or 0.0))
    return [
        {
            "name": s.name,
            "track": track_of(s),
            "card": s.card,
            "faults": in_a_line(s),
            "toml": s.to_toml(),
            "table": tables.settings(s.name, [p for p in points if p["scenario"] == s.name]),
            "command": _sweep_of(s.name, study),
        }
        for s in known
        if s.name not in run.scenarios
    ]


def _sweep_of(name: str, study: Mapping[str, Any]) -> str:
    """Return the line that sweeps the knobs on a scenario again."""
    seeds = f"{study['seeds'][0]}:{study['seeds'][-1] + 1}"
    words = ["flexaxis", "tune", *study["tradeoff"]["estimators"]]
    return shlex.join([*words, "--seeds", seeds, "--sweep", name])


def _provenance(run: Run) -> list[str]:
    """Return with what, and on which machines, the rows were computed, each once."""
    rows = Rows(Results.load(run.pooled.folder), ("cost.versions", "cost.host"))
    made: dict[str, dict[str, None]] = {}
    for row in rows:
        if row["cost.versions"]:
            made.setdefault(row["cost.versions"], {})[row["cost.host"]] = None
    return [f"{what} on {', '.join(filter(None, hosts))}" for what, hosts in made.items()]


def _mismatch(run: Run) -> list[dict[str, Any]]:
    """Return who copes where a model is wrong: where its structure is known, and where not."""
    names, rows = mismatch.mismatched(run.scenarios), run.summary["rows"]
    there = {row["estimator"] for row in rows}
    estimators, cells = [n for n in run.order if n in there], mismatch.matrix(rows, names)
    wrong = {each for each in run.wrong if each[0] in names}
    found = []
    for title, known in (("Known structure", True), ("Unknown structure", False)):
        part = {
            name: track_of(run.scenarios[name])
            for name in names
            if known_structure(run.scenarios[name]) == known
        }
        if part:
            words = mismatch.mismatch_in_words(rows, run.summary["as_set"], [*part], wrong)
            table = tables.matrix(title.lower(), part, estimators, cells, wrong)
            found.append({"title": title, "words": words, "table": table})
    return found


CHARTS: Sequence[Callable[[Run], Iterable[Chart]]] = (
    speed_against_noise,
    distributions,
)  # fmt: skip
"""The charts of a run as a whole, in the order of the page: a new one is a function that yields it
(`run.pooled.rows` are the rows behind), and its name here."""
