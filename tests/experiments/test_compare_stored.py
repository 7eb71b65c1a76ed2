"""Finished runs compared as they are, and refused where they cannot be."""

import json

import numpy as np
import pytest

from flexaxis.experiments.gate import stored
from flexaxis.experiments.gate.comparison_report import write
from flexaxis.experiments.gate.pairs import MARGINS
from flexaxis.experiments.gate.words import headline, meaning
from flexaxis.experiments.running import names as results
from flexaxis.sim.errors import FlexaxisError


def rows(scale=1.0, *, seeds=8):
    """Rows of one estimator on one scenario: a lag of about `scale`."""
    noise = np.random.default_rng(0).normal(0, 0.005, seeds)
    return [
        {
            "case": f"{k:016x}",
            "scenario": "s",
            "hash": "h",
            "estimator": "e",
            "seed": k,
            "parameter": "f_m",
            "lag": scale * np.exp(noise[k]),
            "std": 1.0,
            "diverged": False,
            "never_settled": False,
        }
        for k in range(seeds)
    ]


@pytest.fixture
def folders(tmp_path):
    """Two stored runs, the second slower."""
    for name, scale in (("old", 1.0), ("new", 1.6)):
        folder = tmp_path / name
        folder.mkdir()
        lines = [json.dumps(row) for row in rows(scale)]
        (folder / results.SCORES).write_text("\n".join(lines) + "\n")
        (folder / results.SUMMARY).write_text(json.dumps({"versions": {"flexaxis": "1"}}))
    return tmp_path / "old", tmp_path / "new"


def test_stored_runs(folders, tmp_path):
    found = stored.compare_runs(*folders, MARGINS)
    assert found.verdict == "worse" and found.base == found.candidate == "e"
    page = write(tmp_path / "out", found)
    assert page.is_file() and not (tmp_path / "out" / results.SCORES).exists()


def test_who_estimates_less_is_named(folders, tmp_path):
    alike = stored.compare_runs(*folders, MARGINS)
    assert "estimates" not in headline(alike) and "nominal" not in meaning(alike)
    path = folders[0] / results.SCORES
    old = [json.loads(line) for line in path.read_text().splitlines()]
    both = [row | {"parameter": name, "rows": 2} for row in old for name in ("k_T", "f_m")]
    path.write_text("".join(json.dumps(row) + "\n" for row in both))
    found = stored.compare_runs(*folders, MARGINS)
    said = "candidate estimates f_m alone; the base k_T, f_m"
    assert said in headline(found)
    assert "The candidate holds k_T at nominal" in meaning(found)
    page = write(tmp_path / "out", found)
    told = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert said in page.read_text() and said in (tmp_path / "out" / "verdict.md").read_text()
    assert told["estimated"] == {"base": ["k_T", "f_m"], "candidate": ["f_m"]}
    back = stored.compare_runs(*folders[::-1], MARGINS)
    assert "candidate estimates k_T, f_m; the base f_m" in headline(back)
    assert "The base holds k_T" in meaning(back)


def test_stored_runs_on_some_seeds(folders):
    found = stored.compare_runs(*folders, MARGINS, seeds=range(2, 50))
    assert found.seeds == [2, 3, 4, 5, 6, 7] and found.verdicts[0].runs == 6
    with pytest.raises(FlexaxisError, match="have 1 seeds in common of the 43 that --seeds names"):
        stored.compare_runs(*folders, MARGINS, seeds=range(7, 50))


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        (results.SUMMARY, '"1"', '"2"', r"other versions \(flexaxis 1 and 2\)"),
        (results.SCORES, '"h"', '"g"', r"different scenarios under the name s"),
        (results.SCORES, '"seed"', '"sed', "no complete result"),
    ],
)
def test_stored_runs_that_cannot_be_compared(folders, file, old, new, message):
    path = folders[1] / file
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(FlexaxisError, match=message):
        stored.compare_runs(*folders, MARGINS)


def test_which_estimator_of_a_stored_run(folders):
    path = folders[1] / results.SCORES
    of_another = path.read_text().replace('"e"', '"other"').replace('"case": "0', '"case": "f')
    path.write_text(path.read_text() + of_another)
    with pytest.raises(FlexaxisError, match=r"2 estimators; say which .*: e, other"):
        stored.compare_runs(*folders, MARGINS)
    with pytest.raises(FlexaxisError, match=r"Did you mean 'other'"):
        stored.compare_runs(*folders, MARGINS, estimators=(None, "othr"))
    assert stored.compare_runs(*folders, MARGINS, estimators=(None, "other")).candidate == "other"
