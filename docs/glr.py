"""Measure estimators beside the bound, and write the tables of docs/glr.md: `python docs/glr.py`.

    python docs/glr.py --table linear --table friction --estimator glr --estimator mine.py:Class
    python docs/glr.py --seeds 0:10 --print        # for tuning: tables on the terminal

Rows of each run are kept in the folder `--store`, by scenario, seed, estimator and the code of
the package, so that nothing is computed twice. Estimators that are no longer there stand in
the tables all the same: their pooled rows are in docs/data/glr.csv, where `--keep` puts them.
"""

import argparse
import json
import pickle
import sys
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from glr_cases import CASES
from glr_own import OWN, run_own
from glr_pool import first, keep, number, of_lags, paired, pooled, rate, share, stored
from glr_runs import AGES, Row, run
from making import VERSION, write
from making import table as markdown
from speed_steps import PERCENTILES, time_steps
from speed_streams import make_stream

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.comparison.sweep import sweep
from flexaxis.experiments.running.estimators import build, parse
from flexaxis.experiments.running.run import Runner
from flexaxis.experiments.running.store import made_with

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "glr.md"
SEEDS = {"linear": 40, "excess": 40, "isolation": 10, "ground": 10, "starts": 10}
"""Seeds of a table, from 1000 on; of any other twenty."""
SIZES = {3: ("linear", ()), 8: ("linear", ("J_m", "k_g", "k_a", "d_g", "d_a")),
         20: ("friction", ("J_m", "k_g", "k_a", "d_g", "d_a"))}  # fmt: skip
"""Axes that steps are timed on, and what is identified besides, by the number of parameters; the
last are those that estimators with laws of friction learn."""

BUDGETS = [f"glr[budget={n}]" for n in (8, 16, 32, 64, 1_000_000)]
"""How many samples are gone through again in one; with the last, all at once."""
ASKED = {"budget": BUDGETS, "quiet": ["glr"], "isolation": ["glr"],
         "starts": ["glr", "glr[spread=1]"]}  # fmt: skip
"""Estimators of a table; of any other `rpem-forgetting` and `glr`."""


def kept(key: str, make: Callable[[], Row], folder: Path) -> Row:
    """Return what is stored under a key, made where it is not there; an error is a result."""
    name = sha256(key.encode()).hexdigest()[:24]
    path = folder / name[:2] / f"{name}.json"
    if not path.exists():
        try:
            found = make()
        except (OSError, MemoryError):  # which are of the machine
            raise
        except Exception as error:  # whatever else it raises counts against it
            found = {"error": f"{type(error).__name__}: {str(error)[:200]}"}
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{time.time_ns()}")
        part.write_text(json.dumps(found, default=float), encoding="utf-8")
        part.replace(path)
    found = json.loads(path.read_text(encoding="utf-8"))
    return dict(found)


def job(task: tuple[str, str, str, int, Path]) -> Row:
    """Return one run of a table's case, an estimator and a seed, which need not be made anew."""
    table, name, text, seed, folder = task
    warnings.simplefilter("ignore")  # an estimator that is lost may overflow: its row says so
    key = f"{text} {parse(text).digest} {made_with()['code']} {seed} "
    case = next((c for c in CASES[table] if c.name == name), None)
    if case is None:
        return kept(f"{key} own {name}", partial(run_own, name, text, seed), folder)
    key += f"{case.scenario.hash} {case.spoilt}"
    return kept(key, partial(run, case, text, seed, folder), folder)


def names_of(table: str) -> list[str]:
    """Return the cases of a table, in order."""
    names = [case.name for case in CASES["linear" if table == "excess" else table]]
    return [*names, *(o.name for o in OWN if table == "ground")]


def seeds_of(table: str) -> str:
    """Return the seeds of a table."""
    return f"1000:{1000 + SEEDS.get(table, 20)}"


def measured(table: str, texts: Sequence[str], seeds: range, given: Any) -> list[Row]:
    """Return the pooled rows of a table, all runs made that are not stored yet."""
    cases = [name for name in names_of(table) if given.only in name]
    of = {"table": table, "seeds": f"{seeds.start}:{seeds.stop}", "version": VERSION}
    if table == "excess":
        return [of | row for row in at_excess(cases, texts, seeds, given)]
    tasks = [(table, n, t, s, given.store) for n in cases for s in seeds for t in texts]
    done: dict[tuple[str, str], list[Row]] = defaultdict(list)
    with get_context("spawn").Pool(given.jobs) as pool:
        runs = pool.imap(job, tasks, len(texts))  # a record stays in one process
        for k, (task, found) in enumerate(zip(tasks, runs, strict=True)):
            done[task[1], task[2]].append(found)
            if sys.stderr.isatty() or k + 1 == len(tasks):
                print(
                    f"\r{table}: {k + 1} of {len(tasks)} runs", end="", file=sys.stderr, flush=True
                )
    print(file=sys.stderr)
    named = {key: {"case": key[0], "estimator": key[1]} for key in done}
    return [row for key, runs in done.items() for row in pooled(of | named[key], runs)]


def at_excess(cases: Sequence[str], texts: Sequence[str], seeds: range, given: Any) -> list[Row]:
    """Return the lags where the excess error is that of `rpem-forgetting`."""
    scenarios = [find_scenario(f"{name}-v1") for name in cases]
    scenarios = [s for s in scenarios if {e.parameter for e in s.events()} & {"k_T", "J_a", "f_m"}]
    with Runner(given.store / f"sweep-{made_with()['code']}", jobs=given.jobs) as runner:
        found = sweep(scenarios, texts, seeds, runner.rows).at_excess
    return [
        {"case": r["scenario"].removesuffix("-v1"), "estimator": r["estimator"],
         "parameter": r["parameter"], "how": r["how"], "bound": r["bound"], "runs": len(seeds)}
        | of_lags(np.exp(r["values"]["lag"]).tolist())
        for r in found if r["values"]["lag"]
    ]  # fmt: skip


def cost(texts: Sequence[str], steps: int) -> str:
    """Return what a step takes, one after another from Python, commissioning and faults in them."""
    lines = []
    for p, (axis, besides) in SIZES.items():
        stream = make_stream(axis)
        asked = stream.scenario.override({"identify": [*stream.scenario.identify, *besides]})
        for text in texts:
            warm, estimator = (build(parse(text), asked) for _ in range(2))
            time_steps(warm, stream, 20_000)  # compiles
            made, (cpu, _) = len(pickle.dumps(estimator)), time_steps(estimator, stream, steps)
            us = [1e-3 * cpu.mean(), *(1e-3 * np.percentile(cpu, list(PERCENTILES.values())))]
            held = [f"{n / 1024:.0f}" for n in (made, len(pickle.dumps(estimator)))]
            lines.append([f"{p}, {axis}", f"`{text}`", *(f"{x:.3g}" for x in us),
                          f"{us[-1] / us[1]:.3g}", " → ".join(held)])  # fmt: skip
    heads = [
        "parameters, axis",
        "estimator",
        "mean [µs]",
        *PERCENTILES,
        "longest / median",
        "kB held",
    ]
    return markdown(heads, lines) + f"\n{steps} steps, processor time of the thread.\n"


def followed(rows: Sequence[Row], others: Sequence[Row]) -> str:
    """Return the table of what changes: how it is followed, and what is found."""
    heads = ["case", "estimator", "lag [s]", "× bound", "lag − the best kept, × bound", "std [%]",
             "bias [%]", "cross-talk [%]", "found", "taken for", "false; more", "delay [s]",
             "size off [%]", "interval holds", "lost"]  # fmt: skip
    if all("how" in r for r in rows):
        heads[5:] = ["at all its settings"]
    lines = [[_case(r), f"`{r['estimator']}`", *_followed(r, others)] for r in rows]
    return markdown(heads, [x + [""] * (len(heads) - len(x)) for x in lines]) + totals(rows)


def _case(row: Row) -> str:
    return f"{row['case']}, {row['parameter']}"


def _followed(r: Row, others: Sequence[Row]) -> list[str]:
    if r.get("failure"):
        return [r["failure"]]
    ends = f" ({r['low']:.3g} … {r['high']:.3g})" if r.get("low") else ""
    over = r["lag"] / r["bound"] if r.get("lag") and r.get("bound") else None
    plain = [number(r.get("lag")) + ends, number(over), paired(r, others)]
    if "how" in r:
        return [*plain, r["how"].replace("matched", "")]
    spread = f" ± {r['error']:.1g}" if r.get("error") else ""
    return [*plain, number(r.get("std")), number(r.get("bias"), ".2g") + spread,
            number(r.get("cross")), f"{r['found']:g}/{r['faults']:g}", r.get("taken") or "",
            f"{r['false']:g}; {r['more']:g}", number(r.get("delay")), number(r.get("size"), ".2g"),
            f"{r['cover']:g}/{r['covers']:g}", f"{r['lost'] + r['failed']:g}"]  # fmt: skip


def totals(rows: Sequence[Row]) -> str:
    """Return what is missed, named wrongly and covered of all faults, those of d_a aside."""
    lines = []
    for name in dict.fromkeys(r["estimator"] for r in rows if "found" in r):
        own = {r["case"]: r for r in rows if r["estimator"] == name and "found" in r
               and "d_a" not in r["case"]}.values()  # fmt: skip
        keys = ("faults", "found", "wrong", "false", "calm", "cover", "covers")
        n = {key: sum(r[key] for r in own) for key in keys}
        lines.append([f"`{name}`", share(n["faults"] - n["found"], n["faults"]),
                      share(n["wrong"], n["found"]), f"{n['false']:g} in {n['calm']:.0f} s",
                      share(n["cover"], n["covers"])])  # fmt: skip
    heads = ["all of these", "missed (%)", "wrong names (%)", "false alarms", "interval holds (%)"]
    return "\n" + markdown(heads, lines) if lines else ""


def quiet(rows: Sequence[Row], others: Sequence[Row]) -> str:
    """Return the table of what is found where there is no fault."""
    del others
    heads = ["case", "estimator", "findings in seconds", "in 2000 s (95 %)", "a run",
             "true in name and sign", "worst: bias, rms error [%]", "lost"]  # fmt: skip
    lines = []
    for r in rows:
        found = [r.get("failure", "")] + [""] * 5
        if "found" in r:
            worst = (
                f"{r['parameter']} {number(r.get('bias'), '.2g')}, {number(r.get('rms'), '.2g')}"
            )
            found = [f"{r['false']:g} in {r['calm']:.0f}", rate(r["false"], r["calm"]),
                     f"{r['false'] / r['runs']:.2g}", f"{r['true']:g}", worst,
                     f"{r['lost'] + r['failed']:g}"]  # fmt: skip
        lines.append([r["case"], f"`{r['estimator']}`", *found])
    return markdown(heads, lines)


def honesty(rows: Sequence[Row], others: Sequence[Row]) -> str:
    """Return the table of claims: NEES over p, and the share of 95 % intervals that hold."""
    del others
    ages, claims = ("0", *AGES), {}
    for r in rows:
        if r.get("of 0"):
            holds = [share(r[f"inside {a}"], r[f"of {a}"]) for a in ages]
            claims[r["case"], r["estimator"]] = [
                *(number(r.get(f"nees {a}")) for a in ages),
                *holds,
            ]
    later = [f"+{age:g} s" for age in AGES]
    heads = ["case", "estimator", "NEES/p before", *later, "95 % holds before (%)", *later]
    return markdown(heads, [[case, f"`{name}`", *x] for (case, name), x in claims.items()])


SOURCES = {name: (name,) for name in (*CASES, "excess")} | {"honesty": ("linear", "friction")}
"""What runs each table is made of."""


def made(name: str, given: argparse.Namespace) -> str:
    """Return a table, the kept rows of other estimators from the same seed on in it."""
    if name == "cost":
        return cost(given.estimator, given.steps)
    rows: list[Row] = []
    for part in SOURCES[name]:
        ends = map(int, (given.seeds or seeds_of(part)).split(":"))
        rows += measured(part, given.estimator, range(*ends), given)
    if given.keep:
        keep(rows)
    asked = {(r["table"], r["case"], first(r)) for r in rows}
    known = [r for r in stored() if r["estimator"] not in given.estimator]
    known = [r for r in known if (r["table"], r["case"], first(r)) in asked]
    order = [case for part in SOURCES[name] for case in names_of(part)]
    rows = sorted(known + rows, key=lambda r: (order.index(r["case"]), r["parameter"]))
    show = {"quiet": quiet, "honesty": honesty}.get(name, followed)
    versions = {f"`{r['estimator']}`": r["version"] for r in known}
    old = ", ".join(f"{name} {made}" for name, made in sorted(versions.items()))
    return show(rows, known) + (f"\nKept rows, and their versions: {old}.\n" if old else "")


def options() -> argparse.Namespace:
    """Return what the command was given."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    add = parser.add_argument
    add("--table", action="append", choices=[*SOURCES, "cost"], help="all by default")
    add(
        "--estimator",
        action="append",
        help="name, or path.py:Class; those of the page by default",
    )
    add("--seeds", metavar="A:B", help="those of the page by default, 1000 and on")
    add("--only", default="", metavar="WORDS", help="cases with these in the name")
    add("--jobs", type=int, default=1, help="processes")
    add("--store", type=Path, default=ROOT / "results" / "glr", help="folder of rows and records")
    add("--steps", type=int, default=200_000, help="that are timed for the cost")
    add("--keep", action="store_true", help="put the pooled rows into docs/data/glr.csv")
    add("--print", action="store_true", help="print the tables, and leave the page alone")
    given = parser.parse_args()
    given.table = given.table or [*SOURCES, "cost"]
    return given


def main() -> None:
    """Make the tables that are asked for."""
    given = options()
    asked = given.estimator
    for name in given.table:
        given.estimator = asked or ASKED.get(name, ["rpem-forgetting", "glr"])
        words = f"`python docs/glr.py --table {name}`, {VERSION}"
        if name != "cost":
            words += f", seeds {given.seeds or ' and '.join(map(seeds_of, SOURCES[name]))}"
        text = f"{made(name, given)}\n{words}.\n"
        if given.print:
            print(f"## {name}\n\n{text}", flush=True)
            continue
        write(PAGE, {name: lambda text=text: text})


if __name__ == "__main__":
    main()
