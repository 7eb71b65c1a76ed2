"""A new score is one entry of SCORES: added to a copy, it shows up wherever scores do."""

import csv
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ENTRY = """
        Score(
            "largest",
            lambda track, i: case.finite(abs(track.percent[track.quiet, i]).max()),
            "Largest error before the fault.",
            unit="%",
            better="less",
            pool=pools.mean,
            heading="largest error",
            short="most",
        ),
"""
STUDY = """
name = "small"
scenario = "short.toml"
estimators = ["frozen", "rpem-forgetting"]
seeds = 1
"""


@pytest.fixture(scope="module")
def changed(tmp_path_factory, short):
    """A folder in which `flexaxis` is the package with one more score."""
    place = tmp_path_factory.mktemp("changed")
    package = place / "flexaxis"
    shutil.copytree(ROOT / "experiments", package / "experiments",
                    ignore=shutil.ignore_patterns("__pycache__"))  # fmt: skip
    for folder in ("sim", "estimators", "models_mjcf"):
        (package / folder).symlink_to(ROOT / folder)
    table = package / "experiments" / "scoring" / "table.py"
    text = table.read_text(encoding="utf-8")
    before = '        Score(\n            "bias",'
    assert text.count(before) == 1
    table.write_text(text.replace(before, ENTRY.lstrip("\n") + before), encoding="utf-8")
    (place / "short.toml").write_text(short.to_toml(), encoding="utf-8")
    (place / "study.toml").write_text(STUDY, encoding="utf-8")
    return place


def flexaxis(place, *words):
    done = subprocess.run(
        [sys.executable, "-m", "flexaxis.experiments", *words], cwd=place, capture_output=True,
        text=True, env=os.environ | {"PYTHONPATH": str(place)}, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode in (0, 1, 3), done.stderr
    return done.stdout


def test_it_is_in_rows_summary_table_and_report(changed):
    names = ["--estimator", "frozen", "--estimator", "rpem-forgetting"]
    shown = flexaxis(changed, "run", "short.toml", *names, "--seeds", "2", "-o", "run")
    assert "most %" in shown
    row = json.loads((changed / "run" / "scores.jsonl").read_text().splitlines()[-1])
    assert row["largest"] >= row["std"] > 0
    pooled = json.loads((changed / "run" / "summary.json").read_text())["rows"][-1]
    assert pooled["largest"] > 0 and pooled["largest_interval"] is None  # of two seeds
    page = (changed / "run" / "report.html").read_text(encoding="utf-8")
    assert "<th>largest error [%]</th>" in page and "Largest error before the fault." in page


def test_it_is_in_a_study_and_its_export(changed):
    flexaxis(changed, "study", "study.toml", "-o", "small")
    flexaxis(changed, "export", "small", "--csv", "small.csv")
    with (changed / "small.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert max(float(line["largest"]) for line in lines) > 0


def test_it_can_be_compared(changed):
    sides = ["--base", "rpem-forgetting", "--candidate", "rpem-forgetting[forgetting=0.9]"]
    words = ["compare", *sides, "short.toml", "--seeds", "6", "--margin", "largest=5%", "--json"]
    found = json.loads(flexaxis(changed, *words, "-o", "compared"))
    assert {row["metric"] for row in found["rows"]} >= {"largest", "lag", "std"}
