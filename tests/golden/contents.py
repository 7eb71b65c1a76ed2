"""What the goldens hold, and how what is found now differs from them.

`python tests/golden/make.py` writes them anew, and prints what moved.
"""

import json
import math
import platform
from collections import defaultdict
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import flexaxis as fx
from flexaxis.estimators.registry import REGISTRY
from flexaxis.experiments.catalogue.find import find_scenario, scenario_names
from flexaxis.experiments.scoring.score_table import columns
from flexaxis.sim.parameters import LAW_NAMES
from flexaxis.sim.record import Record
from flexaxis.sim.simulate import simulate, versions

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
SEEDS = (0,)

# Another processor rounds differently in the last place (1e-16), and filters make more of it:
# noise of 1e-13 relative on the records moves no score here by more than 1e-8.
RTOL = 1e-6
ATOL = 1e-9  # s, % or σ: less than anybody reads, and more than what rounding leaves of a zero

IDENTITY = ("scenario", "estimator", "seed", "parameter")
SIGNALS = (
    "time",
    "torque",
    "angle",
    "speed",
    "increment",
    "true_speed",
    "true_angle_m",
    "true_angle_g",
    "true_angle_a",
    "true_angle_l",
    "true_parameters",
)
PROJECTIONS = 3
# Rounding of 2e-16 in the reference moves no projection of any scenario by more than 2e-12.
RECORD_RTOL = 1e-9


def score_rows(name: str) -> list[dict[str, Any]]:
    """Return the rows of every registered estimator on one scenario, without times."""
    results = fx.benchmark(list(REGISTRY), scenarios=name, seeds=SEEDS)
    frame = results.to_dataframe()
    rows = frame.astype(object).where(frame.notna(), None).to_dict("records")
    for row in rows:
        row["isolation"] = row["isolation"] and json.loads(row["isolation"])
    return [comparable(row) for row in rows]


def comparable(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is compared of a row; truths and whole numbers as floats."""
    found = {name: row.get(name) for name in (*IDENTITY, "hash", "changed", *columns())}
    return {
        name: float(value) if isinstance(value, int | float) and name != "seed" else value
        for name, value in found.items() if name != "failed"
    }  # fmt: skip


def golden_rows(path: Path = SCORES) -> list[dict[str, Any]]:
    """Return the rows of the file."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [comparable(json.loads(line)) for line in lines]


def moves(old: list[dict[str, Any]], new: list[dict[str, Any]]) -> list[str]:
    """Return in words what differs between rows: which are gone or fresh, keys, and numbers."""
    before, after = _by_identity(old), _by_identity(new)
    lines = [f"row gone: {' '.join(map(str, key))}" for key in before.keys() - after.keys()]
    lines += [f"row fresh: {' '.join(map(str, key))}" for key in after.keys() - before.keys()]
    columns = defaultdict(list)
    for key in before.keys() & after.keys():
        for column in before[key].keys() | after[key].keys():
            pair = [rows[key].get(column, "absent") for rows in (before, after)]
            if (change := _change(*pair, rtol=RTOL, atol=ATOL)) > 0:
                columns[column].append((change, pair, " ".join(map(str, key))))
    return sorted(lines) + [_sentence(column, columns[column]) for column in sorted(columns)]


def _by_identity(rows: list[dict[str, Any]]) -> dict[tuple[Any, ...], dict[str, Any]]:
    found = {tuple(row[key] for key in IDENTITY): row for row in rows}
    assert len(found) == len(rows), "two rows of one scenario, estimator, seed and parameter"
    return found


def _sentence(column: str, changes: list[tuple[float, list[Any], str]]) -> str:
    largest, (old, new), where = max(changes, key=lambda change: change[0])
    size = "not by a number" if math.isinf(largest) else f"{largest:.2g} relative"
    return f"{column}: {len(changes)} rows moved, most {size}: {old} -> {new} in {where}"


def _change(old: Any, new: Any, *, rtol: float, atol: float = 0.0) -> float:
    """Return the relative change, 0 within the tolerance and infinite where no number is."""
    if isinstance(old, float) and isinstance(new, float):
        change, size = abs(new - old), max(abs(new), abs(old))
        return 0.0 if change <= rtol * size + atol else change / size
    return 0.0 if type(old) is type(new) and old == new else math.inf


def digest(record: Record) -> dict[str, list[Any]]:
    """Return the SHA-256 of the bytes of each signal, and its projections.

    The parameters of the axis are one signal, and those of its laws another.
    """
    signals = {name: x for name in SIGNALS if (x := getattr(record, name)) is not None}
    linear = sum(name not in LAW_NAMES for name in record.parameter_names)
    axis, laws = np.split(record.true_parameters, [linear], axis=1)
    signals |= {"true_parameters": axis} | ({"laws": laws} if laws.size else {})
    return {
        signal: [sha256(values.tobytes()).hexdigest(), *projections(values, signal)]
        for signal, values in signals.items()
    }


def projections(values: np.ndarray, signal: str) -> list[float]:
    """Return weighted sums of a signal: one changed sample moves them all.

    The weights are ±1 to ±2, so that no sample counts for little.
    """
    values = values.ravel()
    key = int.from_bytes(sha256(signal.encode()).digest()[:16], "big")
    rng = np.random.Generator(np.random.Philox(key=key))
    sums = []
    for _ in range(PROJECTIONS):
        weights = rng.uniform(1, 2, len(values)) * rng.choice([-1.0, 1.0], len(values))
        sums.append(math.fsum(weights * values))
    return sums


def record_of(name: str) -> Record:
    """Return the record of a scenario of which the digest is kept."""
    return simulate(find_scenario(name), [0])[0]


def recorded() -> list[str]:
    """Return the scenarios of which digests are kept: of those with drawn onsets, some."""
    return sorted([*scenario_names(), *DRAWN])


DRAWN = ("fm_step-v2", "fm_intermittent-v2", "pause_fm_step-v2", "moves_fm_step-v2",
         "coulomb_fc_step-v2", "three_faults-v2")  # fmt: skip


def digests() -> dict[str, Any]:
    """Return the digests of all scenarios, and what made them."""
    return {
        "made_with": dict(versions()) | {"machine": platform.machine()},
        "scenarios": {name: digest(record_of(name)) for name in recorded()},
    }


def golden_digests() -> dict[str, Any]:
    """Return what the file of records holds."""
    return json.loads(RECORDS.read_text(encoding="utf-8"))


def record_moves(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Return in words what differs between the digests of scenarios."""
    lines = [f"scenario gone: {name}" for name in sorted(old.keys() - new.keys())]
    lines += [f"scenario fresh: {name}" for name in sorted(new.keys() - old.keys())]
    for name in sorted(old.keys() & new.keys()):
        for signal in sorted(old[name].keys() | new[name].keys()):
            pair = [digests[name].get(signal, ["absent"]) for digests in (old, new)]
            change = signal_change(*pair)
            if change > 0:
                lines.append(f"{name} {signal}: {change:.2g} relative")
            elif pair[0] != pair[1]:
                lines.append(f"{name} {signal}: in the last bits only")
    return lines


def signal_change(old: list[Any], new: list[Any]) -> float:
    """Return the largest relative change of a projection, 0 within the tolerance."""
    if len(old) != len(new):
        return math.inf
    if old[0] == new[0]:  # the same bytes
        return 0.0
    changes = [_change(*pair, rtol=RECORD_RTOL) for pair in zip(old[1:], new[1:], strict=True)]
    return max(changes)
