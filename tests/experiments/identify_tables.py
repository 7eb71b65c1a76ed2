"""
Print what `identify` makes of simulated drives with dry friction, and of the real bench.

``python tests/experiments/identify_tables.py [drives robots bench] [--seeds A:B] [--seconds 60]``

Errors are of the estimate, in per cent of the truth, with the standard deviation that is said.
"""

import argparse
import os
import sys
import time
from pathlib import Path

from identify_axes import NAMES, VALUES, log

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identify import identify
from flexaxis.experiments.logs.importing import read_any
from flexaxis.sim.parameters import preset
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

RATIOS = (1, 10, 100)
BENCH = {"J_m": 4.79e-3, "J_l": 4.76e-3, "k": 547.0}
MAP = {
    "time": "time", "torque": "iq_adx", "angle": "theta_mx", "unit": {"time": "us"},
}  # fmt: skip


def row(title, record, axis, truth, **options):
    """Print one identification."""
    begun = time.process_time()
    found = identify(record, axis, **options)
    cells = [
        f"{name} {100 * (value / truth[name] - 1):+.2f} ± {100 * sd / abs(truth[name]):.2f}"
        for name, value, sd in zip(found.names, found.theta, found.deviations, strict=True)
        if truth.get(name)
    ]
    status = 1 if found.warnings else 0
    spent = time.process_time() - begun
    print(f"{title:34} {found.friction:8} {status} {spent:4.0f} s  {'; '.join(cells)}", flush=True)
    for text in found.warnings:
        print(f"{'':36}! {text}", flush=True)


def drives(seeds, seconds):
    """One and two masses, slow moves and a multisine."""
    for masses in (1, 2):
        for ratio in RATIOS:
            for motion in ("multisine", "moves"):
                for seed in seeds:
                    truth = VALUES[masses] | {"f_c": ratio * VALUES[masses]["f_m"]}
                    record = log(masses, ratio, motion, seed=seed, seconds=seconds)
                    title = f"{masses} masses, {ratio:3} rad/s, {motion} {seed}"
                    row(title, record, find_axis(NAMES[masses]), truth)


def robots(seeds, seconds):
    """Three masses: the paper's axis with Coulomb friction, and a published one."""
    for name, preset_name in (("coulomb-v1", "n1"), ("wg_fc_step-v1", "wg")):
        values = find_scenario(name).model_dump(exclude_none=True, exclude_defaults=True)
        values |= {"duration": seconds, "fault": [], "name": "log"}
        law = values.get("static_friction") or {"f_c": 0.1}
        truth = preset(preset_name).as_dict() | dict(law)
        known = find_axis("three_mass").having(preset(preset_name).as_dict())
        for seed in seeds:
            (record,) = simulate(Scenario.model_validate(values), [seed])
            start = {n: 1.15 * v for n, v in known.model.nominal.items() if n not in ("k_T", "r")}
            axis = known.having(start)
            row(f"{name} {seed}", record, _given(axis), truth)


def _given(axis):
    from dataclasses import replace

    return replace(axis, known=True)


def bench(seeds, seconds):
    """Print the real bench, with its torque stated or not, with and without a high-pass."""
    data = Path(os.environ.get("FLEXAXIS_FDITOOLS", "MultisineTypeA.mat"))
    if not data.is_file():
        print("no bench data: FLEXAXIS_FDITOOLS names MultisineTypeA.mat of FdiTools")
        return
    for kind in ("held", "smooth", None):
        for corner in (None, 5.0):
            stated = {} if kind is None else {"torque_is": kind}
            record = read_any(data, MAP | stated, highpass=corner)
            row(f"bench, {kind}, high-pass {corner}", record, find_axis("two_mass"), BENCH)


def main(arguments):
    """Print the tables asked for."""
    tables = {"drives": drives, "robots": robots, "bench": bench}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", choices=[*tables, []], default=[])
    parser.add_argument("--seeds", default="4000:4010", metavar="A:B")
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args(arguments)
    first, last = map(int, given.seeds.split(":"))
    for name in given.tables or tables:
        tables[name](range(first, last), given.seconds)


if __name__ == "__main__":
    main(sys.argv[1:])
