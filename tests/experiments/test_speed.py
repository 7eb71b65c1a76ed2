"""The table of speeds: that it is complete and consistent, not how fast this machine is."""

import json

from flexaxis.experiments.cli import main


def test_one_round(capsys):
    assert main(["speed", "--rounds", "1", "--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)["rows"]}
    assert {"expm", "literal-rpem", "c2d", "rpem-run", "rpem-step", "ekf-run", "plant"} <= set(rows)
    assert rows["expm"]["ratio"] == rows["engine"]["ratio"] == 1.0
    for row in rows.values():
        assert row["low"] <= row["ratio"] <= row["high"] and row["us_per_sample"] > 0
    unit = rows["expm"]["us_per_sample"]
    assert abs(rows["c2d"]["ratio"] - unit / rows["c2d"]["us_per_sample"]) < 1e-9


def test_no_rounds(capsys):
    assert main(["speed", "--rounds", "0"]) == 2
    assert "--rounds 0" in capsys.readouterr().err
