"""What the goldens hold, and how what is computed now differs from them.

`python tests/golden/make.py` writes them again and prints what moved.
"""

import json
import math
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import flexaxis as fx
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario, scenario_names, scenarios
from flexaxis.experiments.scoring.score_table import columns
from flexaxis.sim.parameters import LAW_NAMES
from flexaxis.sim.simulate import simulate

SCORES = Path(__file__).with_name("scores.jsonl")
RECORDS = Path(__file__).with_name("records.json")

# Each for what the others lack: a bound, several faults, rounded increments and their bound,
# friction that no model knows, a pause, a fault of what is not estimated, a nuisance beside a
# fault, and no fault but a wrong start.
SCENARIOS = (
    "fm_step-v1",
    "two_faults-v1",
    "coarse_encoder_fm_step-v1",
    "coulomb_fm_step-v1",
    "pause_fm_step-v1",
    "da_double-v1",
    "warming_fm_step-v1",
    "paper_nominal-v1",
)
DRAWN = ("fm_step-v2", "fm_intermittent-v2", "pause_fm_step-v2", "moves_fm_step-v2",
         "coulomb_fc_step-v2", "three_faults-v2")  # fmt: skip
SEEDS = (0,)

# Another processor rounds differently in the last place (1e-16), and filters make more of it:
# noise of 1e-13 relative on the records moves no score here by more than 1e-8.
RTOL = 1e-6
ATOL = 1e-9  # s, % or σ: less than anybody reads, and more than what rounding leaves of a zero
# Rounding of 2e-16 in the reference moves no projection of any scenario by more than 2e-12.
RECORD_RTOL = 1e-9

IDENTITY = ("scenario", "estimator", "seed", "parameter")
SIGNALS = ("time", "torque", "angle", "speed", "increment", "true_speed", "true_angle_m",
           "true_angle_g", "true_angle_a", "true_angle_l", "true_parameters")  # fmt: skip


def score_rows(name: str) -> list[dict[str, Any]]:
    """Return the rows of every registered estimator on one scenario, without times."""
    frame = fx.benchmark(list(REGISTRY), scenarios=name, seeds=SEEDS).to_dataframe()
    frame = frame.reindex(columns=[*IDENTITY, "hash", "changed", *columns()])
    rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
    return [row | {"isolation": json.loads(row["isolation"] or "null")} for row in rows]


def cells(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return every value of rows by scenario, estimator, seed, parameter and column."""
    names = ("hash", "changed", *columns())
    return {
        " ".join([*(str(row[key]) for key in IDENTITY), name]): row.get(name)
        for row in rows for name in names if name != "failed"
    }  # fmt: skip


def golden_rows() -> list[dict[str, Any]]:
    """Return the rows of the file."""
    return [json.loads(line) for line in SCORES.read_text(encoding="utf-8").splitlines()]


def moves(old: Mapping[str, Any], new: Mapping[str, Any], *, rtol: float, atol: float) -> list[str]:
    """Return a line for each value that differs by more than rounding."""
    lines = []
    for key in sorted(old.keys() | new.keys()):
        before, after = old.get(key, "absent"), new.get(key, "absent")
        if isinstance(before, int | float) and isinstance(after, int | float):
            same = math.isclose(before, after, rel_tol=rtol, abs_tol=atol)
        else:
            same = before == after
        if not same:
            lines.append(f"{key}: {before} -> {after}")
    return lines


def score_moves(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> list[str]:
    """Return a line for each score that differs."""
    return moves(cells(old), cells(new), rtol=RTOL, atol=ATOL)


def projections(name: str) -> dict[str, float]:
    """Return three weighted sums of each signal of a record: one changed sample moves them all.

    The weights are ±1 to ±2, so that no sample counts for little. The parameters of the axis are
    one signal, and those of its laws another.
    """
    (record,) = simulate(find_scenario(name), [0])
    signals = {s: x for s in SIGNALS if (x := getattr(record, s)) is not None}
    linear = sum(parameter not in LAW_NAMES for parameter in record.parameter_names)
    axis, laws = np.split(record.true_parameters, [linear], axis=1)
    signals |= {"true_parameters": axis} | ({"laws": laws} if laws.size else {})
    sums = {}
    for signal, values in signals.items():
        key = int.from_bytes(sha256(signal.encode()).digest()[:16], "big")
        rng = np.random.Generator(np.random.Philox(key=key))
        for i in range(3):
            weights = rng.uniform(1, 2, values.size) * rng.choice([-1.0, 1.0], values.size)
            sums[f"{signal} {i}"] = math.fsum(weights * values.ravel())
    return sums


def recorded() -> list[str]:
    """Return the scenarios of which projections are kept: of those with drawn onsets, some.

    Those of the group known have the records of others, as `test_known` shows.
    """
    known = [line["name"] for line in scenarios(group="known")]
    return sorted({*scenario_names(), *DRAWN} - {*known})


def golden_records() -> dict[str, dict[str, float]]:
    """Return the projections of the file, by scenario."""
    return json.loads(RECORDS.read_text(encoding="utf-8"))


def record_moves(old: Mapping[str, float], new: Mapping[str, float]) -> list[str]:
    """Return a line for each projection that differs."""
    return moves(old, new, rtol=RECORD_RTOL, atol=0.0)
