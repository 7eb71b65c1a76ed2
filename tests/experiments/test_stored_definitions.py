"""Definitions stored before a scenario had the key `streams` mean what they meant then."""

import json
from dataclasses import replace

import pytest

from flexaxis.experiments.cli import main
from flexaxis.experiments.running.estimate import _own_scenario
from flexaxis.sim.simulate import simulate


def make_old(folder):
    """Take the key out of every definition in the JSON files of a folder."""
    found = 0

    def older(table):
        nonlocal found
        found += table.pop("streams", None) is not None
        return table

    for path in folder.glob("*.json"):
        content = json.loads(path.read_text(encoding="utf-8"), object_hook=older)
        path.write_text(json.dumps(content), encoding="utf-8")
    assert found


@pytest.mark.parametrize("streams", [True, False])
def test_a_record_says_its_scenario(short, tmp_path, streams):
    record = simulate(short.override({"duration": 7.0}), [0])[0]
    content = {k: v for k, v in record.scenario.items() if streams or k != "streams"}
    old = replace(record, scenario=content)
    assert _own_scenario(old, tmp_path).hash == record.hash


def test_the_rows_of_a_study_are_verified(short_toml, tmp_path, capsys):
    study, folder = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(
        f'scenario = "{short_toml}"\nestimators = "rpem-forgetting"\nseeds = 1\n', encoding="utf-8"
    )
    assert main(["study", str(study), "-o", str(folder), "--jobs", "1"]) == 0
    make_old(folder)
    capsys.readouterr()
    assert main(["rerun", str(folder)]) == 0
    assert "1 of 1 cases agree" in capsys.readouterr().out


def test_the_report_of_a_run_shows_it(short_toml, tmp_path):
    folder = tmp_path / "out"
    words = ["--estimator", "frozen", "--seeds", "1", "--jobs", "1"]
    assert main(["run", str(short_toml), *words, "-o", str(folder)]) == 0
    make_old(folder)
    assert main(["report", str(folder)]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "streams = &#34;content&#34;" in page and "&#34;plant&#34;" not in page
