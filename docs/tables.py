"""Write the tables of docs/scenarios.md and scores.md: `python docs/tables.py [NAME …]`.

The line below each table names the run, the version and the seeds. `catalogue`, `scores` and
`tuned` list what the package has, and take a second.
"""

import sys
from collections.abc import Callable, Mapping
from typing import Any

from making import ROOT, VERSION, table, write
from suite_rows import summary

from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import tunings
from flexaxis.experiments.catalogue.find import find_scenario, find_suite, scenario_names
from flexaxis.experiments.catalogue.names import GROUPS
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, CONTROLS
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.scoring.score_table import SCORES

PAGES = ("docs/scenarios.md", "docs/scores.md")
SEEDS = 20
RUN = f"flexaxis run headline --seeds {SEEDS}"
UKF = "ukf"  # docs/examples/ukf.py, an own estimator

TWIN = "-v2"  # suffix of the scenarios in the suite: their onsets are drawn
SWEPT = tuple(f"{name}{TWIN}" for name in ("fm_step", "fm_double", "ja_step", "kt_step"))
WRONG = tuple(
    f"{name}_fm_step{TWIN}" for name in ("coulomb", "lugre", "cogging", "backlash", "told_kg")
)
FEW = ("glr", "rpem-forgetting", "ekf", "imm", "cusum-reset")

Row = Mapping[str, Any]


def catalogue() -> str:
    """Return what scenarios there are, by group."""
    groups: dict[str, list[str]] = {group: [] for group in GROUPS}
    for name in scenario_names():
        groups[find_scenario(name).group or ""].append(f"`{name}`")
    rows = [[group, GROUPS[group], ", ".join(names)] for group, names in groups.items()]
    return table(["group", "what happens", "scenarios"], rows)


def scores() -> str:
    """Return what each score is."""
    rows = [
        [
            f"`{s.name}`",
            s.unit or "",
            {"less": "less", "more": "more"}.get(s.better or "", ""),
            s.words,
        ]
        for s in SCORES.values()
    ]
    return table(["score", "unit", "better", "what it is"], rows)


def tuned() -> str:
    """Return the knob of each estimator: its default, and its value at equal noise."""
    rows = []
    for entry in REGISTRY.values():
        found = [t for t in tunings() if t.estimator == entry.name]
        knob = entry.turning
        names = knob.names if knob else ()
        default = ", ".join(f"{entry.options[name]:.6g}" for name in names) or "–"
        elsewhere = "–" if entry.default is None else f"{entry.default:.6g}"
        along = knob and found and knob.at(knob.position(found[0].value))
        matched = ", ".join(f"{value:.6g}" for value in (along or {}).values()) or "–"
        values = [default, elsewhere, matched]
        rows.append([f"`{entry.name}`", knob.label if knob else "–", *values, entry.summary])
    heads = ["default on n1", "default elsewhere", "at equal excess error on n1"]
    return table(["estimator", "knob", *heads, "what it does"], rows)


def equal_noise() -> str:
    """Return the lag of every estimator at equal std of the parameter that changes."""
    summary = headline()
    matched = {
        (r["scenario"], r["estimator"]): r
        for r in summary["tradeoff"]["matched"]
        if r["scenario"] in SWEPT
    }
    whole = {r["estimator"]: r for r in summary["tradeoff"]["overall"]}
    names = sorted({key[1] for key in matched}, key=lambda n: list(whole).index(n))
    heads = ["estimator", *(f"{s}: lag [s], × bound" for s in SWEPT), "score at equal excess error"]
    rows = [
        [_name(n), *(_lag(matched.get((s, n))) for s in SWEPT), _score(whole[n])] for n in names
    ]
    return table(heads, rows) + said(
        "lag where the std of the parameter that changes is, before the fault, that of "
        "`rpem-forgetting` with λ = 0.995; 95 % interval; **bold**: the best, and all that paired "
        "seeds cannot tell from it; ≤, ≥: quieter, or noisier, than that at every setting",
    )


def mismatch() -> str:
    """Return bias and deviation of f_m, and the deviation of k_T, where the model is wrong."""
    cells = {(r["scenario"], r["estimator"], r["parameter"]): r for r in headline()["rows"]}
    rows = []
    for name in WRONG:
        line = [f"`{name}`"]
        for estimator in FEW:
            f_m, k_T = (cells[name, estimator, p] for p in ("f_m", "k_T"))
            line.append(f"{f_m['bias']:.2g} ± {f_m['std']:.2g}; {k_T['std']:.2g}")
        rows.append(line)
    heads = ["scenario", *(f"`{name}`" for name in FEW)]
    return table(heads, rows) + said(
        "bias ± std of f_m; std of k_T, before the fault, in % of nominal, as set"
    )


TABLES: Mapping[str, Callable[[], str]] = {
    "catalogue": catalogue,
    "scores": scores,
    "tuned": tuned,
    "equal-noise": equal_noise,
    "mismatch": mismatch,
}


def headline() -> Any:
    """Return the summary of the run that most tables of these pages are made of."""
    names = [*find_suite("headline").estimators, f"{ROOT / 'docs/examples/ukf.py'}:Ukf"]
    chosen = (word for name in names for word in ("--estimator", name))
    return summary(*RUN.split()[2:], *chosen)


def said(what: str) -> str:
    """Return the line below a table of the run: what it is, and how it was made."""
    words = f"{what[:1].upper()}{what[1:]}. " if what else ""
    return f"\n{words}`{RUN}`, {VERSION}, seeds 1000 to {999 + SEEDS}.\n"


def _name(estimator: str) -> str:
    name = UKF if estimator.endswith(":Ukf") else estimator
    return f"`{name}`" + (" (a control)" if name in CONTROLS else "")


def _lag(row: Row | None) -> str:
    if row is None or row["lag"] is None:
        return "–"
    sign = AT_MOST.get(row["how"], "")
    value = f"{sign}{row['lag']:.3g}"
    if row["leads"]:
        value = f"**{value}**"
    if row["lag_interval"] and row["how"] == "matched":
        value += " ({:.3g} … {:.3g})".format(*row["lag_interval"])
    return value + (f", {number(row['over_bound'], 2)}" if row["over_bound"] else "")


def _score(row: Row) -> str:
    sign = AT_LEAST.get(row["how"], "")
    value = f"{sign}{row['score']:.0f}"
    if row["leads"]:
        value = f"**{value}**"
    if row["score_interval"]:
        value += " ({:.0f} … {:.0f})".format(*row["score_interval"])
    return value


if __name__ == "__main__":
    for path in PAGES:
        write(ROOT / path, TABLES, sys.argv[1:])
