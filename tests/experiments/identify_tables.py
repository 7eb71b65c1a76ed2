"""
Print what `identify` makes of simulated drives with dry friction, and of the real bench.

``python tests/experiments/identify_tables.py [TABLE …] [--seeds A:B]``; tables are functions below
that take seeds.

Errors are of the estimate, in per cent of the truth, with the standard deviation that is said.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from drives import RAIL, RAIL_COULOMB, arm, loop, rail
from identify_axes import NAMES, VALUES, log

from flexaxis.experiments.catalogue.find import find_scenario
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.errors import LogError
from flexaxis.experiments.logs.identification.identify import identify
from flexaxis.experiments.logs.importing import read_any
from flexaxis.sim.parameters import preset
from flexaxis.sim.scenario import Scenario
from flexaxis.sim.simulate import simulate

RATIOS = (1, 10, 100)
BENCH = {"J_m": 4.79e-3, "J_l": 4.76e-3, "k": 547.0}
MAP = {
    "time": "time", "torque": "iq_adx", "angle": "theta_mx", "unit": {"time": "us"},
}  # fmt: skip

PREAMBLE = "Prüfstand;Achse 1\nAbtastung;10 ms\nZeit [s];Moment [Nm];Winkel [°]\n"


def row(title, record, axis, truth, **options):
    """Print one identification, and return the worst error of what is to be found [%], if it is."""
    begun = time.process_time()
    found = identify(record, axis, **options)
    errors = {
        name: (100 * (value / truth[name] - 1), 100 * sd / abs(truth[name]))
        for name, value, sd in zip(found.names, found.theta, found.deviations, strict=True)
        if truth.get(name)
    }
    cells = [f"{name} {error:+.2f} ± {sd:.2f}" for name, (error, sd) in errors.items()]
    status = 1 if found.warnings else 0
    spent = time.process_time() - begun
    print(f"{title:36} {found.friction:8} {status} {spent:4.0f} s  {'; '.join(cells)}", flush=True)
    for text in found.warnings:
        print(f"{'':38}! {text}", flush=True)
    return found, errors


ASKED = {"f_m": 3.0, "f_c": 5.0, "J_m": 3.0, "J_l": 3.0, "J_g": 3.0, "J_a": 3.0}  # per cent
SECONDS = {(2, 1, "multisine"): 60.0}  # by which the bound of f_m is 1 %; 20 s where not said
# what slow moves cannot tell apart, and a data sheet says: friction of both sides, and the delay
TOLD = {(2, "moves"): ("f_l",), (3, "moves"): ("f_g", "f_a"), (3, "multisine"): ("f_g", "f_a")}


def drives(seeds, seconds, numbers=(1, 2, 3)):
    """One to three masses, slow moves and a multisine; then how many errors are as asked."""
    kept = {}
    for seed in seeds:
        for masses in numbers:
            for ratio in RATIOS:
                for motion in ("multisine", "moves"):
                    key = masses, ratio, motion
                    try:
                        found, errors = drive(*key, seed, SECONDS.get(key, seconds))
                    except LogError as error:
                        print(f"{key} {seed}: refused: {error}", flush=True)
                        continue
                    kept.setdefault(key, []).append((found, errors))
    for (masses, ratio, motion), rows in kept.items():
        good = [
            all(abs(e[name][0]) <= most for name, most in ASKED.items() if name in e)
            for _, e in rows
        ]
        wrong = [not g and not f.warnings for g, (f, _) in zip(good, rows, strict=True)]
        z = [abs(e[n][0]) / e[n][1] for _, e in rows for n in ASKED if n in e and e[n][1]]
        print(
            f"{masses} masses, {ratio:3} rad/s, {motion:9}: as asked {sum(good)} of {len(rows)}, "
            f"wrong with status 0 {sum(wrong)}, median |error|/sd {sorted(z)[len(z) // 2]:.2f}, "
            f"largest {max(z):.1f}",
            flush=True,
        )


def gears(seeds, seconds):
    """Three masses alone."""
    drives(seeds, seconds, (3,))


def drive(masses, ratio, motion, seed, seconds, **options):
    """Identify one simulated drive; three masses start from 15 % off."""
    values = VALUES[masses]
    truth, told = values | {"f_c": ratio * values["f_m"]}, TOLD.get((masses, motion), ())
    axis = find_axis(NAMES[masses])
    if masses == 3:
        off = {n: v if n in ("k_T", "r", *told) else 1.15 * v for n, v in values.items()}
        axis = _given(axis.having(off))
    elif told:
        axis = axis.having({name: values[name] for name in told})
    if told:
        options |= {"fix": told, "delay": 0.0}
    record = log(masses, ratio, motion, seed=seed, seconds=seconds)
    title = f"{masses} masses, {ratio:3} rad/s, {motion} {seed}, {seconds:.0f} s"
    return row(title, record, axis, truth, **options)


def without(seeds, seconds):
    """What is said without a law, and of a log that is too short."""
    for masses, motion in ((1, "moves"), (2, "multisine"), (3, "multisine")):
        drive(masses, 10, motion, seeds[0], seconds, friction="none")
    for masses, motion in ((1, "multisine"), (2, "multisine"), (2, "moves")):
        drive(masses, 10, motion, seeds[0], 4.0 if motion == "multisine" else 8.0)


def robots(seeds, seconds):
    """Three masses: the paper's axis with Coulomb friction, and a published one."""
    for name, preset_name in (("coulomb-v1", "n1"), ("wg_fc_step-v1", "wg")):
        values = find_scenario(name).model_dump(exclude_none=True)
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
        record = read_any(data, MAP | ({} if kind is None else {"torque_is": kind}))
        for corner in (None, 5.0):
            title, axis = f"bench, {kind}, high-pass {corner}", find_axis("two_mass")
            row(title, record, axis, BENCH, highpass=corner)


def rails(seeds, seconds):
    """Drives that no law describes: all three fits, and how many intervals hold the truth."""
    truth = RAIL | {"f_c": RAIL_COULOMB}
    rows = [_candidates(f"rail {s}", rail(s, seconds), "one_mass", truth) for s in seeds]
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
                    rows.append(_candidates(title, record, NAMES[masses], truth, candidates=False))
    _covered(rows)


def arms(seeds, seconds):
    """Hanging arms with dry friction."""
    truth = {"J_m": 0.01, "f_m": 0.05, "f_c": 0.1, "g_sin": 0.3}
    _covered([_candidates(f"arm {s}", arm(s, seconds=seconds), "one_mass", truth) for s in seeds])


def controllers(seeds, seconds):
    """Rigid axes at 100 Hz as a controller for machines logs them: Latin-1, decimal commas."""
    truth, rows = VALUES[1] | {"f_c": 10 * VALUES[1]["f_m"]}, []
    for seed in seeds:
        record = loop(1, 16, 10, seed, seconds=max(seconds, 60.0), period=0.01)
        cells = np.column_stack((record.time, record.torque, np.rad2deg(record.angle)))
        text = "\n".join(";".join(f"{cell:.6f}" for cell in line) for line in cells)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plc.csv"
            path.write_text(PREAMBLE + text.replace(".", ","), encoding="latin-1")
            rows.append(_candidates(f"controller {seed}", read_any(path, {}), "one_mass", truth))
    _covered(rows)


def _candidates(title, record, model, truth, *, candidates=True):
    """Print an identification and its fits; return status, and errors with deviations by name."""
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
    told += f", {found.best.name}"
    print(f"{title:28} {found.friction:8} {status} {spent:4.0f} s  {cells}; {told}", flush=True)
    for candidate in found.candidates if candidates else ():
        each = zip(found.names, candidate.fitted.z, candidate.deviations, strict=False)
        off = "; ".join(_cell(n, z - truth[n], sd, truth[n]) for n, z, sd in each if truth.get(n))
        print(f"{'':30}{candidate.name:26} error {candidate.error:.4g}  {off}", flush=True)
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
    each = (drives, gears, without, robots, bench, rails, loops, arms, controllers)
    tables = {table.__name__: table for table in each}
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
