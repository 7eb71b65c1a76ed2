"""The table of docs/logs.md on `flexaxis track` of axes with dry friction, at several rates.

    python tests/experiments/track_tables.py --seeds 6000:6003

Each row: a log of a whole axis is identified and its axis.toml written; the estimators, with their
defaults, track f_m over another log from there, of which f_m grows by half at 20 of 40 s.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from identify_axes import NAMES, VALUES, log

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.track import track
from flexaxis.experiments.running.estimators import parse

AT, FACTOR, WINDOW = 20.0, 1.5, 5.0  # s, of f_m, s
ESTIMATORS = ("glr", "ekf")
ROWS = ((1, 100.0), (1, 1000.0), (1, 2500.0), (2, 250.0), (2, 1000.0), (2, 2500.0))


def identified(masses, rate, seed, folder):
    """Return the path of the axis.toml that identify makes of a log without a change."""
    record = log(masses, 10, "multisine", seed=seed, period=1 / rate, seconds=20.0)
    found = identify(record, find_axis(NAMES[masses]), friction="coulomb")
    path = folder / f"axis-{masses}-{rate:g}-{seed}.toml"
    found.axis.save(path)
    return path


def scores(masses, rate, seed, axis, estimator):
    """Return lag [s], spread and bias before the change [%], what track says, µs a sample."""
    period = 1 / rate
    changes = {"seed": seed + 500, "seconds": 40.0, "change": {"f_m": FACTOR}, "at": AT}
    record = log(masses, 10, "multisine", period=period, **changes)
    begun = time.perf_counter()
    found = track(record, find_axis(str(axis)), parse(estimator), identify=["f_m"])
    spent = time.perf_counter() - begun
    theta = found.theta[:, found.names.index("f_m")] / VALUES[masses]["f_m"]
    k, window = round(AT / period), round(WINDOW / period)
    before, after = theta[k - window : k], theta[k : k + window]
    said = ", ".join(f"{c.name} {100 * c.relative:+.0f} % at {c.time:.0f} s" for c in found.changes)
    lag = period * np.sum(abs(after - FACTOR)) / (FACTOR - 1)
    ends = 100 * np.mean(theta[-window:] / FACTOR - 1)
    return lag, 100 * before.std(), 100 * (before.mean() - 1), ends, said, 1e6 * spent / len(theta)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:1")
    first, last = map(int, parser.parse_args().seeds.split(":"))
    print("| masses | rate | estimator | lag | sd | bias before | at the end | said | µs |")
    print("|---|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for masses, rate in ROWS:
            axes = {s: identified(masses, rate, s, Path(folder)) for s in range(first, last)}
            for estimator in ESTIMATORS:
                each = [scores(masses, rate, s, axis, estimator) for s, axis in axes.items()]
                lag, sd, bias, end, said, spent = zip(*each, strict=True)
                words = "; ".join(said)
                print(
                    f"| {masses} | {rate:g} Hz | `{estimator}` | {np.mean(lag):.2f} s | "
                    f"{np.sqrt(np.mean(np.square(sd))):.2f} % | {_span(bias)} | {_span(end)} | "
                    f"{words} | {min(spent):.0f} |",
                    flush=True,
                )


def _span(values):
    return f"{min(values):+.1f} … {max(values):+.1f} %"


if __name__ == "__main__":
    main()
