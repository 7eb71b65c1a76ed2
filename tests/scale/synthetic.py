"""Make the folder of a large study in no time, and measure what is done with it.

The rows look as those of a study do, with random numbers in them:

  python tests/scale/synthetic.py make /tmp/million 1000000
  python tests/scale/synthetic.py measure /tmp/million
"""

import json
import os
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.study import varied
from flexaxis.experiments.running.work import made_with
from flexaxis.experiments.scoring.score_table import SCORES, undefined
from flexaxis.experiments.storage.store import Store

BASE, METHODS, NAMES = "fm_step-v1", ("rpem-forgetting", "glr"), ("k_T", "1/J_a", "f_m")
AXES = {"fault[0].factor": (1.1, 1.5, 2.0, 3.0, 4.0), "start": (1.0, 1.1, 1.2, 1.3)}
STOCK = 3000  # different cases of an estimator, taken again and again with other seeds
UNIT = 16  # seeds of a unit of work


def make(folder, rows, *, seed=0):
    """Write study.json and the rows of a study with about so many rows; return their number."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    points = [dict(zip(AXES, values, strict=True)) for values in product(*AXES.values())]
    variants = [(varied(find_scenario(BASE), point, common=True), point) for point in points]
    seeds = -(-rows // (len(points) * len(METHODS) * len(NAMES)))
    stock = {method: _stock(method, rng) for method in METHODS}
    count = 0
    with Store(folder / "scores.sqlite", tuple(AXES)) as store:
        for first in range(0, seeds, UNIT):
            for scenario, point in variants:
                for method in METHODS:
                    unit = range(first, min(first + UNIT, seeds))
                    place = {"base": BASE, "method": method, "axes": point}
                    store.add(_cases(scenario, place, unit, stock[method], rng))
                    count += len(unit) * len(NAMES)
    base = find_scenario(BASE)
    study = {
        "name": "synthetic", "estimators": list(METHODS),
        "scenarios": [{"hash": base.hash, "definition": base.resolved()}], "axes": list(AXES),
        "seeds": list(range(1000, 1000 + seeds)), "points": len(points),
    }  # fmt: skip
    (folder / "study.json").write_text(json.dumps(study), encoding="utf-8")
    return count


def _cases(scenario, place, unit, stock, rng):
    fixed = {"hash": scenario.hash, "scenario": scenario.name, "estimator": place["method"]} | place
    fixed |= {"seconds": scenario.duration, "code": None, "rows": len(NAMES), "error": None}
    cases = rng.integers(0, 1 << 63, len(unit))
    chosen = rng.integers(0, STOCK, len(unit))
    return [
        fixed | scores | {"case": f"{case:016x}", "seed": 1000 + seed}
        for case, seed, number in zip(cases, unit, chosen, strict=True)
        for scores in stock[number]
    ]


def _stock(method, rng):
    """Return the scores of cases, a list of three rows each."""
    finds = method == "glr"
    return [[_scores(name, finds, rng) for name in NAMES] for _ in range(STOCK)]


def _scores(name, finds, rng):
    changed = name == "f_m"
    one = {"parameter": name, "changed": changed}
    std = float(rng.lognormal(-1, 0.3))
    one |= {"std": std, "bias": float(std * rng.uniform(-0.5, 0.5)), "diverged": False,
            "lost_before": False, "lost_after": False, "excess": float(rng.lognormal(-4, 0.5)),
            "nees": float(rng.chisquare(3))}  # fmt: skip
    if changed:
        lag = float(rng.lognormal(0.1, 0.4))
        never = bool(rng.random() < 0.1)
        one |= {"lag": lag, "t10": None if never else 2 * lag, "never_settled": never,
                "std_after": float(rng.lognormal(-1, 0.3)), "bias_after": float(rng.normal()),
                "lag_null": 5.0, "lag_bound": 0.07, "lag_bound_single": 0.05,
                "score": 100 * (1 - lag / 5), "bound": {"20": 0.3, "100": 0.1}}  # fmt: skip
    else:
        one |= {"cross_talk": float(rng.lognormal(-1, 0.5))}
    if finds:
        missed = int(rng.random() < 0.05)
        one |= {"detection": {"alarms": 1, "false_alarms": int(rng.random() < 0.1),
                              "false_alarms_per_1000_s": 0.0, "faults": 1, "missed": missed,
                              "delay": None if missed else float(rng.lognormal(-2, 0.5)),
                              "isolated": None if missed else 1.0},
                "isolation": [{"fault": "f_m", "named": None if missed else ["f_m"]}]}  # fmt: skip
    us = float(rng.lognormal(-1, 0.1))
    cost = {"us_per_sample": us, "seconds": 0.004 * us, "host": "node", "versions": made_with()}
    return undefined() | one | {"cost": cost}


WHAT = {
    "open": "Results.load(folder)",
    "columns": "len(results)",
    "report": "write_report(results)",
    "summary": "results.pooled()",
    "csv": "export_csv(results, folder / 'out.csv')",
    "parquet": "export_parquet(results, folder / 'out.parquet')",
    "netcdf": "export_netcdf(results, folder / 'out.nc')",
}
PROGRAM = """
import resource, sys, time
from pathlib import Path
from flexaxis.experiments.reporting.study.page import write_report
from flexaxis.experiments.results.export import export_csv, export_netcdf, export_parquet
from flexaxis.experiments.results.results import Results
folder = Path(sys.argv[1])
before = time.perf_counter()
results = Results.load(folder)
{what}
took = time.perf_counter() - before
used = resource.getrusage(resource.RUSAGE_SELF)
print(took, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
if sys.argv[2] != "open":
    assert len(results) % 6 == 0 < len(results), "no rows were read"
"""


def measure(folder, what):
    """Do one thing with a folder in a process of its own; return what it took.

    Seconds by the clock, seconds of processor time with imports, and peak memory in megabytes.
    """
    words = [sys.executable, "-c", PROGRAM.format(what=WHAT[what]), str(folder), what]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    for name in ("out.csv", "out.parquet", "out.nc"):
        (folder / name).unlink(missing_ok=True)
    return tuple(map(float, done.stdout.split()))


def main(words):
    """Make or measure."""
    command, folder = words[0], Path(words[1])
    if command == "make":
        before = time.perf_counter()
        count = make(folder, int(words[2]))
        size = os.stat(folder / "scores.sqlite").st_size
        print(f"{count} rows, {size / 1e6:.0f} MB, {time.perf_counter() - before:.0f} s")
        return
    print("s, s of processor, MB")
    for what in words[2:] or WHAT:
        print(f"{what:10}", *(f"{value:8.1f}" for value in measure(folder, what)), flush=True)


if __name__ == "__main__":
    assert set(undefined()) >= set(SCORES)
    main(sys.argv[1:])
