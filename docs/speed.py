"""Measure the computing times of all estimators, and insert the tables into docs/speed.md.

The command is `python docs/speed.py [--steps 200000]`. The script measures the processor time of
all estimators in several rounds within one process. Absolute times depend on the computer and its
load, so quote only ratios of times. The script takes a few minutes.
"""

import argparse
import re
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy.linalg import expm

import flexaxis as fx
from flexaxis.estimators import three_mass
from flexaxis.estimators.models.discretisation import extended_system
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.running.estimators import build, parse

PAGE = Path(__file__).with_name("speed.md")
ROUNDS = 5
SCENARIO = find_scenario("fm_step-v1")
UNIT = "rpem-forgetting"


def micro(work, samples):
    """Measure the computing time per sample [µs] twice, and return the shorter time."""
    times = []
    for _ in range(2):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return 1e6 * min(times) / samples


def exponential():
    """Return the computing time [µs] of the matrix exponential for equations (22) and (23)."""
    model = three_mass(dict(SCENARIO.nominal)).parametrize(SCENARIO.identify)
    F = extended_system(model, model.theta)[0] * SCENARIO.period
    return micro(lambda: [expm(F) for _ in range(500)], 500)


def estimators():
    """Return the median times of `run` and `step` per sample [µs] for all estimators."""
    record = fx.simulate(SCENARIO, seed=0)
    u, y = record.torque, record.speed
    made = {name: build(parse(name), SCENARIO) for name in REGISTRY}
    times = {name: [] for name in (*made, "expm")}
    for _ in range(ROUNDS):
        times["expm"].append((exponential(), np.nan))
        for name, estimator in made.items():
            estimator.reset()
            run = micro(lambda e=estimator: (e.reset(), e.run(u, y)), len(u))
            estimator.reset()
            pairs = list(zip(u[:2000].tolist(), y[:2000].tolist(), strict=True))
            step = micro(lambda e=estimator, p=pairs: [e.step(*each) for each in p], len(pairs))
            times[name].append((run, step))
    return {name: np.median(rows, axis=0) for name, rows in times.items()}


def speed():
    """Return the table rows with the computing times of all estimators."""
    times = estimators()
    unit, rows = times[UNIT][0], [["", "`run` [µs]", f"times `{UNIT}`", "`step` [µs]"], ["---"] * 4]
    for name, (run, step) in times.items():
        last = "–" if np.isnan(step) else f"{step:.3g}"
        rows.append([f"`{name}`", f"{run:.3g}", f"{run / unit:.3g}", last])
    return rows


def longest(steps):
    """Return a table with percentiles of the computing time of one `glr` step.

    A fault occurs every 20 s. The function measures each step twice, and uses the shorter time.
    """
    record = fx.simulate(SCENARIO, seed=0)
    passes = []
    for _ in range(2):
        estimator, times = build(parse("glr"), SCENARIO), np.empty(steps)
        for k in range(steps):
            i = k % len(record.torque)
            u, y = float(record.torque[i]), float(record.speed[i])
            start = time.thread_time()
            estimator.step(u, y)
            times[k] = time.thread_time() - start
        passes.append(times)
    least = 1e6 * np.minimum(*passes)
    rows = [["steps", "median [µs]", "99 % [µs]", "99.9 % [µs]", "longest [µs]"], ["---"] * 5]
    values = [*np.percentile(least, (50, 99, 99.9)), least.max()]
    return [*rows, [f"{steps}", *(f"{value:.3g}" for value in values)]]


def write(name, rows, command):
    """Insert a table into docs/speed.md, between the markers that contain the table name."""
    text = PAGE.read_text(encoding="utf-8")
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    below = f"\n*Measured with `{command}` and flexaxis {version('flexaxis')}.*\n"
    text = re.sub(rf"(<!-- table: {name} -->\n).*?(<!-- end -->)",
                  lambda m: m[1] + table + below + m[2], text, flags=re.DOTALL)  # fmt: skip
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    options.add_argument(
        "--steps", type=int, default=200_000, help="number of timed glr steps (default: 200000)"
    )
    steps = options.parse_args().steps
    write("estimators", speed(), "python docs/speed.py")
    write("steps", longest(steps), f"python docs/speed.py --steps {steps}")
