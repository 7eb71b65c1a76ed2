"""The tables in the report of a run: at equal noise, scores as set, settings, where models fail."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from flexaxis.estimators import RECOMMENDED
from flexaxis.experiments.comparison import ranking
from flexaxis.experiments.reporting.run.measures import Pooled, measures, over_bound, t10
from flexaxis.experiments.reporting.run.speed import Wrong, key
from flexaxis.experiments.reporting.tables import (
    Cell,
    Column,
    Row,
    Table,
    number,
    pair,
    scored,
)

FIRST = ("lag", "over_bound", "t10", "std", "bias", "score", "diverged", "false_alarms")
"""What is seen without asking where something changes, in this order."""

FIRST_WITHOUT_FAULT = ("std", "bias", "excess", "nees", "diverged", "false_alarms")
FIRST_UNCHANGED = ("cross_talk", "std", "bias", "std_after", "diverged")
OF_A_CASE = ("excess", "nees", "nis", "whiteness", "alarms", "false_alarms", "cost")
"""The same in all rows of a case, and shown beside what changed."""

NEEDS_A_FAULT = ("lag", "over_bound", "t10", "score", "never_settled", "efficiency", "delay")


def scores(rows: Sequence[Pooled], wrong: Wrong = frozenset()) -> list[Table]:
    """Return the tables of a scenario: first of what changed, folded away what did not.

    Parameters
    ----------
    rows : sequence of mapping
        Pooled rows of one scenario.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`: their lags stand in brackets.
    """
    changed = [row for row in rows if row["changed"]]
    rest = [row for row in rows if not row["changed"]]
    if not rows:
        return []
    name = rows[0]["scenario"]
    if not changed:
        return [_scores(name, rest, FIRST_WITHOUT_FAULT, without=NEEDS_A_FAULT)]
    found = [_scores(name, changed, FIRST, without=("cross_talk",), wrong=wrong)]
    if rest:
        said = f"Parameters that did not change ({len(rest)} row{'s'[: len(rest) != 1]})"
        without = (*NEEDS_A_FAULT, *OF_A_CASE)
        table = _scores(f"{name}-unchanged", rest, FIRST_UNCHANGED, without=without)
        found.append(replace(table, folded=said))
    return found


def _scores(
    name: str,
    rows: Sequence[Pooled],
    first: Sequence[str],
    *,
    without: Sequence[str],
    wrong: Wrong = frozenset(),
) -> Table:
    """Return a table of pooled rows: what comes first, and all else there is on demand."""
    known = measures()
    shown = [*first, *(n for n in known if n not in first and n not in without)]
    columns = [Column(known[n].heading, known[n].name, more=n not in first) for n in shown]
    lines = []
    for row in rows:
        cells = [known[n].of(row) for n in shown]
        if key(row) in wrong:
            cells[0] = replace(cells[0], text=f"({cells[0].text})", mark="()")
        cells = [Cell(row["estimator"]), Cell(row["parameter"]), *cells]
        lines.append(Row(cells, who=row["estimator"], kind="lost" if row["diverged"] else ""))
    heads = [Column("estimator", kind="text"), Column("parameter", kind="text")]
    return Table(name, [*heads, *columns], lines)


def equal_noise(equal: Mapping[str, Any]) -> Table:
    """Return the first table: the lag of each estimator at each fault, and one number over all.

    Parameters
    ----------
    equal : mapping
        As from `flexaxis.experiments.reporting.run.first.at_equal_noise`.
    """
    faults, words = equal["faults"], equal["words"]
    columns = [Column("estimator", kind="text")]
    for scenario, parameter in faults:
        what = words.get(scenario, parameter)
        columns.append(Column(scenario, "lag", under=f"{what}, lag [s]",
                              name=f"{scenario} {what} lag [s]", link=scenario))  # fmt: skip
    if equal["overall"]:
        columns.append(
            Column("score", "score", under="all faults, at equal excess error", down=True)
        )
    for scenario, _ in faults:
        columns += [
            Column(f"{scenario}: × bound", "× bound", more="again"),
            Column(f"{scenario}: std after [%]", "std after", more=True),
            Column(f"{scenario}: false alarms [1/1000 s]", "false alarms", more=True),
        ]
        if equal["at_excess"]:
            columns.append(Column(f"{scenario}: lag at equal excess error [s]", "lag", more=True))
    rows = [Row(_at_equal_noise(equal, who), who=who) for who in equal["estimators"]]
    return Table("at-equal-noise", columns, rows)


def called(who: str) -> Cell:
    """Return an estimator, with what there is to know of its part."""
    roles = {RECOMMENDED: "\nrecommended", ranking.REFERENCE: "\nthe paper’s"}
    roles |= dict.fromkeys(ranking.CONTROLS, "\na control")
    return Cell(who, within=roles.get(who, ""))


def _at_equal_noise(equal: Mapping[str, Any], who: str) -> list[Cell]:
    mine = [equal["rows"].get((*fault, who)) for fault in equal["faults"]]
    cells = [called(who), *map(_lag, mine)]
    if equal["overall"]:
        cells.append(_overall(equal["overall"].get(who)))
    for fault, row in zip(equal["faults"], mine, strict=True):
        names = ("over_bound", "std_after", "false_alarms_per_1000_s")
        cells += [scored(row and row[name], digits=2) for name in names]
        if equal["at_excess"]:
            cells.append(_lag(equal["at_excess"].get((*fault, who)), plain=True))
    return cells


def _lag(row: Pooled | None, *, plain: bool = False) -> Cell:
    if row is None or row["lag"] is None:
        return Cell("–", "")
    sign = ranking.AT_MOST.get(row["how"], "")
    star = "★ " if row.get("leads") and not plain else ""
    text = f"{star}{sign}{number(row['lag'])}"
    if plain:
        return Cell(text, row["lag"])
    over = f"{number(row['over_bound'], 2)} × bound" if row["over_bound"] else ""
    within = f"{over}\n{pair(row['lag_interval'])}"
    return Cell(text, row["lag"], within, row["lag_interval"], f"{star}{sign}".strip())


def _overall(row: Pooled | None) -> Cell:
    if row is None:
        return Cell("–", "")
    sign, star = ranking.AT_LEAST.get(row["how"], ""), "★ " if row["leads"] else ""
    ends, text = row["score_interval"], f"{star}{sign}{row['score']:.0f}"
    return Cell(text, row["score"], f"\n{pair(ends)}", ends, f"{star}{sign}".strip())


def settings(name: str, points: Sequence[Pooled]) -> Table:
    """Return every setting of a knob that was tried on a scenario."""
    columns = [
        Column("estimator", kind="text"), Column("setting", kind="text"),
        Column("parameter", kind="text"), Column("lag [s]", "lag"), Column("std [%]", "std"),
        Column("t10 [s]", "t10"), Column("std after [%]", "std after"), Column("lost", "diverged"),
    ]  # fmt: skip
    rows = [
        Row(
            [
                Cell(p["estimator"]), Cell(p["setting"]), Cell(p["parameter"]),
                scored(p["lag"], within=pair(p["lag_interval"])),
                scored(p["std"], within=pair(p["std_interval"])), t10({**p, "changed": True}),
                scored(p["std_after"]), Cell(f"{p['diverged']} of {p['seeds']}", p["diverged"]),
            ],
            who=p["estimator"],
        )
        for p in points
    ]  # fmt: skip
    return Table(f"{name}-settings", columns, rows)


def matrix(
    title: str,
    names: Mapping[str, str],
    estimators: Sequence[str],
    found: Mapping[tuple[str, str], Pooled],
    wrong: Wrong,
) -> Table:
    """Return who copes how with scenarios that a model does not describe.

    Parameters
    ----------
    title : str
    names : mapping of str to str
        The track of each scenario.
    estimators : sequence of str
    found : mapping
        As from `flexaxis.experiments.comparison.mismatch.matrix`.
    wrong : set of (str, str, str)
        As from `flexaxis.experiments.comparison.mismatch.misled`.
    """
    columns = [Column("scenario", kind="text")]
    columns += [Column(who, name=f"{who} lag [s]", who=who) for who in estimators]
    rows = [
        Row([Cell(n, link=n), *(_coped(found.get((n, who)), who, wrong) for who in estimators)],
            group=track)
        for n, track in names.items()
    ]  # fmt: skip
    return Table(title, columns, rows)


def _coped(row: Pooled | None, who: str, wrong: Wrong) -> Cell:
    if row is None:
        return Cell("–", "", who=who)
    misled = key(row) in wrong
    lag = "–" if row["lag"] is None else f"{number(row['lag'], 2)} s"
    said = f"\n{row['parameter']} {number(row['bias'], 2)} ± {number(row['std'], 2)} %"
    if row.get("bias_after") is not None:
        said += f", after {number(row['bias_after'], 2)} %"
    if row.get("detection"):
        said += f"\n{number(row['detection']['false_alarms_per_1000_s'], 2)} false alarms"
    if row["diverged"]:
        said += f"\n{row['diverged']} of {row['seeds']} lost"
    value = "" if row["lag"] is None else row["lag"]
    text = f"({lag})" if misled and row["lag"] is not None else lag
    return Cell(text, value, said, mark="()" if misled else "", who=who)


def single_runs(name: str, runs: Sequence[Any]) -> Table:
    """Return single runs, each with what opens it, by its first row."""
    columns = [
        Column("estimator", kind="text"), Column("seed", "seed", kind="text"), Column("lag [s]"),
        Column("× bound"), Column("t10 [s]"), Column("std [%]"), Column("bias [%]"),
        Column("score"), Column("lost"),
    ]  # fmt: skip
    rows = []
    for run in runs:
        row = run.rows[0]
        cells = [Cell(run.estimator), Cell(str(run.seed), opens=run.name), scored(row["lag"])]
        cells += [over_bound(row), t10(row), scored(row["std"]), scored(row["bias"])]
        cells += [scored(row["score"]), Cell("lost" if row["diverged"] else "", row["diverged"])]
        rows.append(Row(cells, who=run.estimator))
    return Table(f"{name}-runs", columns, rows)
