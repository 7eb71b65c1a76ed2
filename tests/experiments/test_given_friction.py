"""identify where its user knows the dry friction, or a part of it."""

import json
from dataclasses import replace

import pytest
from identify_axes import VALUES, log

from flexaxis.experiments.cli import main
from flexaxis.experiments.logs.axis_file import find_axis
from flexaxis.experiments.logs.identification.identify import _free

F_C = 10 * VALUES[1]["f_m"]


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("given") / "rec.nc"
    return log(1, 10, "moves", seed=0, seconds=8.0).save(path)


def identify(record, *more):
    words = ["identify", record, "--model", "one_mass", "-o", record.with_name("axis.toml")]
    return main([*map(str, words), *more])


@pytest.mark.parametrize(
    "more",
    [(), pytest.param(("--friction", "coulomb"), marks=pytest.mark.slow)],
    ids=["auto", "coulomb"],
)
def test_a_level_that_is_given_stays(record, capsys, more):
    identify(record, "--fix", f"f_c={F_C}", "--json", *more)
    told = json.loads(capsys.readouterr().out)
    assert "f_c" not in told["estimates"]
    assert told["estimates"]["f_m"]["value"] == pytest.approx(VALUES[1]["f_m"], rel=0.05)
    axis = find_axis(str(record.with_name("axis.toml")))
    assert axis.model.nominal["f_c"] == F_C and axis.model.laws


def test_what_a_known_axis_has_at_zero_stays_there_unless_freed():
    known = replace(find_axis("two_mass").having({"f_l": 0.0}), known=True)
    assert "f_l" not in _free(known, (), ()) and "f_m" in _free(known, (), ())
    assert _free(known, ("f_l", "k"), ()) == ("f_l", "k")
    assert "f_l" in _free(replace(known, known=False), (), ())
