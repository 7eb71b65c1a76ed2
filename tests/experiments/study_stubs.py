"""Stand-ins for what a worker does: rows as they look, in no time; and workers that die."""

import os
import time
from dataclasses import replace

from flexaxis.experiments.building import interrupts
from flexaxis.experiments.running.case import case_id
from flexaxis.experiments.running.work import Outcome
from flexaxis.experiments.scoring.score_table import undefined

PARAMETERS = ("k_T", "1/J_a", "f_m")


def case_rows(variant, entry, seed):
    known = {
        "case": case_id(variant.hash, entry.text, seed),
        "hash": variant.hash,
        "scenario": variant.base.name,
        "estimator": entry.text,
        "seed": seed,
    }
    rest = {
        "cost": {"us_per_sample": 0.1, "seconds": 0.1, "host": "x", "versions": ""},
        "base": variant.base.name,
        "method": entry.method,
        "axes": dict(variant.axes) | dict(entry.axes),
        "seconds": variant.duration,
        "rows": len(PARAMETERS),
        "code": None,
        "error": None,
    }
    scores = undefined() | {"changed": False, "diverged": False, "std": seed % 7 / 10}
    return [known | scores | {"parameter": name} | rest for name in PARAMETERS]


def quick(unit):
    rows = [
        row
        for variant in unit.variants
        for entry in variant.entries
        for seed in unit.seeds
        for row in case_rows(variant, entry, seed)
    ]
    return Outcome(rows, len(rows) // len(PARAMETERS), 0)


def costly(unit):
    found = quick(unit)
    rows = [row | {"cost": row["cost"] | {"seconds": 9.0}} for row in found.rows]
    return replace(found, rows=rows)


def slowly(unit):
    time.sleep(0.002)
    return quick(unit)


def dies_on(seed, unit):
    if seed in unit.seeds:
        os._exit(9)
    return quick(unit)


def fails(unit):
    raise OSError("the network is down")


def which(task):
    """Return who does it."""
    return os.getpid()


def until_asked(mark):
    """Say by a file that it has begun; return whether it was asked to end."""
    mark.touch()
    end = time.monotonic() + 30.0
    while not interrupts.asked() and time.monotonic() < end:
        time.sleep(0.01)
    return interrupts.asked()


def dies_if(task):
    os._exit(9)
