"""
Print what `identify` makes of simulated drives with dry friction.

``python tests/experiments/identify_tables.py [TABLE …] [--seeds A:B]``; tables are functions below
that take seeds.

Errors are of the estimate, in per cent of the truth, with the standard deviation that is said.
"""

import argparse
import sys
import time

from drives import RAIL, RAIL_COULOMB, arm, loop, rail
from identify_axes import NAMES, VALUES

from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identify import identify


def rails(seeds, seconds):
    """Drives that no law describes: estimates, and how many intervals hold the truth."""
    truth = RAIL | {"f_c": RAIL_COULOMB}
    rows = [_identified(f"rail {s}", rail(s, seconds), "one_mass", truth) for s in seeds]
    _covered(rows)


def loops(seeds, seconds):
    """Loops that close over an encoder, with and without dry friction."""
    rows = []
    for masses in (1, 2):
        for ratio in (0, 10):
            for bits in (13, 16, 18):
                for seed in seeds:
                    record = loop(masses, bits, ratio, seed, seconds=seconds)
                    truth = VALUES[masses] | {"f_c": ratio * VALUES[masses]["f_m"]}
                    title = f"{masses} masses, {bits} bits, {ratio} rad/s, {seed}"
                    rows.append(_identified(title, record, NAMES[masses], truth))
    _covered(rows)


def arms(seeds, seconds):
    """Hanging arms with dry friction."""
    truth = {"J_m": 0.01, "f_m": 0.05, "f_c": 0.1, "g_sin": 0.3}
    _covered([_identified(f"arm {s}", arm(s, seconds=seconds), "one_mass", truth) for s in seeds])


def _identified(title, record, model, truth):
    """Print an identification; return status, and errors with deviations by name."""
    begun = time.process_time()
    found = identify(record, find_axis(model))
    status, spent = int(bool(found.warnings)), time.process_time() - begun
    errors = {
        name: (value - truth.get(name, 0.0), sd)
        for name, value, sd in zip(found.names, found.theta, found.deviations, strict=True)
        if name in truth
    }
    cells = "; ".join(_cell(n, e, sd, truth[n]) for n, (e, sd) in errors.items() if truth[n])
    told = f"{1e3 * found.axis.delay:.3f} ms late, held-out fit {found.fit:.1f} %"
    print(f"{title:28} {found.friction:8} {status} {spent:4.0f} s  {cells}; {told}", flush=True)
    for text in found.warnings:
        print(f"{'':30}! {text}", flush=True)
    return status, errors


def _cell(name, error, sd, of):
    return f"{name} {100 * error / of:+.2f} ± {100 * sd / of:.2f} % (z {error / sd:+.1f})"


def _covered(rows):
    """Print how many intervals hold the truth, and wrong numbers under status 0."""
    z = [abs(e) / sd for _, errors in rows for e, sd in errors.values() if sd]
    for times, asked in ((1.0, 68), (1.96, 95), (3.0, 99.7)):
        share = 100 * sum(each < times for each in z) / max(len(z), 1)
        print(f"within {times} sd: {share:.0f} % of {len(z)}, asked {asked} %")
    wrong = sum(not s and any(abs(e) > 3 * sd for e, sd in er.values() if sd) for s, er in rows)
    print(f"status 0: {sum(not s for s, _ in rows)} of {len(rows)}; of them beyond 3 sd: {wrong}")


def main(arguments):
    """Print the tables asked for."""
    tables = {table.__name__: table for table in (rails, loops, arms)}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", choices=[*tables, []], default=[])
    parser.add_argument("--seeds", default="5000:5005", metavar="A:B")
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args(arguments)
    first, last = map(int, given.seeds.split(":"))
    for name in given.tables or tables:
        tables[name](range(first, last), given.seconds)


if __name__ == "__main__":
    main(sys.argv[1:])
