"""Scores that must not change unless someone means it.

`python tests/experiments/test_golden.py` writes the file anew, for a change that is meant.
"""

import json
from pathlib import Path

import pytest

from flexaxis.experiments.catalogue import find_scenario
from flexaxis.experiments.harness import run

GOLDEN = Path(__file__).parents[1] / "golden" / "scores.jsonl"
SCENARIOS = ("fm_step-v1", "encoder_fm_step-v1")
ESTIMATORS = ("rpem-forgetting", "rpem-drift-mu", "ekf")
SEEDS = range(2)


def scores():
    done = run([find_scenario(name) for name in SCENARIOS], ESTIMATORS, SEEDS)
    rows = [row for task in done for case in task.cases for row in case.rows]
    return [{key: value for key, value in row.items() if key != "cost"} for row in rows]


def test_scores_are_what_they_were():
    golden = [json.loads(line) for line in GOLDEN.read_text(encoding="utf-8").splitlines()]
    found = scores()
    assert len(found) == len(golden)
    for new, old in zip(found, golden, strict=True):
        # Other processors round differently in the last place; an error grows to 1e-9 at most.
        assert {key: new[key] for key in old} == {
            key: pytest.approx(value, rel=1e-7, abs=1e-9) if isinstance(value, float) else value
            for key, value in old.items()
        }


if __name__ == "__main__":
    GOLDEN.write_text("".join(json.dumps(row) + "\n" for row in scores()), encoding="utf-8")
