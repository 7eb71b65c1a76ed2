"""Write the tables of the documentation anew: `make docs-tables`, or `python docs/tables.py`.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`, and everything in it comes out of
a command: what was run, at which commit and on which seeds is said below it. With names of tables
only these are written; `results/headline` and `results/self-test.json` are made if they are
missing, and again with `--fresh`.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from digests import ROOT, git, stamp

from flexaxis.estimators.registry import REGISTRY
from flexaxis.estimators.tuned import tunings
from flexaxis.experiments.catalogue.find import find_scenario, scenario_names
from flexaxis.experiments.catalogue.names import DRAWN, GROUPS
from flexaxis.experiments.comparison.ranking import AT_LEAST, AT_MOST, CONTROLS
from flexaxis.experiments.gate import selftest
from flexaxis.experiments.reporting.tables import number
from flexaxis.experiments.scoring.score_table import SCORES

PAGES = ("README.md", "docs/scenarios.md", "docs/scores.md", "docs/gate.md")
RESULTS = ROOT / "results"
SELF_TEST = RESULTS / "self-test.json"
SEEDS = 20
RUN = f"flexaxis run headline --seeds {SEEDS}"
MARK = re.compile(r"<!-- table: ([\w-]+) -->\n(.*?)<!-- end -->", re.DOTALL)

VERSION = "-v2"  # of the scenarios in the suite, and so in the run that the tables are of
SWEPT = tuple(f"{name}{VERSION}" for name in ("fm_step", "fm_double", "ja_step", "kt_step"))
WRONG = tuple(
    f"{name}_fm_step{VERSION}" for name in ("coulomb", "lugre", "cogging", "backlash", "told_kg")
)
FEW = ("glr", "rpem-forgetting", "ekf", "imm", "cusum-reset")
CODE = ("models_mjcf", "sim", "estimators", "experiments", "docs/*.py")
FRESH = "--fresh" in sys.argv[1:]

Row = Mapping[str, Any]


def catalogue() -> str:
    """Return what scenarios there are, by group."""
    groups: dict[str, list[str]] = {group: [] for group in GROUPS}
    for name in (name for name in scenario_names() if not name.endswith(DRAWN)):
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


def self_test() -> str:
    """Return how often the gate is wrong, and what it finds."""
    if not SELF_TEST.exists() or FRESH:
        SELF_TEST.parent.mkdir(exist_ok=True)
        at = commit()
        rows = json.loads(call("compare", "--self-test", "--json"))["rates"]
        SELF_TEST.write_text(json.dumps({"commit": at, "rows": rows}), encoding="utf-8")
    content = json.loads(SELF_TEST.read_text(encoding="utf-8"))
    made = f"`flexaxis compare --self-test`, commit {content['commit']}."
    rows = content["rows"]
    return f"{table(selftest.columns(rows), selftest.lines(rows))}\n{made}\n"


TABLES: Mapping[str, Callable[[], str]] = {
    "catalogue": catalogue,
    "scores": scores,
    "tuned": tuned,
    "equal-noise": equal_noise,
    "mismatch": mismatch,
    "self-test": self_test,
}


@cache
def summary(folder: str, *words: str) -> Any:
    """Return the summary of a run in a folder of results, which is made where it is not there."""
    place = RESULTS / folder
    if not (place / "summary.json").exists() or FRESH:
        at = commit()
        call("run", *words, "-o", str(place), "--overwrite")
        (place / "commit").write_text(at, encoding="utf-8")
    return json.loads((place / "summary.json").read_text(encoding="utf-8"))


def commit_of(folder: str) -> str:
    """Return at which commit a run was made, and the digest."""
    return (RESULTS / folder / "commit").read_text(encoding="utf-8")


def headline() -> Any:
    """Return the summary of the run that most tables of these pages are made of."""
    return summary("headline", *RUN.split()[2:])


def call(*words: str) -> str:
    """Run a command of flexaxis, its progress on the terminal, and return what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "flexaxis.experiments", *words], stdout=subprocess.PIPE, check=False
    )
    if done.returncode not in (0, 1):
        sys.exit(f"flexaxis {' '.join(words)} ended with status {done.returncode}")
    return done.stdout.decode()


def said(what: str) -> str:
    """Return the line below a table of the run: what it is, and how it was made."""
    words = f"{what[:1].upper()}{what[1:]}. " if what else ""
    return f"\n{words}`{RUN}`, commit {commit_of('headline')}, seeds 1000 to {999 + SEEDS}.\n"


def commit() -> str:
    """Return commit and digest of what is here; a table of code that is in none is refused."""
    if changed := git("status", "--porcelain", "--", *CODE).decode():
        sys.exit(f"a table says of which commit it is: commit this first\n{changed}")
    return f"{git('rev-parse', '--short=8', 'HEAD').decode().strip()}, digest {stamp()}"


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(_cell(c) for c in line)} |\n" for line in lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _name(estimator: str) -> str:
    return f"`{estimator}`" + (" (a control)" if estimator in CONTROLS else "")


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


def write(page: Path, tables: Mapping[str, Callable[[], str]], words: Sequence[str] = ()) -> None:
    """Write the tables of a page that words of the command line name, all if none does."""
    wanted = [word for word in words if not word.startswith("--")] or list(tables)
    if wrong := set(wanted) - set(tables):
        sys.exit(f"no table {min(wrong)!r}: {', '.join(tables)}")
    text = page.read_text(encoding="utf-8")
    for name in set(wanted) & {name for name, _ in MARK.findall(text)}:
        whole = f"<!-- table: {name} -->\n{tables[name]()}<!-- end -->"
        text = MARK.sub(lambda m, n=name, w=whole: w if m[1] == n else m[0], text)
    page.write_text(text, encoding="utf-8")
    print(f"{page.relative_to(ROOT)}: {', '.join(wanted)}", flush=True)


if __name__ == "__main__":
    for path in PAGES:
        write(ROOT / path, TABLES, sys.argv[1:])
