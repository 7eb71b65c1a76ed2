"""Measure the tables of docs/speed.md anew: `python docs/speed.py`.

A table stands between `<!-- table: NAME -->` and `<!-- end -->`. With names of tables only these
are written, and with `--estimator E` (repeat for several) only these estimators are measured.
Each measurement takes minutes on a free machine. The filters of other libraries need
`pip install -e '.[peers]'`.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from making import VERSION, table, write
from speed_memory import memory as held
from speed_peers import peers as others
from speed_rounds import measure, problem, shipped
from speed_rounds import rivals as by_other_means
from speed_steps import TIMER, registered
from speed_steps import steps as timed_steps
from speed_streams import axis_of

from flexaxis.estimators import RECOMMENDED

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "speed.md"
STEPS = {"steps": 1_000_000, "steps-friction": 100_000}
HOURS = {"memory": 10.0, "memory-friction": 1.0}
"""How much is measured; `-friction`: the estimators of an axis with friction, which are slower."""
SLOW = ("glr",)  # a tenth of the hours
FEWER = 5  # times fewer steps of estimators whose longest step is of no interest
ROUNDS = 7
TIMES = ("1", "2", "3")
RATIOS = ("us_per_sample", "times", "ratio")
UNIT = "rpem-forgetting"
RIVALS = ("expm", "rpem-run")

NAMED = [b for a, b in zip(sys.argv, sys.argv[1:], strict=False) if a == "--estimator"]

Row = Mapping[str, Any]


def three() -> str:
    """Return the numbers that a reader wants."""
    leader, unit = _median(RECOMMENDED), _median(UNIT)
    timed = [*measured("steps"), *measured("steps-friction")]
    step = next(r for r in timed if r["estimator"] == RECOMMENDED and r["faults"])
    held = {r["estimator"]: r for r in _streamed()}
    flat = sum(r["flat"] for r in held.values())
    return (
        f"- **{unit['us_per_sample']:.2g} µs a sample** with the paper's method, "
        f"{1 / unit['times']:.0f} times as fast as one matrix exponential; "
        f"{leader['ratio']:.3g} times that with `{RECOMMENDED}`.\n"
        f"- **{_ms(step['cpu_us']['max'])} ms, the longest of {step['steps']:,} steps** of "
        f"`{RECOMMENDED}` with a fault every five seconds: {100 * step['of_period']:.0f} % of the "
        "sampling period.\n"
        f"- **{flat} of {len(held)} estimators grow by less than a byte a sample**, findings "
        f"included: `{UNIT}` holds {_kB(held[UNIT]['late'])} kB after "
        f"{held[UNIT]['hours']:g} hours, `{RECOMMENDED}` {_kB(held[RECOMMENDED]['late'])} kB.\n"
    )


def estimators() -> str:
    """Return what a sample takes each estimator."""
    rows = []
    for name in dict.fromkeys(r["estimator"] for r in measured("speed", "1") if "by" in r):
        quiet, fault, step = (_of(name, by) for by in ("run", "run-fault", "step"))
        spread = 100 * (max(r["ratio"] for r in quiet) / min(r["ratio"] for r in quiet) - 1)
        cells = [
            _middle(quiet, "us_per_sample"),
            _middle(quiet, "ratio"),
            _part(float(np.median([r["times"] for r in quiet]))),
            f"{spread:.0f} %",
            _middle(fault, "us_per_sample"),
            _middle(step, "us_per_sample"),
        ]
        rows.append([f"`{name}`", *cells])
    heads = ["", "`run` [µs]", f"times `{UNIT}`", "of a matrix exponential",
             "between runs", "`run` with a fault in 20 s [µs]", "`step` [µs]"]  # fmt: skip
    return table(heads, rows) + said(f"{len(TIMES)} times; the medians")


def rivals() -> str:
    """Return what the paper's method takes by other means, and the plant."""
    rows = {r["name"]: r for r in measured("speed", "1")}
    lines = []
    for name in RIVALS:
        r = rows[name]
        of = f"{r['ratio']:.3g} times {'as fast as ' if r['faster'] else ''}`{r['unit']}`"
        lines.append([f"`{name}`", r["what"], f"{r['us_per_sample']:.3g}", of])
    return table(["", "what", "µs", ""], lines) + said("the first of these times")


def peers() -> str:
    """Return the extended Kalman filter of other libraries."""
    lines = []
    for row in measured("speed", "1"):
        if row["name"].startswith("ekf-"):
            off = f"{row['difference']:.0e}" if "difference" in row else "–"
            cells = f"{row['us_per_sample']:.3g}", f"{row['times']:.3g}", off
            lines.append([f"`{row['name']}`", row["what"], *cells])
    heads = ["", "what", "µs", "times ours", "off our estimates, of nominal"]
    return table(heads, lines) + said("the first of these times")


def steps() -> str:
    """Return how long a step takes."""
    by_name: dict[str, list[Row]] = {}
    for row in [*measured("steps"), *measured("steps-friction")]:
        by_name.setdefault(row["estimator"], []).append(row)
    lines = []
    for name, rows in by_name.items():
        cells = [f"{number:.4g}" for row in rows for number in row["cpu_us"].values()]
        lines.append([f"`{name}`", f"{rows[0]['steps']:,}", *cells])
    parts = ["p50", "p99", "p99.9", "max"]
    heads = ["µs", "steps", *parts, *(f"{p}, faults" for p in parts)]
    return table(heads, lines) + said("as many steps as the table says")


def memory() -> str:
    """Return what an estimator holds."""
    lines = [
        [
            f"`{r['estimator']}`",
            f"{r['hours']:g}",
            *(_kB(r[n]) for n in ("made", "early", "late")),
            _number(r["grown"]),
            _kB(r["resident_grown"]),
            _number(r["findings"]),
            "yes" if r["flat"] else "**no**",
        ]
        for r in _streamed()
    ]
    heads = ["", "hours", "made [kB]", "after a tenth", "at the end", "grown [B]",
             "the process grew by [kB]", "findings", "flat"]  # fmt: skip
    return table(heads, lines) + said("as many hours as the table says")


TABLES: Mapping[str, Callable[[], str]] = {
    "three": three,
    "estimators": estimators,
    "rivals": rivals,
    "peers": peers,
    "steps": steps,
    "memory": memory,
}


def _measured(what: str) -> list[Row]:
    kind, _, axis = what.partition("-")
    names = [n for n in NAMED or registered() if axis_of(n) == (axis or "linear")]
    if kind == "steps":
        few = {n: 1 if n in {UNIT, *SLOW} else FEWER for n in names}
        timed = (row for n in names for row in timed_steps(STEPS[what] // few[n], [n]))
        return [row for row in timed if row["estimator"] != TIMER]
    if kind == "memory":
        hours = [HOURS[what] / (10 if n in SLOW else 1) for n in names]
        with ThreadPoolExecutor(os.cpu_count()) as pool:  # each has a process of its own
            return [r for rows in pool.map(_held, hours, names) for r in rows]
    given = problem()
    found, missing = others(given)
    if missing and not NAMED:
        sys.exit("\n".join(f"{name} cannot be measured: {why}" for name, why in missing.items()))
    *_, rows = measure([*by_other_means(given), *found, *shipped(given, NAMED)], ROUNDS)
    return list(rows)


def _held(hours: float, name: str) -> list[Row]:
    return list(held(hours, [name]))


@cache
def measured(what: str, again: str = "") -> Sequence[Row]:
    """Return the rows of a measurement; `again` tells its repetitions apart."""
    del again
    return _measured(what)


def said(more: str) -> str:
    """Return the line below a table: what made it."""
    return f"\n`python docs/speed.py`, {more}, {VERSION}.\n"


def _streamed() -> list[Row]:
    return [*measured("memory"), *measured("memory-friction")]


def _of(estimator: str, by: str) -> list[Row]:
    """Return the rows of an estimator in all runs of the command."""
    return [
        row
        for again in TIMES
        for row in measured("speed", again)
        if row.get("estimator") == estimator and row["by"] == by
    ]


def _median(estimator: str) -> Row:
    """Return the medians, over all runs of the command, of what `run` takes an estimator."""
    rows = _of(estimator, "run")
    return {key: float(np.median([r[key] for r in rows])) for key in RATIOS}


def _middle(rows: Sequence[Row], key: str) -> str:
    return f"{np.median([row[key] for row in rows]):.3g}"


def _part(times: float) -> str:
    return f"1/{1 / times:.0f}" if times < 0.5 else f"{times:.2g}"


def _ms(microseconds: float) -> str:
    return f"{1e-3 * microseconds:.3g}"


def _kB(number: int | None) -> str:
    return "–" if number is None else f"{number / 1000:.0f}"


def _number(number: int | None) -> str:
    return "–" if number is None else str(number)


if __name__ == "__main__":
    write(PAGE, TABLES, [word for word in sys.argv[1:] if word not in ("--estimator", *NAMED)])
